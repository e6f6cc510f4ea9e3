"""What a segment comes to: reductions of what was seen at its instants, as one compiled function.

It reads and writes the segment's page (see `layout.Layout`).
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
from jaxcrusher.lanes.expression import AS_WRITTEN, Expression, clipped, where, whole_of, wrapped
from jaxcrusher.lanes.layout import Layout
from jaxcrusher.lanes.primitives import (
    ELEMENTWISE,
    constant,
    elementwise,
    folded,
    of_arrays,
    parts,
    type_of,
    written,
)
from jaxcrusher.lanes.verify import Verified

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

    It takes arrays over instants, of the shapes `seen`, and states. The flags say of each result
    whether it is an array over the instants, which stand in its last axis.
    """
    code = Code(module, "summarise", rows=1, flags=AS_WRITTEN)
    operands, count = [], 0
    for shape in seen:
        cells = [Series(lambda read, i=count + i: read(i)) for i in range(prod(shape))]
        operands.append(Over(np.array([*cells, None], object)[:-1].reshape(shape)))
        count += len(cells)
    (page,) = code.rows
    for i in range(at.states):
        operands.append(np.array(code.alike(code.memory[page + (at.last + i), 0]), object))
    writer, place = _Writer(code, at), 0
    results = function.walk(operands, writer.primitive)
    for result in results:
        place += writer.keep(result, place)
    return code.end(by_name=True), [isinstance(result, Over) for result in results]


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
        if name in _REDUCTIONS:
            type_ = type_of(equation.outvars[0])
            return elementwise(lambda cell: _REDUCTIONS[name](self, cell, type_), [first.cells])
        if name == "dynamic_slice":
            return self._taken(first, clipped(operands[1][()], 0, self._instants - 1))
        if name == "slice":
            return self._sliced(first, params)
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

    def _sliced(self, array: Over, params: dict[str, Any]) -> Any:
        instants, *others = parts(**params)
        within = Over(array.cells[tuple(others)])
        if instants.stop == instants.start + 1 and self._instants > 1:
            return self._taken(within, instants.start)
        return within

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

    def _reduced(self, start: list, parts: Callable, combine: Callable) -> list[Expression]:
        """Reduce the parts of all instants by a function of two lists; `start` changes nothing."""
        code = self._code
        found = self._over_instants(
            start, lambda read, first, *carried: combine(carried, parts(read, first))
        )
        lanes = range(code.shape.width)
        return reduce(combine, [[code.alike(code.lane(v, i)) for v in found] for i in lanes])

    def reduce(self, cell: Series, combine: Callable, start: Any) -> Expression:
        """Reduce a series by a function of two; `start`, of its type, changes nothing."""

        def part(read: Read, first: Expression) -> list:
            return [self._existing(cell.at(read), first, start)]

        return self._reduced([start], part, lambda one, other: [combine(one[0], other[0])])[0]

    def argmax(self, cell: Series) -> Expression:
        """Find the first place of the largest, or of a NaN."""

        def better(one: Sequence, other: Sequence) -> list:
            (best, at), (value, place) = one, other
            larger = (value > best) | ((value != value) & (best == best))
            equal = (value == best) | ((value != value) & (best != best))
            take = larger | (equal & (place < at))
            return [where(take, value, best), where(take, place, at)]

        def part(read: Read, first: Expression) -> list:
            return [self._existing(cell.at(read), first, -inf), self._code.positions(first)]

        return whole_of(self._reduced([-inf, inf], part, better)[1])

    def sum(self, cell: Series, type_: str) -> Any:
        """Add up doubles or whole numbers."""
        total = self.reduce(cell, operator.add, constant(0, type_)[()])
        return wrapped(total) if type_ == "int32" else total

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


# Primitive -> its result of a series, of a type.
_REDUCTIONS: dict[str, Callable[[_Writer, Series, str], Expression]] = {
    "argmax": lambda writer, cell, _: writer.argmax(cell),
    "reduce_max": lambda writer, cell, _: writer.reduce(cell, ELEMENTWISE["max"].write, -inf),
    "reduce_min": lambda writer, cell, _: writer.reduce(cell, ELEMENTWISE["min"].write, inf),
    "reduce_sum": lambda writer, cell, type_: writer.sum(cell, type_),
}
