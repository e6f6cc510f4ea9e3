"""Verified functions written out as functions of lanes: bodies of a step, and summaries.

In a body, constants are folded. Values that depend only on a design's own numbers are computed
beforehand, once a design, and kept in rows of their own. The rest runs in every step. Small arrays,
such as the two components of a force, are taken apart. A summary reduces the observations at the
instants of a segment; it reads and writes the segment's page (see `layout.Layout`).
"""

import operator
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from math import inf, prod
from typing import Any

import numpy as np
from jax.extend.core import JaxprEqn

from jaxcrusher.lanes.code import Code, Module
from jaxcrusher.lanes.expression import (
    AS_WRITTEN,
    DOUBLE,
    INTEGER,
    TRUTH,
    Expression,
    bits,
    clipped,
    double,
    kind_of,
    where,
    whole_of,
    wrapped,
)
from jaxcrusher.lanes.layout import Layout
from jaxcrusher.lanes.primitives import (
    ELEMENTWISE,
    REAL,
    TRUE,
    constant,
    elementwise,
    folded,
    larger,
    of_arrays,
    parts,
    type_of,
    written,
)
from jaxcrusher.lanes.verify import Verified


@dataclass(eq=False)
class Atom:
    """A scalar: a number, or an expression of the function under construction.

    An atom that is `of_design` does not vary along a motion: it is a vector of `prepare`.
    """

    value: Any
    of_design: bool = False

    @property
    def known(self) -> bool:
        """Say whether it is a number."""
        return isinstance(self.value, np.generic)

    @property
    def key(self) -> Any:
        """Return a key that equal atoms share."""
        return (str(self.value), self.value.dtype) if self.known else id(self)


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
    """Writes bodies that share values of a design, which `prepare` computes once.

    The values that bodies read stand in rows from `kept` on.
    """

    def __init__(self, prepare: Code, kept: int) -> None:
        self.prepare, self._first = prepare, kept
        prepare.flags = AS_WRITTEN
        self._rows: dict[Any, int] = {}  # of what the bodies read: key -> row
        self._kept: list[Atom] = []
        self._found: dict[Any, Atom] = {}  # primitive and operands -> result
        self._row = prepare.read
        self._read_here: dict[Any, Any] = {}

    def given(self, row: int, type_: str = REAL) -> Atom:
        """Read a number of the design, of a type of JAX, from its row."""
        kind = {REAL: DOUBLE, TRUE: TRUTH}.get(type_, INTEGER)
        return Atom(_from_double(self.prepare.read(row), kind), True)

    def body(
        self,
        code: Code,
        function: Verified,
        operands: Sequence[Atom],
        row: Callable[[int], Expression] | None = None,
    ) -> list[Any]:
        """Write a function of scalars; return its results, arrays taken apart.

        `row` reads a row of the lanes' memory; None reads that of the lanes side by side.
        """
        self._row, self._read_here = row or code.read, {}
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
            value = self._row(self._rows[atom.key])
            self._read_here[atom.key] = _from_double(value, kind_of(atom.value))
        return self._read_here[atom.key]


def _atoms(value: Any, kind: str) -> np.ndarray:
    return elementwise(lambda entry: Atom(entry, True), [constant(value, kind)])


Read = Callable[[int], Expression]


class Series:
    """A number for every instant, computed from the rows that are read."""

    def __init__(self, of: Callable[[Read], Any]) -> None:
        self._of, self._read, self._value = of, None, None

    def at(self, read: Read) -> Any:
        """Return its value there, written once."""
        if self._read is not read:
            self._read, self._value = read, self._of(read)
        return self._value


@dataclass(frozen=True)
class Over:
    """An array whose first axis is that of the instants, as series in the shape of the rest."""

    cells: np.ndarray


def write_summary(
    module: Module, function: Verified, seen: Iterable[tuple[int, ...]], at: Layout
) -> tuple[Code, list[bool]]:
    """Write the function `summarise` of the first row of a page.

    It takes arrays over instants, of the shapes `seen`, states and what is kept. The flags say of
    each result whether it is an array over the instants, which stand in its last axis.
    """
    code = Code(module, "summarise", rows=1, flags=AS_WRITTEN)
    operands, count = [], 0
    for shape in seen:
        cells = [Series(lambda read, i=count + i: read(i)) for i in range(prod(shape))]
        operands.append(Over(np.array([*cells, None], object)[:-1].reshape(shape)))
        count += len(cells)
    (page,) = code.rows
    for i in range(at.states + at.tallies):
        operands.append(np.array(code.alike(code.memory[page + (at.last + i), 0]), object))
    writer, place = _Writer(code, at), 0
    results = function.walk(operands, writer.primitive)
    for result in results:
        place += writer.keep(result, place)
    return code.end(by_name=True), [isinstance(result, Over) for result in results]


# Primitive -> its function of two, and the number that changes nothing.
_REDUCTIONS: dict[str, tuple[Callable, float]] = {
    "reduce_max": (ELEMENTWISE["max"].write, -inf),
    "reduce_min": (ELEMENTWISE["min"].write, inf),
    "reduce_sum": (operator.add, 0),
}


class _Writer:
    """Writes primitives of arrays, those over the instants among them."""

    def __init__(self, code: Code, at: Layout) -> None:
        self._code, self._at, self._instants = code, at, at.instants

    def primitive(self, equation: JaxprEqn, operands: list) -> Any:
        """Write one of them."""
        name, params = equation.primitive.name, equation.params
        if name == "broadcast_in_dim" and params["shape"][:1] == (self._instants,):
            (scalar,) = operands
            if isinstance(scalar, np.ndarray) and scalar.ndim == 0:
                same = Series(lambda read: scalar[()])
                return Over(np.full(params["shape"][1:], same, object))
        if not any(isinstance(operand, Over) for operand in operands):
            return of_arrays(equation, operands, folded)
        first: Any = operands[0]
        if name == "argmax":
            return elementwise(self._place_of_largest, [first.cells])
        if name in _REDUCTIONS:
            type_ = type_of(equation.outvars[0])
            return elementwise(lambda cell: self._reduced(name, cell, type_), [first.cells])
        if name == "dynamic_slice":
            return self._taken(first, clipped(operands[1][()], 0, self._instants - 1))
        if name == "slice":
            instants, *others = parts(**params)
            within = Over(first.cells[tuple(others)])
            one = instants.stop == instants.start + 1 and self._instants > 1
            return self._taken(within, instants.start) if one else within
        if name == "squeeze":
            return Over(first.cells.squeeze(tuple(axis - 1 for axis in params["dimensions"])))
        return self._of_each(written(equation), operands)

    def _of_each(self, meaning: Callable, operands: list) -> Over:
        """Write a function of the numbers of each instant."""

        def one(*cells: Any) -> Series:
            def of(read: Read) -> Any:
                values = (c.at(read) if isinstance(c, Series) else c for c in cells)
                return folded(meaning, *values)

            return Series(of)

        arrays = [v.cells if isinstance(v, Over) else v for v in operands]
        return Over(elementwise(one, arrays))

    def _taken(self, array: Over, index: Any) -> np.ndarray:
        """Write the values at one instant."""
        code, (page,) = self._code, self._code.rows
        place = index if isinstance(index, int) else code.lane(index)

        def read(i: int) -> Expression:
            return code.alike(code.memory[page + i * self._at.series, place])

        return elementwise(lambda cell: cell.at(read), [array.cells])[None]

    def _over_instants(self, start: Sequence, turn: Callable[..., Sequence]) -> list[Expression]:
        """Write a loop over vectors of instants.

        `turn` is given how to read a series, the first instant, and what it gave the last time, at
        first `start`; what it gives at last is the result.
        """
        code, (page,) = self._code, self._code.rows
        carried = [code.variable(code.vector(value)) for value in start]
        with code.each(0, self._instants, code.shape.width) as first:

            def read(i: int) -> Expression:
                return code.memory.vector(page + i * self._at.series, first)

            results = turn(read, first, *(variable[0] for variable in carried))
            for variable, result in zip(carried, results, strict=True):
                variable[0] = result
        return [variable[0] for variable in carried]

    def _together(self, start: list, parts: Callable, combine: Callable) -> list[Expression]:
        """Reduce the parts of all instants by a function of two lists; `start` changes nothing."""
        code = self._code
        found = self._over_instants(
            start, lambda read, first, *carried: combine(carried, parts(read, first))
        )
        lanes = range(code.shape.width)
        return reduce(combine, [[code.alike(code.lane(v, i)) for v in found] for i in lanes])

    def _reduced(self, name: str, cell: Series, type_: str) -> Any:
        """Reduce a series of a type of JAX by a primitive."""
        combine, start = _REDUCTIONS[name]
        start = constant(start, type_)[()]

        def part(read: Read, first: Expression) -> list:
            return [self._existing(cell.at(read), first, start)]

        (found,) = self._together([start], part, lambda a, b: [combine(a[0], b[0])])
        return wrapped(found) if type_ == "int32" else found

    def _place_of_largest(self, cell: Series) -> Expression:
        """Find the first place of the largest, or of a NaN."""

        def part(read: Read, first: Expression) -> list:
            return [self._existing(cell.at(read), first, -inf), self._code.positions(first)]

        return whole_of(self._together([-inf, inf], part, larger)[1])

    def _existing(self, value: Any, first: Expression, otherwise: Any) -> Expression:
        """Replace what stands behind the last instant, where these do not fill a vector."""
        code, value = self._code, self._code.vector(value)
        if self._instants % code.shape.width == 0:
            return value
        return where(code.positions(first) < self._instants, value, otherwise)

    def keep(self, result: Any, place: int) -> int:
        """Write a result behind others, series one after another; return how long it is."""
        code, row = self._code, self._code.rows[0] + self._at.summary
        if not isinstance(result, Over):
            for i, value in enumerate(result.flat):
                code.memory[row, place + i] = code.lane(value)
            return result.size
        for i, cell in enumerate(result.cells.flat):

            def turn(read: Read, first: Expression, cell=cell, at=place + i * self._instants):
                code.memory[row, first + at] = code.vector(cell.at(read))
                return ()

            self._over_instants((), turn)
        return result.cells.size * self._instants
