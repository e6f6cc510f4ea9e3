"""Functions of LLVM as they are written: vectors of lanes, their memory, conditions and loops."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any, NamedTuple

import llvmlite.binding as llvm
from llvmlite import ir

from jaxcrusher.lanes.expression import (
    DOUBLE,
    FAST,
    INTEGER,
    POINTER,
    TRUTH,
    Expression,
    declared,
    kind_of,
)


class Shape(NamedTuple):
    """How many lanes there are."""

    lanes: int  # in a row of their memory
    width: int  # in an instruction
    own: int  # of a thread


# The lanes of a processor's core. LLVM splits vectors wider than a register into two or four, whose
# chains of instructions run side by side: twice what AVX2 holds, and once or twice what others do.
CORES = Shape(16, 16 if llvm.get_host_cpu_features().get("avx512f") else 8, 16)
# The lanes of a GPU's warp: each thread has one, and what threads read at once stands side by side.
WARPS = Shape(32, 1, 1)
LANES, WIDTH = CORES.lanes, CORES.width


class Module(ir.Module):
    """Functions of lanes of one shape."""

    def __init__(self, shape: Shape = CORES) -> None:
        super().__init__("lanes")
        self.shape = shape


class Code:
    """A function under construction, which returns nothing.

    Its operands are an address, the first lane, and a number of `rows`. The address points to the
    memory of the lanes, row r at [r * lanes], or to a table of other addresses.
    Conditions and loops are `with` statements, which control the code written inside them.
    """

    def __init__(
        self, module: Module, name: str, rows: int = 0, flags: tuple[str, ...] = FAST
    ) -> None:
        operands = [POINTER, INTEGER, *[INTEGER] * rows]
        self.function = ir.Function(module, ir.FunctionType(ir.VoidType(), operands), name)
        self.function.linkage = "internal"
        self.function.attributes.add("nounwind")
        self.function.attributes.add("noinline")
        self.builder = ir.IRBuilder(self.function.append_basic_block())
        self.shape, self.flags = module.shape, flags
        self._address, *numbers = self.function.args
        self.first, *self.rows = (Expression(self, number) for number in numbers)
        self.memory = Array(self, self._address, DOUBLE, module.shape.lanes)

    def end(self, by_name: bool = False) -> "Code":
        """Finish the function; with `by_name` it is found from outside of the module too."""
        self.builder.ret_void()
        if by_name:
            self.function.linkage = ""
        return self

    def read(self, row: Any) -> Expression:
        """Read a row of the memory, from the first lane on."""
        return self.memory.vector(row, self.first)

    def write(self, value: Any, row: Any) -> None:
        """Keep a value in a row of the memory, from the first lane on."""
        self.memory[row, self.first] = self.vector(value)

    def number(self, value: Any) -> Expression:
        """Make a whole number an expression."""
        return Expression(self, ir.Constant(INTEGER, 0)).like(value)

    def vector(self, value: Any) -> Expression:
        """Make a number a vector of its kind; vectors remain."""
        kind = ir.VectorType(kind_of(value), self.shape.width)
        return Expression(self, ir.Constant(kind, 0)).like(value)

    def alike(self, number: Expression) -> Expression:
        """Put a number into all lanes of a vector."""
        width = self.shape.width
        kind, index = ir.VectorType(number.value.type, width), ir.IntType(32)
        undefined, first = ir.Constant(kind, ir.Undefined), ir.Constant(index, 0)
        one = self.builder.insert_element(undefined, number.value, first)
        everywhere = ir.Constant(ir.VectorType(index, width), [0] * width)
        return Expression(self, self.builder.shuffle_vector(one, one, everywhere))

    def lane(self, value: Any, lane: int = 0) -> Expression:
        """Take the number of one lane out of a vector."""
        place = ir.Constant(ir.IntType(32), lane)
        return Expression(self, self.builder.extract_element(self.vector(value).value, place))

    def positions(self, first: Expression) -> Expression:
        """Count from a whole number on, lane by lane, in doubles."""
        start = self.alike(Expression(self, self.builder.sitofp(first.value, DOUBLE)))
        kind = ir.VectorType(DOUBLE, self.shape.width)
        return start + Expression(self, ir.Constant(kind, list(map(float, range(kind.count)))))

    def any(self, truths: Expression) -> Expression:
        """Say whether any entry of a vector is true."""
        kind = ir.FunctionType(TRUTH, [truths.value.type])
        name = f"llvm.vector.reduce.or.v{self.shape.width}i1"
        function = declared(self.function.module, name, kind)
        return Expression(self, self.builder.call(function, [truths.value]))

    @contextmanager
    def each_true(self, truths: Expression) -> Iterator[Expression]:
        """Run what is inside for the place of every true entry of a vector."""
        width, builder = self.shape.width, self.builder
        mask = builder.bitcast(truths.value, ir.IntType(width))
        left = self.variable(Expression(self, builder.zext(mask, INTEGER)))
        with self.repeat(lambda: left[0] > 0):
            zeros_behind = builder.cttz(left[0].value, ir.Constant(TRUTH, 1))
            yield Expression(self, zeros_behind)
            left[0] = left[0] & (left[0] - 1)

    def when(self, truth: Expression) -> AbstractContextManager:
        """Run what is inside if a condition is true."""
        return self.builder.if_then(truth.value)

    def either(self, truth: Expression) -> AbstractContextManager:
        """Run the first part inside if it is true, the second one if not."""
        return self.builder.if_else(truth.value)

    @contextmanager
    def repeat(self, going_on: Callable[[], Expression]) -> Iterator[None]:
        """Run what is inside as long as a condition is true."""
        head, inside, after = (self.function.append_basic_block() for _ in range(3))
        self.builder.branch(head)
        self.builder.position_at_end(head)
        self.builder.cbranch(going_on().value, inside, after)
        self.builder.position_at_end(inside)
        yield
        self.builder.branch(head)
        self.builder.position_at_end(after)

    @contextmanager
    def each(self, first: Any, end: Any, step: int = 1) -> Iterator[Expression]:
        """Run what is inside for every whole number from `first` on, below `end`."""
        i = self.variable(self.number(first))
        with self.repeat(lambda: i[0] < end):
            yield i[0]
            i[0] = i[0] + step

    def each_lane(self) -> AbstractContextManager[Expression]:
        """Run what is inside for every lane of the thread."""
        return self.each(self.first, self.first + self.shape.own)

    def each_vector(self) -> AbstractContextManager[Expression]:
        """Run what is inside for the first lane of every vector of the thread."""
        return self.each(self.first, self.first + self.shape.own, self.shape.width)

    def variable(self, value: Expression) -> "Array":
        """Make a value a variable, an array with one number."""
        with self.builder.goto_entry_block():
            place = self.builder.alloca(value.value.type)
        made = Array(self, place, value.value.type)
        made[0] = value
        return made

    def array(self, place: int, kind: ir.Type, *lengths: Any) -> "Array":
        """Find the array whose address stands at this place of the table.

        Its numbers are `DOUBLE` or `INTEGER`; `lengths` are those of its axes but the first.
        """
        row = self.builder.gep(self._address, [ir.Constant(INTEGER, place)], source_etype=POINTER)
        return Array(self, self.builder.load(row, typ=POINTER), kind, *lengths)

    def run(self, other: "Code", *rows: Any, memory: "Array | None" = None, first: Any = None):
        """Call another function for the same memory and lanes, or for others."""
        numbers = (self.first if first is None else first, *rows)
        address = self._address if memory is None else memory.address
        self.builder.call(other.function, [address, *(self.number(i).value for i in numbers)])


class Array:
    """Numbers in memory, read and written by index."""

    def __init__(self, code: Code, address: ir.Value, kind: ir.Type, *lengths: Any) -> None:
        self._code, self.address, self._kind, self._lengths = code, address, kind, lengths

    def __getitem__(self, index: Any) -> Expression:
        return self._load(index, self._kind)

    def __setitem__(self, index: Any, value: Any) -> None:
        like = Expression(self._code, ir.Constant(self._kind, 0))
        self._code.builder.store(like.like(value).value, self._place(index), align=8)

    def vector(self, *index: Any) -> Expression:
        """Read numbers from this place on, as many as an instruction has lanes."""
        return self._load(index, ir.VectorType(self._kind, self._code.shape.width))

    def now(self, index: Any) -> Expression:
        """Read a number that another thread may have changed since."""
        place = self._place(index)
        load = self._code.builder.load_atomic(place, "monotonic", 8, typ=self._kind)
        return Expression(self._code, load)

    def take(self, index: Any) -> Expression:
        """Read a whole number and add one to it; no two threads get the same."""
        one, place = ir.Constant(INTEGER, 1), self._place(index)
        return Expression(self._code, self._code.builder.atomic_rmw("add", place, one, "monotonic"))

    def _load(self, index: Any, kind: ir.Type) -> Expression:
        place = self._place(index)
        return Expression(self._code, self._code.builder.load(place, align=8, typ=kind))

    def _place(self, index: Any) -> ir.Value:
        first, *others = index if isinstance(index, tuple) else (index,)
        for length, i in zip(self._lengths, others, strict=True):
            first = first * length + i
        at = self._code.number(first).value
        return self._code.builder.gep(self.address, [at], source_etype=self._kind)
