"""Numbers side by side: operators that write LLVM's instructions on vectors.

Python runs a function of `Vector`s once, and what it would compute is written down, as JAX traces.
Every lane goes the same way through the same instructions, so that its bits are its own.
"""

import functools
from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir

# Lanes of all functions. What one instruction does not hold LLVM splits in two or four, whose
# chains of instructions run side by side: twice what AVX2 holds, and once or twice what others do.
LANES = 16
WIDTH = 16 if llvm.get_host_cpu_features().get("avx512f") else 8

DOUBLE, INTEGER, TRUTH = ir.DoubleType(), ir.IntType(64), ir.IntType(1)
FLOATS, INTEGERS, TRUTHS = (ir.VectorType(kind, WIDTH) for kind in (DOUBLE, INTEGER, TRUTH))
POINTER = ir.PointerType()
# Sums in any order, but with NaN and infinity kept: a trial step may leave the linkage's reach.
FAST = ("reassoc", "contract", "arcp", "nsz")


def _operator(of_floats: str, of_integers: str, swapped: bool = False) -> Callable[..., Any]:
    def method(self: "Vector", other: Any) -> "Vector":
        other = self.like(other)
        left, right = (other, self) if swapped else (self, other)
        builder = self.code.builder
        if self.value.type == FLOATS:
            write = getattr(builder, of_floats)
            return self.new(write(left.value, right.value, flags=self.code.flags))
        return self.new(getattr(builder, of_integers)(left.value, right.value))

    return method


def _comparison(symbol: str) -> Callable[..., Any]:
    def method(self: "Vector", other: Any) -> "Vector":
        pair, builder = (symbol, self.value, self.like(other).value), self.code.builder
        if self.value.type != FLOATS:
            return self.new(builder.icmp_signed(*pair))
        # Nothing is equal to NaN, and everything is unequal to it.
        return self.new((builder.fcmp_unordered if symbol == "!=" else builder.fcmp_ordered)(*pair))

    return method


class Vector:
    """Doubles, whole numbers of 64 bits or truth values of `WIDTH` lanes in a function."""

    __slots__ = ("code", "value")
    __array_ufunc__ = None  # numbers of NumPy leave operators to this class
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, code: "Code", value: Any) -> None:
        self.code, self.value = code, value

    def new(self, value: Any) -> "Vector":
        """Another value of the same function."""
        return Vector(self.code, value)

    def like(self, other: Any) -> "Vector":
        """A number as a vector of the same kind; vectors remain."""
        if isinstance(other, Vector):
            return other
        cast = float if self.value.type == FLOATS else int
        return self.new(ir.Constant(self.value.type, cast(other)))

    __add__, __radd__ = _operator("fadd", "add"), _operator("fadd", "add")
    __sub__, __rsub__ = _operator("fsub", "sub"), _operator("fsub", "sub", swapped=True)
    __mul__, __rmul__ = _operator("fmul", "mul"), _operator("fmul", "mul")
    __truediv__ = _operator("fdiv", "sdiv")
    __rtruediv__ = _operator("fdiv", "sdiv", swapped=True)
    __and__, __rand__ = _operator("", "and_"), _operator("", "and_")
    __or__, __ror__ = _operator("", "or_"), _operator("", "or_")
    __lshift__, __rshift__ = _operator("", "shl"), _operator("", "ashr")
    __lt__, __le__, __gt__, __ge__ = map(_comparison, ("<", "<=", ">", ">="))
    __eq__, __ne__ = _comparison("=="), _comparison("!=")  # type: ignore[assignment]

    def __neg__(self) -> "Vector":
        return self.new(self.code.builder.fneg(self.value, flags=self.code.flags))

    def __invert__(self) -> "Vector":
        return self.new(self.code.builder.not_(self.value))

    def __abs__(self) -> "Vector":
        return self.code.call("llvm.fabs", self)


def is_vector(value: Any) -> bool:
    """Whether it is one."""
    return isinstance(value, Vector)


def is_truth(value: Any) -> bool:
    """Whether it is one, or a vector of them."""
    return isinstance(value, np.bool_) or (isinstance(value, Vector) and value.value.type == TRUTHS)


def where(truth: Any, one: Any, other: Any) -> Any:
    """`one` where it is true, `other` elsewhere; of numbers a number."""
    if not isinstance(truth, Vector):
        return one if truth else other
    like = next((v for v in (one, other) if isinstance(v, Vector)), truth.code.vector(0.0))
    chosen = like.like(one).value, like.like(other).value
    return truth.new(truth.code.builder.select(truth.value, *chosen))


def sqrt(x: Any) -> Any:
    """The square root."""
    return x.code.call("llvm.sqrt", x) if isinstance(x, Vector) else np.sqrt(x)


def fma(a: Any, b: Any, c: Any) -> Any:
    """A b + c, rounded once."""
    vector = next(operand for operand in (a, b, c) if isinstance(operand, Vector))
    return vector.code.call("llvm.fma", *map(vector.like, (a, b, c)))


def floor(x: Any) -> Any:
    """The next whole number below."""
    return x.code.call("llvm.floor", x) if isinstance(x, Vector) else np.floor(x)


def bits(x: Vector) -> Vector:
    """The 64 bits of a double as a whole number."""
    return x.new(x.code.builder.bitcast(x.value, INTEGERS))


def double(x: Vector) -> Vector:
    """The double of 64 bits."""
    return x.new(x.code.builder.bitcast(x.value, FLOATS))


def exactly(of_numbers: Callable) -> Callable[[Callable], Callable]:
    """A function whose sums are added up as they are written; of numbers alone, another one."""

    def decorate(function: Callable) -> Callable:
        @functools.wraps(function)
        def exact(*operands: Any) -> Any:
            code = next((v.code for v in operands if isinstance(v, Vector)), None)
            if code is None:
                return of_numbers(*operands)
            flags, code.flags = code.flags, ()
            try:
                return function(*map(code.vector, operands))
            finally:
                code.flags = flags

        return exact

    return decorate


class Code:
    """A function as it is written, for `WIDTH` lanes at a time.

    Its operands are the memory of the lanes, in which row r stands at [r * LANES], the first lane,
    and as many rows as it has names for.
    """

    def __init__(self, module: ir.Module, name: str, rows: int = 0) -> None:
        kind = ir.FunctionType(ir.VoidType(), [POINTER, INTEGER, *[INTEGER] * rows])
        self.function = ir.Function(module, kind, name)
        self.function.linkage = "internal"
        self.function.attributes.add("nounwind")
        self.function.attributes.add("noinline")
        self.memory, self.first, *self.rows = self.function.args
        self.builder = ir.IRBuilder(self.function.append_basic_block())
        self.flags: tuple[str, ...] = FAST

    def vector(self, value: Any) -> Vector:
        """A number as doubles; vectors remain."""
        return Vector(self, ir.Constant(FLOATS, 0.0)).like(value)

    def _place(self, row: Any, lane: ir.Value | None = None) -> Any:
        lanes = self.builder.mul(self.row(row), ir.Constant(INTEGER, LANES))
        index = self.builder.add(lanes, self.first if lane is None else lane)
        return self.builder.gep(self.memory, [index], source_etype=DOUBLE)

    def row(self, row: Any, more: int = 0) -> Any:
        """The number of a row, `more` after another one."""
        if not isinstance(row, ir.Value):
            return ir.Constant(INTEGER, row + more)
        return self.builder.add(row, ir.Constant(INTEGER, more))

    def read(self, row: Any, more: int = 0) -> Vector:
        """A row of the memory."""
        place = self._place(self.row(row, more))
        return Vector(self, self.builder.load(place, align=8, typ=FLOATS))

    def write(self, value: Any, row: Any, more: int = 0) -> None:
        """Keep a value in a row of the memory, from the first lane on."""
        self.builder.store(self.vector(value).value, self._place(self.row(row, more)), align=8)

    def write_from(self, value: Any, row: Any, place: int) -> None:
        """Keep a value from a place of a row on, and from the first lane."""
        lane = self.builder.add(self.first, ir.Constant(INTEGER, place))
        self.builder.store(self.vector(value).value, self._place(row, lane), align=8)

    def write_number(self, value: Any, row: Any, place: int) -> None:
        """Keep what is the same in all lanes, as one number at a place of a row."""
        at = self._place(row, ir.Constant(INTEGER, place))
        self.builder.store(self.lane(value), at, align=8)

    def call(self, intrinsic: str, *operands: Vector) -> Vector:
        """One of LLVM's functions of doubles."""
        kind = ir.FunctionType(FLOATS, [FLOATS] * len(operands))
        function = _declared(self.function.module, f"{intrinsic}.v{WIDTH}f64", kind)
        return Vector(self, self.builder.call(function, [operand.value for operand in operands]))

    def scalar(self, row: Any, place: Any = 0) -> Vector:
        """The number at a place of a row, and of those that follow it, in all lanes."""
        place = self._place(row, self.builder.fptosi(self.lane(place), INTEGER))
        return self.alike(self.builder.load(place, align=8, typ=DOUBLE))

    def alike(self, number: Any) -> Vector:
        """A double in all lanes."""
        first = ir.Constant(ir.IntType(32), 0)
        one = self.builder.insert_element(ir.Constant(FLOATS, ir.Undefined), number, first)
        everywhere = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
        return Vector(self, self.builder.shuffle_vector(one, one, everywhere))

    def lane(self, value: Any, lane: int = 0) -> Any:
        """The double of one lane."""
        place = ir.Constant(ir.IntType(32), lane)
        return self.builder.extract_element(self.vector(value).value, place)

    def positions(self) -> Vector:
        """The first lane and those that follow it, as doubles."""
        first = self.alike(self.builder.sitofp(self.first, DOUBLE))
        return first + Vector(self, ir.Constant(FLOATS, [float(i) for i in range(WIDTH)]))

    def loop(self, count: int, start: list, body: Callable[[list[Vector]], list[Vector]]) -> list:
        """Run `body` for the first of `count` lanes, and every `WIDTH` more.

        It is given what it gave back the last time, at first `start`; the last is the result.
        """
        builder, outside, before = self.builder, self.first, self.builder.block
        inside, after = (self.function.append_basic_block() for _ in range(2))
        builder.branch(inside)
        builder.position_at_end(inside)
        self.first = builder.phi(INTEGER)
        self.first.add_incoming(ir.Constant(INTEGER, 0), before)
        carried = [builder.phi(FLOATS) for _ in start]
        for phi, value in zip(carried, start, strict=True):
            phi.add_incoming(self.vector(value).value, before)
        results = body([Vector(self, phi) for phi in carried])
        following = builder.add(self.first, ir.Constant(INTEGER, WIDTH))
        self.first.add_incoming(following, builder.block)
        for phi, result in zip(carried, results, strict=True):
            phi.add_incoming(result.value, builder.block)
        more = builder.icmp_signed("<", following, ir.Constant(INTEGER, count))
        builder.cbranch(more, inside, after)
        builder.position_at_end(after)
        self.first = outside
        return results

    def end(self, by_name: bool = False) -> "Code":
        """Itself, once it is written; `by_name` for those outside the module too."""
        self.builder.ret_void()
        if by_name:
            self.function.linkage = ""
        return self

    def run(self, other: "Code", *rows: Any) -> None:
        """Call another function for the same lanes."""
        numbers = map(self.row, rows)
        self.builder.call(other.function, [self.memory, self.first, *numbers])


def over_lanes(module: ir.Module, name: str, part: Code, lanes: int = LANES) -> None:
    """A function of the memory, and of the rows of `part`, that runs `part` for all lanes."""
    kind = ir.FunctionType(ir.VoidType(), [POINTER, *[INTEGER] * len(part.rows)])
    function = ir.Function(module, kind, name)
    memory, *rows = function.args
    builder = ir.IRBuilder(function.append_basic_block())
    for first in range(0, lanes, WIDTH):
        builder.call(part.function, [memory, ir.Constant(INTEGER, first), *rows])
    builder.ret_void()


def _declared(module: ir.Module, name: str, kind: ir.FunctionType) -> Any:
    return module.globals.get(name) or ir.Function(module, kind, name)
