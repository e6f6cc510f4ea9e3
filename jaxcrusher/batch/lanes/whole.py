"""Whole numbers: doubles rounded to them, conversions, and divisions, as JAX has them.

All of these are functions of numbers of NumPy too.
"""

from typing import Any

import numpy as np
from llvmlite import ir

from jaxcrusher.batch.lanes.expression import (
    DOUBLE,
    INTEGER,
    TRUTH,
    Expression,
    bits,
    declared,
    exactly,
    intrinsic,
    is_expression,
    kind_of,
    suffix,
    typed_as,
    where,
)

# From here on all doubles are whole numbers, and quotients of doubles are not.
LARGEST_QUOTIENT = 2.0**52


def floor(x: Any) -> Any:
    """The next whole number below."""
    return intrinsic("llvm.floor", x) if is_expression(x) else np.floor(x)


def ceil(x: Any) -> Any:
    """The next whole number above."""
    return intrinsic("llvm.ceil", x) if is_expression(x) else np.ceil(x)


def nearest_even(x: Any) -> Any:
    """The nearest whole number, the even one of two."""
    return intrinsic("llvm.roundeven", x) if is_expression(x) else np.rint(x)


def nearest_away(x: Any) -> Any:
    """The nearest whole number, the larger one in size of two."""
    size = abs(x)
    below = floor(size)
    rounded = below + where(size - below >= 0.5, 1.0, 0.0)
    if is_expression(x):
        return intrinsic("llvm.copysign", rounded, x)
    return np.copysign(rounded, x)


def truth_of(x: Any) -> Any:
    """Whether a number is not zero; NaN is not, and truth values remain."""
    return x if kind_of(x) == TRUTH else x != typed_as(x, 0)


def double_of(x: Any) -> Any:
    """A truth value or a whole number as a double; doubles remain."""
    if not isinstance(x, Expression):
        return np.float64(x)
    if x.kind == INTEGER:
        return x.new(x.code.builder.sitofp(x.value, x.of(DOUBLE)))
    return where(x, 1.0, 0.0) if x.kind == TRUTH else x


def whole_of(x: Any) -> Any:
    """A number as a whole one of 64 bits: a double without its fraction, the largest if beyond.

    NaN is zero.
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
    """A whole number, or the nearest one of a range."""
    x = where(x < least, typed_as(x, least), x)
    return where(x > most, typed_as(x, most), x)


def wrapped(x: Any) -> Any:
    """The lowest 32 bits of a whole number as one with a sign."""
    return (x << np.int64(32)) >> np.int64(32)


def quotient(a: Any, b: Any) -> Any:
    """The quotient of whole numbers without its fraction; -1 for b = 0."""
    trap = (b == 0) | (b == -1)  # of processors
    divisor = where(trap, typed_as(b, 1), b)
    if is_expression(a) or is_expression(divisor):
        found = a / divisor
    else:
        found = a // divisor + ((a % divisor != 0) & ((a < 0) != (divisor < 0)))
    return where(b == 0, typed_as(a, -1), where(b == -1, -a, found))


def remainder(a: Any, b: Any) -> Any:
    """What division of whole numbers leaves, with the sign of a; a for b = 0."""
    return where(b == 0, a, a - quotient(a, b) * b)


@exactly(np.fmod)
def modulo(x: Any, y: Any) -> Any:
    """What division of doubles leaves, with the sign of x.

    NaN where the quotient is `LARGEST_QUOTIENT` or more.
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
