"""What a thread does by itself: loops, conditions, and arrays by index."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from llvmlite import ir

from jaxcrusher.batch.lanes.expression import (
    INTEGER,
    POINTER,
    Expression,
    Function,
    declared,
)
from jaxcrusher.batch.lanes.vector import Code, Module


class Routine(Function):
    """A function as it is written; its operands are a table of addresses and a first lane.

    Its conditions and loops are those of `with` statements: what is written inside runs if, or as
    often as, they say.
    """

    def __init__(self, module: Module, name: str) -> None:
        super().__init__(module, name, [POINTER, INTEGER])
        self._table, first = self.function.args
        self.shape, self.first = module.shape, Expression(self, first)
        self.flags = ()

    def number(self, value: Any) -> Expression:
        """A whole number."""
        return Expression(self, ir.Constant(INTEGER, 0)).like(value)

    def whole(self, double: Expression) -> Expression:
        """A double as a whole number."""
        return Expression(self, self.builder.fptosi(double.value, INTEGER))

    def when(self, truth: Expression) -> AbstractContextManager:
        """If it is true."""
        return self.builder.if_then(truth.value)

    def either(self, truth: Expression) -> AbstractContextManager:
        """What to do if it is true, and if it is not."""
        return self.builder.if_else(truth.value)

    @contextmanager
    def repeat(self, going_on: Callable[[], Expression]) -> Iterator[None]:
        """As long as it is true."""
        head, inside, after = (self.function.append_basic_block() for _ in range(3))
        self.builder.branch(head)
        self.builder.position_at_end(head)
        self.builder.cbranch(going_on().value, inside, after)
        self.builder.position_at_end(inside)
        yield
        self.builder.branch(head)
        self.builder.position_at_end(after)

    def each_lane(self) -> AbstractContextManager[Expression]:
        """For every lane of the thread."""
        return self.each(self.first, self.first + self.shape.own)

    def each_vector(self) -> AbstractContextManager[Expression]:
        """For every first lane of an instruction."""
        return self.each(self.first, self.first + self.shape.own, self.shape.width)

    @contextmanager
    def each(self, first: Any, end: Any, step: int = 1) -> Iterator[Expression]:
        """For every whole number from the first one on, before the end."""
        i = self.variable(first)
        with self.repeat(lambda: i[0] < end):
            yield i[0]
            i[0] = i[0] + step

    def variable(self, value: Any) -> "Array":
        """A whole number that changes, as an array of one."""
        with self.builder.goto_entry_block():
            place = self.builder.alloca(INTEGER)
        made = Array(self, place, INTEGER)
        made[0] = value
        return made

    def array(self, place: int, kind: ir.Type, *lengths: Any) -> "Array":
        """The one whose address stands at this place of the table; lengths of axes but the first.

        Of `DOUBLE` or `INTEGER`.
        """
        row = self.builder.gep(self._table, [ir.Constant(INTEGER, place)], source_etype=POINTER)
        return Array(self, self.builder.load(row, typ=POINTER), kind, *lengths)

    def run(self, part: Code, memory: "Array", first: Any, *rows: int) -> None:
        """Run a function of lanes, from the first of them on."""
        numbers = [self.number(i).value for i in (first, *rows)]
        self.builder.call(part.function, [memory.address, *numbers])

    def any(self, truths: Expression) -> Expression:
        """Whether one of a vector is true."""
        kind = ir.FunctionType(ir.IntType(1), [truths.value.type])
        name = f"llvm.vector.reduce.or.v{self.shape.width}i1"
        function = declared(self.function.module, name, kind)
        return Expression(self, self.builder.call(function, [truths.value]))


class Array:
    """Doubles or whole numbers in memory, read and written by index."""

    def __init__(self, code: Routine, address: ir.Value, kind: ir.Type, *lengths: Any) -> None:
        self._code, self.address, self._kind, self._lengths = code, address, kind, lengths

    def __getitem__(self, index: Any) -> Expression:
        builder = self._code.builder
        return Expression(self._code, builder.load(self.place(index), align=8, typ=self._kind))

    def __setitem__(self, index: Any, value: Any) -> None:
        like = Expression(self._code, ir.Constant(self._kind, 0))
        self._code.builder.store(like.like(value).value, self.place(index), align=8)

    def lanes(self, *index: Any) -> Expression:
        """Doubles from this place on, as many as an instruction has lanes."""
        kind = ir.VectorType(self._kind, self._code.shape.width)
        load = self._code.builder.load(self.place(index), align=8, typ=kind)
        return Expression(self._code, load)

    def place(self, index: Any) -> ir.Value:
        """The address of an element."""
        first, *others = index if isinstance(index, tuple) else (index,)
        for length, i in zip(self._lengths, others, strict=True):
            first = first * length + i
        at = self._code.number(first).value
        return self._code.builder.gep(self.address, [at], source_etype=self._kind)

    def now(self, index: Any) -> Expression:
        """Its value, which another thread may have changed since."""
        builder = self._code.builder
        word = builder.load_atomic(self.place(index), "monotonic", 8, typ=self._kind)
        return Expression(self._code, word)

    def take(self, index: Any) -> Expression:
        """A whole number, which is one more afterwards; no two threads get the same."""
        one = ir.Constant(INTEGER, 1)
        builder = self._code.builder
        return Expression(
            self._code, builder.atomic_rmw("add", self.place(index), one, "monotonic")
        )
