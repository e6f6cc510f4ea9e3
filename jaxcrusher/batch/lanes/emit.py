"""A known function of scalars written out as a function of vectors.

Numbers known beforehand are folded; what depends on a design's own numbers only is computed once a
design, in front, and kept in rows of its own; the rest is the body that runs in every step. Small
arrays, such as the two components of a force, are taken apart.
"""

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jax.extend.core import JaxprEqn, Literal

from jaxcrusher.batch.lanes.expression import (
    AS_WRITTEN,
    DOUBLE,
    INTEGER,
    TRUTH,
    bits,
    double,
    is_expression,
    kind_of,
    where,
)
from jaxcrusher.batch.lanes.known import Known
from jaxcrusher.batch.lanes.primitives import (
    ALONG_AXES,
    REAL,
    STRUCTURAL,
    TRUE,
    along,
    options,
    type_of,
    written,
)
from jaxcrusher.batch.lanes.vector import Code


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


def number(value: Any) -> Atom:
    """A number known beforehand."""
    return Atom(constant(value)[()], True)


# What the types of JAX are here: whole numbers of 32 bits have 64.
_OWN = {REAL: np.float64, TRUE: np.bool_}


def constant(value: Any, kind: str | None = None) -> np.ndarray:
    """Numbers of JAX, of their type or a given one, as an array of objects."""
    array = np.asarray(value, kind)
    own = _OWN.get(str(array.dtype), np.int64)
    found = np.empty(array.shape, object)
    for i, entry in enumerate(array.flat):
        found.flat[i] = own(entry)
    return found


def folded(function: Callable, *values: Any) -> Any:
    """What a function makes of expressions and numbers; of numbers alone a number, without a word.

    Numbers have the types of `constant`.
    """
    with np.errstate(all="ignore"):
        result = function(*values)
    return result if is_expression(result) else constant(result)[()]


def as_double(value: Any) -> Any:
    """A number of any type as the double that stands in a row of memory."""
    if kind_of(value) == INTEGER:
        return double(value)
    return where(value, 1.0, 0.0) if kind_of(value) == TRUTH else value


def from_double(value: Any, kind: Any) -> Any:
    """The number of a kind that `as_double` made a double of."""
    if kind == INTEGER:
        return bits(value)
    return value != 0.0 if kind == TRUTH else value


class Emitter:
    """Writes bodies that share what is computed once a design, which `prepare` is to compute.

    What is kept of it stands in rows from `kept` on.
    """

    def __init__(self, prepare: Code, kept: int) -> None:
        self.prepare, self._first = prepare, kept
        prepare.flags = AS_WRITTEN
        self._rows: dict[Any, int] = {}  # of what the bodies read: key -> row
        self._kept: list[Atom] = []
        self.exponents: set[int] = set()  # the design's numbers that powers depend on
        self._found: dict[Any, Atom] = {}  # primitive and operands -> result
        self._body = prepare
        self._read_here: dict[Any, Any] = {}

    def given(self, i: int, row: int, type_: str = REAL) -> Atom:
        """The design's number i, of a type of JAX, which stands in a row."""
        kind = {REAL: DOUBLE, TRUE: TRUTH}.get(type_, INTEGER)
        made_of = frozenset({i} if kind == DOUBLE else ())
        return Atom(from_double(self.prepare.read(row), kind), True, made_of)

    def body(self, code: Code, function: Known, operands: Sequence[Atom]) -> list[Any]:
        """Write a function of scalars; its results, arrays taken apart."""
        self._body, self._read_here = code, {}
        code.flags = AS_WRITTEN
        self._found = {key: atom for key, atom in self._found.items() if atom.of_design}
        inputs = [np.array(atom, object) for atom in operands]
        results = walk(function, inputs, self._primitive, _atoms)
        return [self._read(atom) for result in results for atom in result.ravel()]

    def keep(self) -> list[Any]:
        """What `prepare` is to write from the first row on."""
        return [as_double(atom.value) for atom in self._kept]

    def _primitive(self, equation: JaxprEqn, operands: list) -> np.ndarray:
        """One equation of arrays of atoms."""
        return of_arrays(
            equation, operands, lambda meaning, *atoms: self._scalar(equation, meaning, atoms)
        )

    def _scalar(self, equation: JaxprEqn, meaning: Callable, operands: tuple[Atom, ...]) -> Atom:
        """One equation of scalars."""
        name, type_ = equation.primitive.name, type_of(equation.outvars[0])
        first, last = operands[0], operands[-1]
        if name == "pow":
            self.exponents |= last.made_of
        varies = last.of_design and not last.known and not first.of_design
        if name == "div" and type_ == REAL and varies:
            inverse = self._apply("inverse", lambda x: 1.0 / x, (last,))
            return self._apply("product", operator.mul, (first, inverse))
        return self._apply(f"{name} {type_} {equation.params}", meaning, operands)

    def _apply(self, name: str, function: Callable, operands: tuple[Atom, ...]) -> Atom:
        """A function of atoms, written once for all that have its name."""
        key = (name, *(atom.key for atom in operands))
        if key not in self._found:
            of_design = all(atom.of_design for atom in operands)
            values = [atom.value if of_design else self._read(atom) for atom in operands]
            made_of = frozenset[int]().union(*(atom.made_of for atom in operands))
            result = folded(function, *values)
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
            self._read_here[atom.key] = from_double(value, kind_of(atom.value))
        return self._read_here[atom.key]


Primitive = Callable[[JaxprEqn, list], Any]


def walk(
    function: Known, inputs: Sequence[Any], primitive: Primitive, literal: Callable = constant
) -> list:
    """The results of a function by what `primitive` makes of its equations.

    `literal` makes of a constant array what a variable stands for.
    """
    values = {v: literal(array, type_of(v)) for v, array in function.constants.items()}
    values |= zip(function.operands, inputs, strict=True)

    def read(variable) -> Any:
        known = isinstance(variable, Literal)
        return literal(variable.val, type_of(variable)) if known else values[variable]

    for equation in function.equations:
        values[equation.outvars[0]] = primitive(equation, [read(v) for v in equation.invars])
    return [read(variable) for variable in function.results]


def of_arrays(equation: JaxprEqn, operands: list, one: Callable) -> np.ndarray:
    """An equation of arrays; `one` is given what to do, and the elements to do it to."""
    name, params = equation.primitive.name, equation.params
    if name in STRUCTURAL:
        structural = STRUCTURAL[name]
        return structural.write(*operands, **options(structural, params))
    if name in ALONG_AXES:
        operands = along(operands[0], params["axes"])
    meaning = written(equation)
    return elementwise(lambda *elements: one(meaning, *elements), operands)


def elementwise(function: Callable, operands: list[np.ndarray]) -> np.ndarray:
    """A function of scalars, of arrays of one shape, or of arrays and scalars."""
    shape = np.broadcast_shapes(*(operand.shape for operand in operands))
    columns = [np.broadcast_to(operand, shape).flat for operand in operands]
    results = np.empty(shape, object)
    for i, entries in enumerate(zip(*columns, strict=True)):
        results.flat[i] = function(*entries)
    return results


def _atoms(value: Any, kind: str) -> np.ndarray:
    """A constant array as atoms."""
    return elementwise(lambda entry: Atom(entry, True), [constant(value, kind)])
