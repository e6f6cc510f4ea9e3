"""A jaxpr of scalars written out as a function of vectors.

Every primitive is one line of a table. Numbers known beforehand are folded; what depends on a
design's own numbers only is computed once a design, in front, and kept in rows of its own; the rest
is the body that runs in every step. Small arrays, such as the two components of a force, are taken
apart.
"""

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jax.extend.core import ClosedJaxpr, Literal

from jaxcrusher.batch.lanes.elementary import cosine, exponential, logarithm, power, sine
from jaxcrusher.batch.lanes.expression import is_expression, is_truth, sqrt, where
from jaxcrusher.batch.lanes.vector import Code

# The powers that are products and roots.
_POWERS: dict[float, Callable[[Any], Any]] = {
    0.5: sqrt,
    1.0: lambda x: x,
    1.5: lambda x: x * sqrt(x),
    2.0: lambda x: x * x,
    2.5: lambda x: x * x * sqrt(x),
}


def _number_of(x: Any) -> Any:
    """Of a truth value one or zero; a number remains."""
    return where(x, np.float64(1), np.float64(0)) if is_truth(x) else x


def _whole_power(base: Any, exponent: int) -> Any:
    if exponent < 0:
        return 1.0 / _whole_power(base, -exponent)
    if exponent < 2:
        return base if exponent else np.float64(1)
    half = _whole_power(base, exponent // 2)
    return half * half * base if exponent % 2 else half * half


def _power(x: Any, exponent: Any) -> Any:
    usual = None if is_expression(exponent) else _POWERS.get(float(exponent))
    return power(x, exponent) if usual is None else usual(x)


# Primitive -> what it does to its operands, vectors or numbers. A NaN of any operand is a NaN of
# the result.
ELEMENTWISE: dict[str, Callable[..., Any]] = {
    "abs": abs,
    "add": operator.add,
    "add_any": operator.add,
    "and": operator.and_,
    "clamp": lambda low, x, high: where(x < low, low, where(x > high, high, x)),
    "convert_element_type": _number_of,
    "cos": cosine,
    "div": operator.truediv,
    "eq": operator.eq,
    "exp": exponential,
    "ge": operator.ge,
    "gt": operator.gt,
    "is_finite": lambda x: abs(x) < np.inf,
    "le": operator.le,
    "log": logarithm,
    "lt": operator.lt,
    "max": lambda a, b: where((a > b) | (a != a), a, b),
    "min": lambda a, b: where((a < b) | (a != a), a, b),
    "mul": operator.mul,
    "ne": operator.ne,
    "neg": operator.neg,
    "not": operator.invert,
    "or": operator.or_,
    "pow": _power,
    "select_n": lambda truth, no, yes: where(truth, yes, no),
    "sign": lambda x: where((x == 0) | (x != x), x, where(x > 0, 1.0, -1.0)),
    "sin": sine,
    "sqrt": sqrt,
    "square": lambda x: x * x,
    "sub": operator.sub,
}
# Primitives that move the elements of arrays about.
STRUCTURAL: dict[str, Callable[..., np.ndarray]] = {
    "broadcast_in_dim": lambda x, shape, **_: np.broadcast_to(x, shape),
    "concatenate": lambda *parts, dimension, **_: np.concatenate(parts, dimension),
    "copy": lambda x, **_: x,
    "reshape": lambda x, new_sizes, **_: x.reshape(new_sizes),
    "stack": lambda *parts, axis, **_: np.stack(parts, axis),
    "squeeze": lambda x, dimensions, **_: x.squeeze(dimensions),
}


class Unsupported(Exception):
    """What lanes cannot do and another engine can; the text names it."""


@dataclass(eq=False)
class Atom:
    """A scalar of the functions: a number, or what `read` reads in the one that is being written.

    One that is `of_design` does not vary along a motion: it is a vector of `prepare`.
    """

    value: Any
    of_design: bool = False
    made_of: frozenset[int] = field(default_factory=frozenset)  # numbers of the design

    @property
    def known(self) -> bool:
        """Whether it is a number."""
        return isinstance(self.value, np.generic)

    @property
    def key(self) -> Any:
        """The same for what is the same."""
        return (str(self.value), self.value.dtype) if self.known else id(self)


def number(value: float) -> Atom:
    """A number known beforehand."""
    return Atom(np.float64(value), True)


class Emitter:
    """Writes bodies that share what is computed once a design, which `prepare` is to compute.

    What is kept of it stands in rows from `kept` on.
    """

    def __init__(self, prepare: Code, kept: int) -> None:
        self.prepare, self._first = prepare, kept
        self._rows: dict[Any, int] = {}  # of what the bodies read: key -> row
        self._kept: list[Atom] = []
        self.exponents: set[int] = set()  # the design's numbers that powers depend on
        self._found: dict[Any, Atom] = {}  # primitive and operands -> result
        self._body = prepare
        self._read_here: dict[Any, Any] = {}

    def given(self, i: int, row: int) -> Atom:
        """The design's number i, which stands in a row."""
        return Atom(self.prepare.read(row), True, frozenset({i}))

    def body(self, code: Code, function: ClosedJaxpr, operands: Sequence[Atom]) -> list[Any]:
        """Write a function of scalars; its results, arrays taken apart.

        Raises `Unsupported` for a primitive that is not in the tables.
        """
        self._body, self._read_here = code, {}
        self._found = {key: atom for key, atom in self._found.items() if atom.of_design}
        inputs = [np.array(atom, object) for atom in operands]
        results = walk(function, inputs, self._primitive, _atoms)
        return [self._read(atom) for result in results for atom in result.ravel()]

    def keep(self) -> list[Any]:
        """What `prepare` is to write from the first row on."""
        return [_number_of(atom.value) for atom in self._kept]

    def _primitive(self, name: str, params: dict[str, Any], operands: list) -> np.ndarray:
        """One primitive of arrays of atoms."""
        if name in STRUCTURAL:
            return STRUCTURAL[name](*operands, **params)
        meaning = operation(name, params)
        return elementwise(lambda *atoms: self._scalar(name, params, meaning, atoms), operands)

    def _scalar(
        self, name: str, params: dict[str, Any], meaning: Callable, operands: tuple[Atom, ...]
    ) -> Atom:
        """One primitive of scalars."""
        first, last = operands[0], operands[-1]
        if name == "pow":
            self.exponents |= last.made_of
        if name == "div" and last.of_design and not last.known and not first.of_design:
            inverse = self._apply("inverse", lambda x: 1.0 / x, (last,))
            return self._apply("mul", operator.mul, (first, inverse))
        name = f"{name} {params['y']}" if name == "integer_pow" else name
        return self._apply(name, meaning, operands)

    def _apply(self, name: str, function: Callable, operands: tuple[Atom, ...]) -> Atom:
        """A function of atoms, written once."""
        key = (name, *(atom.key for atom in operands))
        if key not in self._found:
            of_design = all(atom.of_design for atom in operands)
            values = [atom.value if of_design else self._read(atom) for atom in operands]
            made_of = frozenset[int]().union(*(atom.made_of for atom in operands))
            with np.errstate(all="ignore"):
                result = function(*values)
            if not (is_expression(result) or is_truth(result)):
                result = np.float64(result)
            self._found[key] = Atom(result, of_design, made_of if of_design else frozenset())
        return self._found[key]

    def _read(self, atom: Atom) -> Any:
        """In a body, what was computed once a design is read from a row."""
        if not atom.of_design or atom.known:
            return atom.value
        if atom.key not in self._rows:
            self._rows[atom.key] = self._first + len(self._kept)
            self._kept.append(atom)
        if atom.key not in self._read_here:
            value = self._body.read(self._rows[atom.key])
            # Rows hold numbers.
            self._read_here[atom.key] = value > 0 if is_truth(atom.value) else value
        return self._read_here[atom.key]


Primitive = Callable[[str, dict[str, Any], list], Any]


def walk(
    function: ClosedJaxpr, inputs: Sequence[Any], primitive: Primitive, constant: Callable
) -> list:
    """The results of a function by what `primitive` makes of its equations, calls inlined.

    `constant` makes of an array what a variable stands for.
    """
    jaxpr = function.jaxpr
    values = dict(zip(jaxpr.constvars, map(constant, function.consts), strict=True))
    values |= zip(jaxpr.invars, inputs, strict=True)

    def read(variable) -> Any:
        return constant(variable.val) if isinstance(variable, Literal) else values[variable]

    for equation in jaxpr.eqns:
        operands = [read(variable) for variable in equation.invars]
        name, params = equation.primitive.name, equation.params
        inner = params.get("jaxpr", params.get("call_jaxpr"))
        if inner is not None and name in ("jit", "pjit", "closed_call", "custom_jvp_call"):
            results = walk(inner, operands, primitive, constant)
        else:
            results = [primitive(name, params, operands)]
        values |= zip(equation.outvars, results, strict=True)
    return [read(variable) for variable in jaxpr.outvars]


def operation(name: str, params: dict[str, Any]) -> Callable[..., Any]:
    """What a primitive does to numbers or vectors.

    Raises `Unsupported` for one that is not in the table.
    """
    if name == "integer_pow":
        return lambda x: _whole_power(x, params["y"])
    if name not in ELEMENTWISE:
        raise Unsupported(f"the primitive `{name}`")
    return ELEMENTWISE[name]


def elementwise(function: Callable, operands: list[np.ndarray]) -> np.ndarray:
    """A function of scalars, of arrays of one shape, or of arrays and scalars."""
    scalars = np.broadcast(*operands)
    results = np.empty(scalars.shape, object)
    for i, entries in enumerate(scalars):
        results.flat[i] = function(*entries)
    return results


def _atoms(value: Any) -> np.ndarray:
    """A constant array as atoms."""
    array = np.asarray(value)
    atoms = np.empty(array.shape, object)
    kind = np.bool_ if array.dtype == bool else np.float64
    for i, entry in enumerate(array.flat):
        atoms.flat[i] = Atom(kind(entry), True)
    return atoms
