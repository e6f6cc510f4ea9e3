"""Operators on doubles and whole numbers that write LLVM's instructions.

Python runs a function of `Expression`s once, and its operations are recorded, as JAX traces. Most
functions here also take NumPy's numbers, and then return numbers.
"""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir

DOUBLE, INTEGER, TRUTH = ir.DoubleType(), ir.IntType(64), ir.IntType(1)
POINTER = ir.PointerType()
# Sums in any order, but with NaN and infinity kept: a trial step may leave the linkage's reach.
FAST = ("reassoc", "contract", "arcp", "nsz")
# For the equations of a user: sums as they are written, products rounded with what is added to
# them, as XLA does on a CPU; several quotients of one divisor are products with its inverse. In any
# order (a + b) - a would be b.
AS_WRITTEN = ("contract", "arcp")


def _operator(of_floats: str, of_integers: str, swapped: bool = False) -> Callable[..., Any]:
    def method(self: "Expression", other: Any) -> "Expression":
        other = self.like(other)
        left, right = (other, self) if swapped else (self, other)
        builder = self.code.builder
        if self.kind == DOUBLE:
            write = getattr(builder, of_floats)
            return self.new(write(left.value, right.value, flags=self.code.flags))
        return self.new(getattr(builder, of_integers)(left.value, right.value))

    return method


def _comparison(symbol: str) -> Callable[..., Any]:
    def method(self: "Expression", other: Any) -> "Expression":
        pair, builder = (symbol, self.value, self.like(other).value), self.code.builder
        if self.kind == TRUTH:
            # With a sign, a true value would be -1.
            return self.new(builder.icmp_unsigned(*pair))
        if self.kind == INTEGER:
            return self.new(builder.icmp_signed(*pair))
        # Nothing is equal to NaN, and everything is unequal to it.
        return self.new((builder.fcmp_unordered if symbol == "!=" else builder.fcmp_ordered)(*pair))

    return method


class Expression:
    """A double, a whole number of 64 bits or a truth value in a function, or a vector of them.

    `code` is the function that is being written, a `code.Code`.
    """

    __slots__ = ("code", "value")
    __array_ufunc__ = None  # numbers of NumPy leave operators to this class
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, code: Any, value: Any) -> None:
        self.code, self.value = code, value

    @property
    def kind(self) -> ir.Type:
        """Say whether it is a `DOUBLE`, an `INTEGER` or a `TRUTH`."""
        return getattr(self.value.type, "element", self.value.type)

    def of(self, kind: ir.Type) -> ir.Type:
        """Give the type of as many numbers of another kind."""
        type_ = self.value.type
        return ir.VectorType(kind, type_.count) if isinstance(type_, ir.VectorType) else kind

    def new(self, value: Any) -> "Expression":
        """Make another value of the same function an expression."""
        return Expression(self.code, value)

    def like(self, other: Any) -> "Expression":
        """Make a number an expression of the same type; expressions remain."""
        if isinstance(other, Expression):
            return other
        cast = float if self.kind == DOUBLE else int
        return self.new(ir.Constant(self.value.type, cast(other)))

    __add__, __radd__ = _operator("fadd", "add"), _operator("fadd", "add")
    __sub__, __rsub__ = _operator("fsub", "sub"), _operator("fsub", "sub", swapped=True)
    __mul__, __rmul__ = _operator("fmul", "mul"), _operator("fmul", "mul")
    __truediv__ = _operator("fdiv", "sdiv")
    __rtruediv__ = _operator("fdiv", "sdiv", swapped=True)
    __and__, __rand__ = _operator("", "and_"), _operator("", "and_")
    __or__, __ror__ = _operator("", "or_"), _operator("", "or_")
    __xor__, __rxor__ = _operator("", "xor"), _operator("", "xor")
    __lshift__, __rshift__ = _operator("", "shl"), _operator("", "ashr")
    __lt__, __le__, __gt__, __ge__ = map(_comparison, ("<", "<=", ">", ">="))
    __eq__, __ne__ = _comparison("=="), _comparison("!=")  # type: ignore[assignment]

    def __neg__(self) -> "Expression":
        if self.kind == INTEGER:
            return self.like(0) - self
        return self.new(self.code.builder.fneg(self.value, flags=self.code.flags))

    def __invert__(self) -> "Expression":
        return self.new(self.code.builder.not_(self.value))

    def __abs__(self) -> "Expression":
        if self.kind == INTEGER:
            return where(self < 0, -self, self)
        return intrinsic("llvm.fabs", self)


def intrinsic(name: str, *operands: Expression) -> Expression:
    """Call one of LLVM's functions of doubles."""
    first = operands[0]
    type_ = first.of(DOUBLE)
    kind = ir.FunctionType(type_, [type_] * len(operands))
    function = declared(first.code.function.module, f"{name}.{suffix(type_)}", kind)
    return first.new(first.code.builder.call(function, [operand.value for operand in operands]))


def suffix(type_: ir.Type) -> str:
    """Name a type as LLVM's functions do."""
    vector = isinstance(type_, ir.VectorType)
    name = "f64" if getattr(type_, "element", type_) == DOUBLE else "i64"
    return f"v{type_.count}{name}" if vector else name


def declared(module: ir.Module, name: str, kind: ir.FunctionType) -> Any:
    """Declare a function that is defined elsewhere, once a module."""
    return module.globals.get(name) or ir.Function(module, kind, name)


def kind_of(value: Any) -> ir.Type:
    """Say which kind an expression or a number is of."""
    if isinstance(value, Expression):
        return value.kind
    whole = INTEGER if isinstance(value, np.integer) else DOUBLE
    return TRUTH if isinstance(value, np.bool_) else whole


def typed_as(one: Any, value: Any) -> Any:
    """Give a number the type of another one, or of an expression."""
    return one.like(value) if isinstance(one, Expression) else type(one)(value)


def where(truth: Any, one: Any, other: Any) -> Any:
    """Choose `one` where it is true, `other` elsewhere; numbers make a number."""
    if not isinstance(truth, Expression):
        return one if truth else other
    like = next((v for v in (one, other) if isinstance(v, Expression)), None)
    like = truth.new(ir.Constant(truth.of(kind_of(one)), 0)) if like is None else like
    chosen = like.like(one).value, like.like(other).value
    return truth.new(truth.code.builder.select(truth.value, *chosen))


def fma(a: Any, b: Any, c: Any) -> Any:
    """Return a b + c, rounded once."""
    one = next(operand for operand in (a, b, c) if isinstance(operand, Expression))
    return intrinsic("llvm.fma", *map(one.like, (a, b, c)))


def bits(x: Expression) -> Expression:
    """Read the 64 bits of a double as a whole number."""
    return x.new(x.code.builder.bitcast(x.value, x.of(INTEGER)))


def double(x: Expression) -> Expression:
    """Read the 64 bits of a whole number as a double."""
    return x.new(x.code.builder.bitcast(x.value, x.of(DOUBLE)))


def exactly(of_numbers: Callable) -> Callable[[Callable], Callable]:
    """Have a function's sums computed as written; numbers alone go to `of_numbers`."""

    def decorate(function: Callable) -> Callable:
        @functools.wraps(function)
        def exact(*operands: Any) -> Any:
            one = next((v for v in operands if isinstance(v, Expression)), None)
            if one is None:
                return of_numbers(*operands)
            flags, one.code.flags = one.code.flags, ()
            try:
                return function(*map(one.like, operands))
            finally:
                one.code.flags = flags

        return exact

    return decorate


def _one_of(name: str, of_numbers: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Make one function of LLVM's of expressions and NumPy's of numbers."""
    return lambda x: intrinsic(name, x) if isinstance(x, Expression) else of_numbers(x)


sqrt = _one_of("llvm.sqrt", np.sqrt)
floor, ceil = _one_of("llvm.floor", np.floor), _one_of("llvm.ceil", np.ceil)
nearest_even = _one_of("llvm.roundeven", np.rint)

# From here on all doubles are whole numbers, and quotients of doubles are not.
LARGEST_QUOTIENT = 2.0**52


def nearest_away(x: Any) -> Any:
    """Round to the nearest whole number, ties away from zero."""
    size = abs(x)
    below = floor(size)
    rounded = below + where(size - below >= 0.5, 1.0, 0.0)
    signed = isinstance(x, Expression)
    return intrinsic("llvm.copysign", rounded, x) if signed else np.copysign(rounded, x)


def truth_of(x: Any) -> Any:
    """Say whether a number is not zero, which NaN is not; truth values remain."""
    return x if kind_of(x) == TRUTH else x != typed_as(x, 0)


def double_of(x: Any) -> Any:
    """Convert a truth value or a whole number to a double; doubles remain."""
    if not isinstance(x, Expression):
        return np.float64(x)
    if x.kind == INTEGER:
        return x.new(x.code.builder.sitofp(x.value, x.of(DOUBLE)))
    return where(x, 1.0, 0.0) if x.kind == TRUTH else x


def whole_of(x: Any) -> Any:
    """Convert a number to a whole one of 64 bits: a double loses its fraction.

    Out of range it becomes the nearest such number, and NaN becomes zero.
    """
    kind = kind_of(x)
    if not isinstance(x, Expression):
        return _whole(x) if kind == DOUBLE else np.int64(x)
    if kind == TRUTH:
        return x.new(x.code.builder.zext(x.value, x.of(INTEGER)))
    if kind == INTEGER:
        return x
    to, of = x.of(INTEGER), x.value.type
    name = f"llvm.fptosi.sat.{suffix(to)}.{suffix(of)}"
    function = declared(x.code.function.module, name, ir.FunctionType(to, [of]))
    return x.new(x.code.builder.call(function, [x.value]))


def _whole(x: float) -> np.int64:
    limits = np.iinfo(np.int64)
    if abs(x) < 2.0**63:
        return np.int64(x)
    return np.int64(0 if x != x else limits.max if x > 0 else limits.min)


def clipped(x: Any, least: int, most: int) -> Any:
    """Clip a whole number to a range."""
    x = where(x < least, typed_as(x, least), x)
    return where(x > most, typed_as(x, most), x)


def wrapped(x: Any) -> Any:
    """Take the lowest 32 bits of a whole number for one with a sign."""
    return (x << np.int64(32)) >> np.int64(32)


def quotient(a: Any, b: Any) -> Any:
    """Divide whole numbers, without the fraction; a division by zero gives -1."""
    trap = (b == 0) | (b == -1)  # of processors
    divisor = where(trap, typed_as(b, 1), b)
    if isinstance(a, Expression) or isinstance(divisor, Expression):
        found = a / divisor
    else:
        found = a // divisor + ((a % divisor != 0) & ((a < 0) != (divisor < 0)))
    return where(b == 0, typed_as(a, -1), where(b == -1, -a, found))


def remainder(a: Any, b: Any) -> Any:
    """Return the remainder of whole numbers, with the sign of a; for b = 0 it is a."""
    return where(b == 0, a, a - quotient(a, b) * b)


@exactly(np.fmod)
def modulo(x: Any, y: Any) -> Any:
    """Return the remainder of doubles, with the sign of x.

    It is NaN where the quotient is `LARGEST_QUOTIENT` or more.
    """
    size, divisor = abs(x), abs(y)
    found = size / divisor
    times = floor(found)
    # Exact; a quotient that was rounded up to a whole number is one too many.
    left = intrinsic("llvm.fma", -times, divisor, size)
    left = where(left < 0.0, left + divisor, left)
    left = where(found < LARGEST_QUOTIENT, left, np.nan)
    left = where((divisor == np.inf) & (size < np.inf), size, left)
    return where(bits(x) < 0, -left, left)
