"""Verified functions of scalars written out as functions of lanes.

Numbers known beforehand are folded; what depends on a design's own numbers only is computed once a
design, in front, and kept in rows of its own; the rest is the body that runs in every step. Small
arrays, such as the two components of a force, are taken apart.
"""

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jax.extend.core import JaxprEqn

from jaxcrusher.lanes.code import Code
from jaxcrusher.lanes.expression import (
    AS_WRITTEN,
    DOUBLE,
    INTEGER,
    TRUTH,
    bits,
    double,
    kind_of,
    where,
)
from jaxcrusher.lanes.primitives import (
    REAL,
    TRUE,
    constant,
    elementwise,
    folded,
    of_arrays,
    type_of,
)
from jaxcrusher.lanes.verify import Verified


@dataclass(eq=False)
class Atom:
    """A scalar of the functions: a number, or an expression of the one that is being written.

    One that is `of_design` does not vary along a motion: it is a vector of `prepare`.
    """

    value: Any
    of_design: bool = False

    @property
    def known(self) -> bool:
        """Say whether it is a number."""
        return isinstance(self.value, np.generic)

    @property
    def key(self) -> Any:
        """Return the same for atoms that are the same."""
        return (str(self.value), self.value.dtype) if self.known else id(self)


def number(value: Any) -> Atom:
    """Make an atom of a number that is known beforehand."""
    return Atom(constant(value)[()], True)


def _as_double(value: Any) -> Any:
    """Turn a number of any type into the double that stands in a row of memory."""
    if kind_of(value) == INTEGER:
        return double(value)
    return where(value, 1.0, 0.0) if kind_of(value) == TRUTH else value


def _from_double(value: Any, kind: Any) -> Any:
    """Turn the double that `_as_double` made back into a number of a kind."""
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
        self._found: dict[Any, Atom] = {}  # primitive and operands -> result
        self._body = prepare
        self._read_here: dict[Any, Any] = {}

    def given(self, row: int, type_: str = REAL) -> Atom:
        """Read a number of the design, of a type of JAX, from its row."""
        kind = {REAL: DOUBLE, TRUE: TRUTH}.get(type_, INTEGER)
        return Atom(_from_double(self.prepare.read(row), kind), True)

    def body(self, code: Code, function: Verified, operands: Sequence[Atom]) -> list[Any]:
        """Write a function of scalars; return its results, arrays taken apart."""
        self._body, self._read_here = code, {}
        code.flags = AS_WRITTEN
        self._found = {key: atom for key, atom in self._found.items() if atom.of_design}
        inputs = [np.array(atom, object) for atom in operands]
        results = function.walk(inputs, self._primitive, _atoms)
        return [self._read(atom) for result in results for atom in result.ravel()]

    def keep(self) -> int:
        """Have `prepare` write what the bodies read; return the number of rows."""
        for row, atom in enumerate(self._kept, self._first):
            self.prepare.write(_as_double(atom.value), row)
        return len(self._kept)

    def _primitive(self, equation: JaxprEqn, operands: list) -> np.ndarray:
        """Write one equation of arrays of atoms."""
        return of_arrays(
            equation, operands, lambda meaning, *atoms: self._scalar(equation, meaning, atoms)
        )

    def _scalar(self, equation: JaxprEqn, meaning: Callable, operands: tuple[Atom, ...]) -> Atom:
        """Write one equation of scalars; a division by a number of the design is a product."""
        name, type_ = equation.primitive.name, type_of(equation.outvars[0])
        first, last = operands[0], operands[-1]
        varies = last.of_design and not last.known and not first.of_design
        if name == "div" and type_ == REAL and varies:
            inverse = self._apply("inverse", lambda x: 1.0 / x, (last,))
            return self._apply("product", operator.mul, (first, inverse))
        return self._apply(f"{name} {type_} {equation.params}", meaning, operands)

    def _apply(self, name: str, function: Callable, operands: tuple[Atom, ...]) -> Atom:
        """Write a function of atoms once for all that have its name and operands."""
        key = (name, *(atom.key for atom in operands))
        if key not in self._found:
            of_design = all(atom.of_design for atom in operands)
            values = [atom.value if of_design else self._read(atom) for atom in operands]
            self._found[key] = Atom(folded(function, *values), of_design)
        return self._found[key]

    def _read(self, atom: Atom) -> Any:
        """Read in a body, from a row, what was computed once a design."""
        if not atom.of_design or atom.known:
            return atom.value
        if atom.key not in self._rows:
            self._rows[atom.key] = self._first + len(self._kept)
            self._kept.append(atom)
        if atom.key not in self._read_here:
            value = self._body.read(self._rows[atom.key])
            self._read_here[atom.key] = _from_double(value, kind_of(atom.value))
        return self._read_here[atom.key]


def _atoms(value: Any, kind: str) -> np.ndarray:
    return elementwise(lambda entry: Atom(entry, True), [constant(value, kind)])


def exponents(function: Verified, varying: int) -> set[int]:
    """Find the numbers of a design that powers depend on: formulas rather than data.

    They are the operands behind the first `varying` ones, and are counted from 0. x^1.5 is a
    product and a root, x^p a logarithm and an exponential.
    """
    found: set[int] = set()

    def primitive(equation: JaxprEqn, operands: list) -> np.ndarray:
        def one(_: Callable, *parts: set[int] | None) -> set[int] | None:
            """Say which numbers a result is made of; None if it varies along a motion."""
            if equation.primitive.name == "pow":
                found.update(parts[-1] or ())
            return None if None in parts else set().union(*(part or () for part in parts))

        return of_arrays(equation, operands, one)

    inputs = [np.array(None, object) for _ in range(varying)]
    for i, variable in enumerate(function.operands[varying:]):
        inputs.append(np.array({i} if type_of(variable) == REAL else set(), object))
    function.walk(
        inputs,
        primitive,
        lambda value, kind: elementwise(lambda _: set(), [constant(value, kind)]),
    )
    return found
