"""The primitives of JAX that lanes know: a line of a table says of which types, and how.

A value is a double, a whole number of 64 bits or a truth value. Whole numbers of 32 bits are kept
in 64, and cut to 32 after each operation. What is not in the tables is refused (see `known`).
"""

import operator
from collections.abc import Callable, Sequence
from functools import partial, reduce
from typing import Any, NamedTuple

import numpy as np
from jax.extend.core import JaxprEqn

from jaxcrusher.batch.lanes.elementary import (
    angle,
    arc_cosine,
    arc_sine,
    arc_tangent,
    cosine,
    cube_root,
    exponential,
    exponential_less_one,
    hyperbolic_cosine,
    hyperbolic_sine,
    hyperbolic_tangent,
    logarithm,
    logarithm_of_one_more,
    logistic,
    power,
    power_of_two,
    sine,
    tangent,
)
from jaxcrusher.batch.lanes.expression import (
    DOUBLE,
    TRUTH,
    intrinsic,
    is_expression,
    kind_of,
    sqrt,
    typed_as,
    where,
)
from jaxcrusher.batch.lanes.whole import (
    ceil,
    clipped,
    double_of,
    floor,
    modulo,
    nearest_away,
    nearest_even,
    quotient,
    remainder,
    truth_of,
    whole_of,
    wrapped,
)

# The types of the values of a program.
REAL, TRUE = "float64", "bool"
TYPES = (REAL, "int64", "int32", TRUE)


def shape_of(variable: Any) -> tuple[int, ...]:
    """The shape of a variable or a literal."""
    return variable.aval.shape


def type_of(variable: Any) -> str:
    """The name of its type."""
    return str(getattr(variable.aval, "dtype", variable.aval))


def _root(x: Any) -> Any:
    """X^0.5, which is infinite for minus infinity too; the square root is NaN there."""
    return sqrt(where(x == -np.inf, typed_as(x, np.inf), x))


# The powers that are products and roots.
_POWERS: dict[float, Callable[[Any], Any]] = {
    0.5: _root,
    1.0: lambda x: x,
    1.5: lambda x: abs(x) * _root(x),
    2.0: lambda x: x * x,
    2.5: lambda x: x * x * _root(x),
}


def _power(x: Any, exponent: Any) -> Any:
    exponent = double_of(exponent)
    usual = None if is_expression(exponent) else _POWERS.get(float(exponent))
    return power(x, exponent) if usual is None else usual(x)


def _whole_power(base: Any, exponent: int) -> Any:
    if exponent < 0:
        return 1.0 / _whole_power(base, -exponent)
    if exponent < 2:
        return base if exponent else typed_as(base, 1)
    half = _whole_power(base, exponent // 2)
    return half * half * base if exponent % 2 else half * half


def _largest(a: Any, b: Any) -> Any:
    """NaN if one of them is; zero is larger than minus zero."""
    if kind_of(a) == TRUTH:
        return a | b
    if kind_of(a) != DOUBLE:
        return where(a > b, a, b)
    a, b = (a, b) if is_expression(a) else (b, a)
    if is_expression(b):
        return intrinsic("llvm.maximum", a, b)
    # With a number it is one instruction.
    if b != b:
        return b
    return where(a < b if np.signbit(b) else a <= b, b, a)


def _smallest(a: Any, b: Any) -> Any:
    """NaN if one of them is; minus zero is smaller than zero."""
    if kind_of(a) == TRUTH:
        return a & b
    if kind_of(a) != DOUBLE:
        return where(a < b, a, b)
    a, b = (a, b) if is_expression(a) else (b, a)
    if is_expression(b):
        return intrinsic("llvm.minimum", a, b)
    if b != b:
        return b
    return where(a >= b if np.signbit(b) else a > b, b, a)


def _sign(x: Any) -> Any:
    signed = where(x > 0, typed_as(x, 1), typed_as(x, -1))
    return where((x == 0) | (x != x), x, signed)


def _selected(which: Any, *cases: Any) -> Any:
    """The case of this number; of two, the second one if it is true."""
    if kind_of(which) == TRUTH:
        return where(which, cases[1], cases[0])
    found = cases[-1]
    for i, case in reversed(list(enumerate(cases[:-1]))):
        found = where(which <= i, case, found)
    return found


def _divided(a: Any, b: Any) -> Any:
    return a / b if kind_of(a) == DOUBLE else quotient(a, b)


def _left(a: Any, b: Any) -> Any:
    return modulo(a, b) if kind_of(a) == DOUBLE else remainder(a, b)


def _converted(x: Any, new_dtype: Any) -> Any:
    to = np.dtype(new_dtype)
    if to == np.bool_:
        return truth_of(x)
    if to == np.float64:
        return double_of(x)
    if to == np.int32 and kind_of(x) == DOUBLE:
        limits = np.iinfo(np.int32)
        return clipped(whole_of(x), limits.min, limits.max)
    return whole_of(x)


def _is_finite(x: Any) -> Any:
    return abs(x) < np.inf


class Operation(NamedTuple):
    """What a primitive does to numbers or vectors, and the kinds of number that it takes."""

    write: Callable[..., Any]  # of operands; of options too, by name
    kinds: str = "f"  # f: doubles, i: whole numbers, b: truth values
    options: tuple[str, ...] = ()  # parameters that `write` takes


# Rounding methods of JAX, by number.
_ROUNDED = {0: nearest_away, 1: nearest_even}

# Of each element alone. A NaN of any operand is a NaN of the result.
ELEMENTWISE: dict[str, Operation] = {
    "abs": Operation(abs, "fi"),
    "acos": Operation(arc_cosine),
    "add": Operation(operator.add, "fi"),
    "add_any": Operation(operator.add, "fi"),
    "and": Operation(operator.and_, "ib"),
    "asin": Operation(arc_sine),
    "atan": Operation(arc_tangent),
    "atan2": Operation(angle),
    "cbrt": Operation(cube_root),
    "ceil": Operation(ceil),
    "clamp": Operation(lambda low, x, high: _smallest(_largest(low, x), high), "fi"),
    "convert_element_type": Operation(_converted, "fib", ("new_dtype",)),
    "cos": Operation(cosine),
    "cosh": Operation(hyperbolic_cosine),
    "div": Operation(_divided, "fi"),
    "eq": Operation(operator.eq, "fib"),
    "exp": Operation(exponential),
    "exp2": Operation(power_of_two),
    "expm1": Operation(exponential_less_one),
    "floor": Operation(floor),
    "ge": Operation(operator.ge, "fib"),
    "gt": Operation(operator.gt, "fib"),
    "integer_pow": Operation(lambda x, y: _whole_power(x, y), "fi", ("y",)),
    "is_finite": Operation(_is_finite),
    "le": Operation(operator.le, "fib"),
    "log": Operation(logarithm),
    "log1p": Operation(logarithm_of_one_more),
    "logistic": Operation(logistic),
    "lt": Operation(operator.lt, "fib"),
    "max": Operation(_largest, "fib"),
    "min": Operation(_smallest, "fib"),
    "mul": Operation(operator.mul, "fi"),
    "ne": Operation(operator.ne, "fib"),
    "neg": Operation(operator.neg, "fi"),
    "not": Operation(operator.invert, "ib"),
    "or": Operation(operator.or_, "ib"),
    "pow": Operation(_power, "fi"),
    "rem": Operation(_left, "fi"),
    "round": Operation(
        lambda x, rounding_method: _ROUNDED[int(rounding_method)](x), "f", ("rounding_method",)
    ),
    "rsqrt": Operation(lambda x: 1.0 / sqrt(x)),
    "select_n": Operation(_selected, "fib"),
    "sign": Operation(_sign, "fi"),
    "sin": Operation(sine),
    "sinh": Operation(hyperbolic_sine),
    "sqrt": Operation(sqrt),
    "square": Operation(lambda x: x * x, "fi"),
    "sub": Operation(operator.sub, "fi"),
    "tan": Operation(tangent),
    "tanh": Operation(hyperbolic_tangent),
    "xor": Operation(operator.xor, "ib"),
}


def _broadcast(x: np.ndarray, shape: Any, broadcast_dimensions: Any) -> np.ndarray:
    kept = [1] * len(shape)
    for axis, length in zip(broadcast_dimensions, x.shape, strict=True):
        kept[axis] = length
    return np.broadcast_to(x.reshape(kept), shape)


def parts(start_indices: Any, limit_indices: Any, strides: Any) -> tuple[slice, ...]:
    """The parts of axes that `slice` takes."""
    steps = strides or [None] * len(start_indices)
    return tuple(map(slice, start_indices, limit_indices, steps))


# Primitives that move the elements of arrays about.
STRUCTURAL: dict[str, Operation] = {
    "broadcast_in_dim": Operation(_broadcast, "fib", ("shape", "broadcast_dimensions")),
    "concatenate": Operation(
        lambda *arrays, dimension: np.concatenate(arrays, dimension), "fib", ("dimension",)
    ),
    "copy": Operation(lambda x: x, "fib"),
    "reshape": Operation(lambda x, new_sizes: x.reshape(new_sizes), "fib", ("new_sizes",)),
    "slice": Operation(
        lambda x, **where_: x[parts(**where_)],
        "fib",
        ("start_indices", "limit_indices", "strides"),
    ),
    "squeeze": Operation(lambda x, dimensions: x.squeeze(dimensions), "fib", ("dimensions",)),
    "stack": Operation(lambda *arrays, axis: np.stack(arrays, axis), "fib", ("axis",)),
}


def _place_of_largest(*cells: Any) -> Any:
    """The first place of the largest, or of a NaN."""
    largest, place = cells[0], np.int64(0)
    for i, cell in enumerate(cells[1:], 1):
        better = (cell > largest) | ((cell != cell) & (largest == largest))
        place = where(better, np.int64(i), place)
        largest = where(better, cell, largest)
    return place


# Primitives of axes of which each is a function of the elements along them.
ALONG_AXES: dict[str, Operation] = {
    "argmax": Operation(_place_of_largest, "fib"),
    "reduce_and": Operation(lambda *cells: reduce(operator.and_, cells), "b"),
    "reduce_max": Operation(lambda *cells: reduce(_largest, cells), "fib"),
    "reduce_min": Operation(lambda *cells: reduce(_smallest, cells), "fib"),
    "reduce_or": Operation(lambda *cells: reduce(operator.or_, cells), "b"),
    # From zero on, as XLA: the sum of minus zeros is zero.
    "reduce_sum": Operation(
        lambda *cells: reduce(operator.add, cells, typed_as(cells[0], 0)), "fi"
    ),
}
# Those of an array whose first axis is that of the instants: what they take.
OVER_INSTANTS = {"argmax": "f", "reduce_max": "f", "reduce_min": "f", "reduce_sum": "fi"}


def along(array: np.ndarray, axes: Sequence[int]) -> list[np.ndarray]:
    """The elements along axes, each an array of the others."""
    last = np.moveaxis(array, axes, range(-len(axes), 0))
    flat = last.reshape(*last.shape[: array.ndim - len(axes)], -1)
    return [flat[..., i] for i in range(flat.shape[-1])]


# Parameters that do not change a value: where it stands, how exact it is at least, and whether
# its type gives way to others, which JAX has settled when it traced.
_IGNORED = {"accuracy", "axes", "index_dtype", "out_sharding", "sharding", "weak_type"}


def unknown_option(operation: Operation, params: dict[str, Any]) -> str | None:
    """The name of a parameter that an operation does not know, if it has one."""
    others = {name for name, value in params.items() if value is not None}
    return min(others - _IGNORED - {*operation.options}, default=None)


def options(operation: Operation, params: dict[str, Any]) -> dict[str, Any]:
    """The parameters that it takes."""
    return {name: params[name] for name in operation.options}


def written(equation: JaxprEqn) -> Callable[..., Any]:
    """What an equation does to numbers or vectors: elements of operands, or along axes."""
    name = equation.primitive.name
    operation = ELEMENTWISE.get(name) or ALONG_AXES[name]
    taken = options(operation, equation.params)
    function = partial(operation.write, **taken) if taken else operation.write
    if type_of(equation.outvars[0]) == "int32":
        return lambda *operands: wrapped(function(*operands))
    return function
