"""What instructions compute: operators that write LLVM's text.

Python runs a function of `Expression`s once, and what it would compute is written down, as JAX
traces.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from llvmlite import ir

DOUBLE, INTEGER, TRUTH = ir.DoubleType(), ir.IntType(64), ir.IntType(1)
POINTER = ir.PointerType()
# Sums in any order, but with NaN and infinity kept: a trial step may leave the linkage's reach.
FAST = ("reassoc", "contract", "arcp", "nsz")
# For the equations of a user: sums as they are written, products rounded with what is added to
# them, as XLA does on a CPU. In any order (a + b) - a would be b.
AS_WRITTEN = ("contract",)


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
    """A double, a whole number of 64 bits or a truth value in a function; or a vector of them."""

    __slots__ = ("code", "value")
    __array_ufunc__ = None  # numbers of NumPy leave operators to this class
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, code: "Function", value: Any) -> None:
        self.code, self.value = code, value

    @property
    def kind(self) -> ir.Type:
        """`DOUBLE`, `INTEGER` or `TRUTH`."""
        return getattr(self.value.type, "element", self.value.type)

    def of(self, kind: ir.Type) -> ir.Type:
        """The type of as many of another kind."""
        type_ = self.value.type
        return ir.VectorType(kind, type_.count) if isinstance(type_, ir.VectorType) else kind

    def new(self, value: Any) -> "Expression":
        """Another value of the same function."""
        return Expression(self.code, value)

    def like(self, other: Any) -> "Expression":
        """A number as an expression of the same type; expressions remain."""
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
    """One of LLVM's functions of doubles."""
    first = operands[0]
    type_ = first.of(DOUBLE)
    kind = ir.FunctionType(type_, [type_] * len(operands))
    function = declared(first.code.function.module, f"{name}.{suffix(type_)}", kind)
    return first.new(first.code.builder.call(function, [operand.value for operand in operands]))


def suffix(type_: ir.Type) -> str:
    """How LLVM's functions name a type."""
    vector = isinstance(type_, ir.VectorType)
    name = "f64" if getattr(type_, "element", type_) == DOUBLE else "i64"
    return f"v{type_.count}{name}" if vector else name


def declared(module: ir.Module, name: str, kind: ir.FunctionType) -> Any:
    """A function that is defined elsewhere."""
    return module.globals.get(name) or ir.Function(module, kind, name)


def is_expression(value: Any) -> bool:
    """Whether it is one."""
    return isinstance(value, Expression)


def kind_of(value: Any) -> ir.Type:
    """The kind of an expression or of a number."""
    if isinstance(value, Expression):
        return value.kind
    whole = INTEGER if isinstance(value, np.integer) else DOUBLE
    return TRUTH if isinstance(value, np.bool_) else whole


def typed_as(one: Any, value: Any) -> Any:
    """A number of the type of another one, or of an expression."""
    return one.like(value) if isinstance(one, Expression) else type(one)(value)


def where(truth: Any, one: Any, other: Any) -> Any:
    """`one` where it is true, `other` elsewhere; of numbers a number."""
    if not isinstance(truth, Expression):
        return one if truth else other
    like = next((v for v in (one, other) if isinstance(v, Expression)), None)
    like = truth.new(ir.Constant(truth.of(kind_of(one)), 0)) if like is None else like
    chosen = like.like(one).value, like.like(other).value
    return truth.new(truth.code.builder.select(truth.value, *chosen))


def sqrt(x: Any) -> Any:
    """The square root."""
    return intrinsic("llvm.sqrt", x) if isinstance(x, Expression) else np.sqrt(x)


def fma(a: Any, b: Any, c: Any) -> Any:
    """A b + c, rounded once."""
    one = next(operand for operand in (a, b, c) if isinstance(operand, Expression))
    return intrinsic("llvm.fma", *map(one.like, (a, b, c)))


def bits(x: Expression) -> Expression:
    """The 64 bits of a double as a whole number."""
    return x.new(x.code.builder.bitcast(x.value, x.of(INTEGER)))


def double(x: Expression) -> Expression:
    """The double of 64 bits."""
    return x.new(x.code.builder.bitcast(x.value, x.of(DOUBLE)))


def exactly(of_numbers: Callable) -> Callable[[Callable], Callable]:
    """A function whose sums are added up as they are written; of numbers alone, another one."""

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


class Function:
    """A function of LLVM as it is written; it gives nothing back."""

    def __init__(self, module: ir.Module, name: str, operands: Sequence[ir.Type]) -> None:
        self.function = ir.Function(module, ir.FunctionType(ir.VoidType(), operands), name)
        self.function.linkage = "internal"
        self.function.attributes.add("nounwind")
        self.function.attributes.add("noinline")
        self.builder = ir.IRBuilder(self.function.append_basic_block())
        self.flags: tuple[str, ...] = FAST

    def end(self, by_name: bool = False) -> Any:
        """Itself, once it is written; `by_name` for those outside the module too."""
        self.builder.ret_void()
        if by_name:
            self.function.linkage = ""
        return self
