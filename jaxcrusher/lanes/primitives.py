"""The primitives of JAX that lanes know: a line of a table says of which types, and how.

A value is a double, a whole number of 64 bits or a truth value. Whole numbers of 32 bits are kept
in 64, and cut to 32 after each operation. What is not in the tables is refused (see `verify`).
"""

import operator
from collections.abc import Callable, Sequence
from functools import partial, reduce
from typing import Any, NamedTuple

import numpy as np
from jax.extend.core import JaxprEqn

from jaxcrusher.lanes import elementary
from jaxcrusher.lanes.expression import (
    DOUBLE,
    TRUTH,
    Expression,
    ceil,
    clipped,
    double_of,
    floor,
    intrinsic,
    kind_of,
    modulo,
    nearest_away,
    nearest_even,
    quotient,
    remainder,
    sqrt,
    truth_of,
    typed_as,
    where,
    whole_of,
    wrapped,
)

# The types of JAX, and what stands for them here.
REAL, TRUE = "float64", "bool"
TYPES = {REAL: np.float64, "int64": np.int64, "int32": np.int64, TRUE: np.bool_}


def type_of(variable: Any) -> str:
    """Name the type of a variable or a literal."""
    return str(getattr(variable.aval, "dtype", variable.aval))


def constant(value: Any, kind: str | None = None) -> np.ndarray:
    """Put numbers of JAX, of their type or a given one, into an array of objects."""
    array = np.asarray(value, kind)
    found = np.empty(array.shape, object)
    for i, entry in enumerate(array.flat):
        found.flat[i] = TYPES.get(str(array.dtype), np.int64)(entry)
    return found


def folded(function: Callable, *values: Any) -> Any:
    """Apply a function to expressions and numbers; numbers alone make a number, without warnings.

    Numbers have the types of `constant`.
    """
    with np.errstate(all="ignore"):
        result = function(*values)
    return result if isinstance(result, Expression) else constant(result)[()]


def _root(x: Any) -> Any:
    """Return x^0.5, which is infinite for minus infinity too; the square root is NaN there."""
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
    usual = None if isinstance(exponent, Expression) else _POWERS.get(float(exponent))
    return elementary.power(x, exponent) if usual is None else usual(x)


def _whole_power(base: Any, exponent: int) -> Any:
    if exponent < 0:
        return 1.0 / _whole_power(base, -exponent)
    if exponent < 2:
        return base if exponent else typed_as(base, 1)
    half = _whole_power(base, exponent // 2)
    return half * half * base if exponent % 2 else half * half


def _extreme(largest: bool) -> Callable[[Any, Any], Any]:
    """Make the larger or the smaller of two; NaN is both, and zero is larger than minus zero."""
    beyond, or_equal = (operator.gt, operator.ge) if largest else (operator.lt, operator.le)
    of_truths = operator.or_ if largest else operator.and_

    def extreme(a: Any, b: Any) -> Any:
        if kind_of(a) == TRUTH:
            return of_truths(a, b)
        if kind_of(a) != DOUBLE:
            return where(beyond(a, b), a, b)
        a, b = (a, b) if isinstance(a, Expression) else (b, a)
        if isinstance(b, Expression):
            return intrinsic("llvm.maximum" if largest else "llvm.minimum", a, b)
        # With a number it is one instruction.
        if b != b:
            return b
        strictly = np.signbit(b) == largest
        return where(beyond(b, a) if strictly else or_equal(b, a), b, a)

    return extreme


_largest, _smallest = _extreme(True), _extreme(False)


def _sign(x: Any) -> Any:
    signed = where(x > 0, typed_as(x, 1), typed_as(x, -1))
    return where((x == 0) | (x != x), x, signed)


def _selected(which: Any, *cases: Any) -> Any:
    """Choose the case of this number; of two, the second one if it is true."""
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
    """How a primitive is written for numbers or vectors, and the kinds of number that it takes."""

    write: Callable[..., Any]  # of operands; of options too, by name
    kinds: str = "f"  # f: doubles, i: whole numbers, b: truth values
    options: tuple[str, ...] = ()  # parameters that `write` takes

    def with_options(self, params: dict[str, Any]) -> Callable[..., Any]:
        """Give `write` the parameters that it takes."""
        taken = {name: params[name] for name in self.options}
        return partial(self.write, **taken) if taken else self.write


# Rounding methods of JAX, by number.
_ROUNDED = {0: nearest_away, 1: nearest_even}

# Of each element alone. A NaN of any operand is a NaN of the result.
ELEMENTWISE: dict[str, Operation] = {
    "abs": Operation(abs, "fi"),
    "add": Operation(operator.add, "fi"),
    "add_any": Operation(operator.add, "fi"),
    "and": Operation(operator.and_, "ib"),
    "asin": Operation(elementary.arc_sine),
    "atan": Operation(elementary.arc_tangent),
    "atan2": Operation(elementary.angle),
    "ceil": Operation(ceil),
    "clamp": Operation(lambda low, x, high: _smallest(_largest(low, x), high), "fi"),
    "convert_element_type": Operation(_converted, "fib", ("new_dtype",)),
    "cos": Operation(elementary.cosine),
    "div": Operation(_divided, "fi"),
    "eq": Operation(operator.eq, "fib"),
    "exp": Operation(elementary.exponential),
    "expm1": Operation(elementary.exponential_less_one),
    "floor": Operation(floor),
    "ge": Operation(operator.ge, "fib"),
    "gt": Operation(operator.gt, "fib"),
    "integer_pow": Operation(lambda x, y: _whole_power(x, y), "fi", ("y",)),
    "is_finite": Operation(_is_finite),
    "le": Operation(operator.le, "fib"),
    "log": Operation(elementary.logarithm),
    "log1p": Operation(elementary.logarithm_of_one_more),
    "logistic": Operation(elementary.logistic),
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
    "sin": Operation(elementary.sine),
    "sqrt": Operation(sqrt),
    "square": Operation(lambda x: x * x, "fi"),
    "sub": Operation(operator.sub, "fi"),
    "tan": Operation(elementary.tangent),
    "tanh": Operation(elementary.hyperbolic_tangent),
    "xor": Operation(operator.xor, "ib"),
}


def _broadcast(x: np.ndarray, shape: Any, broadcast_dimensions: Any) -> np.ndarray:
    kept = [1] * len(shape)
    for axis, length in zip(broadcast_dimensions, x.shape, strict=True):
        kept[axis] = length
    return np.broadcast_to(x.reshape(kept), shape)


def parts(start_indices: Any, limit_indices: Any, strides: Any) -> tuple[slice, ...]:
    """Return the parts of axes that `slice` takes."""
    steps = strides or [None] * len(start_indices)
    return tuple(map(slice, start_indices, limit_indices, steps))


# Primitives that move the elements of arrays about.
STRUCTURAL: dict[str, Operation] = {
    "broadcast_in_dim": Operation(_broadcast, "fib", ("shape", "broadcast_dimensions")),
    "concatenate": Operation(
        lambda *arrays, dimension: np.concatenate(arrays, dimension), "fib", ("dimension",)
    ),
    "copy": Operation(lambda x: x, "fib"),
    "stop_gradient": Operation(lambda x: x, "fib"),
    "reshape": Operation(lambda x, new_sizes: x.reshape(new_sizes), "fib", ("new_sizes",)),
    "slice": Operation(
        lambda x, **where_: x[parts(**where_)],
        "fib",
        ("start_indices", "limit_indices", "strides"),
    ),
    "squeeze": Operation(lambda x, dimensions: x.squeeze(dimensions), "fib", ("dimensions",)),
    "stack": Operation(lambda *arrays, axis: np.stack(arrays, axis), "fib", ("axis",)),
}


def larger(one: Sequence, other: Sequence) -> list:
    """Choose the larger of two values with their places, or a NaN; of equal ones the first."""
    (best, at), (value, place) = one, other
    better = (value > best) | ((value != value) & (best == best))
    equal = (value == best) | ((value != value) & (best != best))
    take = better | (equal & (place < at))
    return [where(take, value, best), where(take, place, at)]


def _place_of_largest(*cells: Any) -> Any:
    """Find the first place of the largest, or of a NaN."""
    return reduce(larger, [(cell, np.int64(i)) for i, cell in enumerate(cells)])[1]


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


def elementwise(function: Callable, operands: Sequence[np.ndarray]) -> np.ndarray:
    """Apply a function of scalars to arrays of one shape, or to arrays and scalars."""
    shape = np.broadcast_shapes(*(operand.shape for operand in operands))
    columns = [np.broadcast_to(operand, shape).flat for operand in operands]
    results = np.empty(shape, object)
    for i, entries in enumerate(zip(*columns, strict=True)):
        results.flat[i] = function(*entries)
    return results


def of_arrays(equation: JaxprEqn, operands: list, one: Callable) -> np.ndarray:
    """Apply an equation to arrays; `one` is given what to do, and the elements to do it to."""
    name, params = equation.primitive.name, equation.params
    if name in STRUCTURAL:
        return STRUCTURAL[name].with_options(params)(*operands)
    if name in ALONG_AXES:
        operands = _along(operands[0], params["axes"])
    meaning = written(equation)
    return elementwise(lambda *elements: one(meaning, *elements), operands)


def _along(array: np.ndarray, axes: Sequence[int]) -> list[np.ndarray]:
    """Take an array apart along axes, into arrays of its other axes."""
    last = np.moveaxis(array, axes, range(-len(axes), 0))
    flat = last.reshape(*last.shape[: array.ndim - len(axes)], -1)
    return [flat[..., i] for i in range(flat.shape[-1])]


def written(equation: JaxprEqn) -> Callable[..., Any]:
    """Say what an equation does to numbers or vectors: elements of operands, or along axes."""
    name = equation.primitive.name
    function = (ELEMENTWISE.get(name) or ALONG_AXES[name]).with_options(equation.params)
    if type_of(equation.outvars[0]) == "int32":
        return lambda *operands: wrapped(function(*operands))
    return function
