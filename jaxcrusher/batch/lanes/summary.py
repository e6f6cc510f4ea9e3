"""What a segment comes to: reductions of what was seen at its instants, as one compiled function.

It reads and writes the segment's page (see `layout.Page`).
"""

import operator
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import inf, prod
from typing import Any, NamedTuple

import numpy as np
from jax.extend.core import JaxprEqn

from jaxcrusher.batch.lanes.emit import constant, elementwise, folded, of_arrays, walk
from jaxcrusher.batch.lanes.expression import AS_WRITTEN, Expression, where
from jaxcrusher.batch.lanes.known import Known
from jaxcrusher.batch.lanes.layout import Page, page_of
from jaxcrusher.batch.lanes.primitives import ELEMENTWISE, parts, type_of, written
from jaxcrusher.batch.lanes.vector import Code, Module
from jaxcrusher.batch.lanes.whole import clipped, whole_of, wrapped

Read = Callable[[int], Expression]


class Series:
    """A number for every instant, computed from the rows that are read."""

    def __init__(self, of: Callable[[Read], Any]) -> None:
        self._of, self._read, self._value = of, None, None

    def at(self, read: Read) -> Any:
        """Its value there, written once."""
        if self._read is not read:
            self._read, self._value = read, self._of(read)
        return self._value


@dataclass(frozen=True)
class Over:
    """An array whose first axis is that of the instants, as series in the shape of the rest."""

    cells: np.ndarray


class Summary(NamedTuple):
    """A function of the first row of a page, and what it finds."""

    part: Code
    page: Page
    numbers: int
    over: list[bool]  # of every result, whether it is an array over the instants, its last axis


def write_summary(
    module: Module, function: Known, seen: Iterable[tuple[int, ...]], instants: int
) -> Summary:
    """The function `summarise` of a page: of arrays over instants, of shapes `seen`, and states."""
    code = Code(module, "summarise", rows=1)
    code.flags = AS_WRITTEN
    shapes, operands, count = list(seen), [], 0
    for shape in shapes:
        cells = [Series(lambda read, i=count + i: read(i)) for i in range(prod(shape))]
        operands.append(Over(np.array([*cells, None], object)[:-1].reshape(shape)))
        count += len(cells)
    states = len(function.operands) - len(operands)
    found = sum(map(prod, function.shapes))
    page = page_of(count, instants, states, found, module.shape.lanes)
    (first,) = code.rows
    for i in range(states):
        operands.append(np.array(code.scalar(code.row(first, page.last + i)), object))
    writer, place = _Writer(code, page, instants), 0
    results = walk(function, operands, writer.primitive)
    for result in results:
        place += writer.keep(result, place)
    over = [isinstance(result, Over) for result in results]
    return Summary(code.end(by_name=True), page, found, over)


class _Writer:
    """Writes primitives of arrays, those over the instants among them."""

    def __init__(self, code: Code, page: Page, instants: int) -> None:
        self._code, self._page, self._instants = code, page, instants

    def primitive(self, equation: JaxprEqn, operands: list) -> Any:
        """One of them."""
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
        """Elementwise."""

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
        """The values at one instant."""
        page, (first,) = self._page, self._code.rows

        def read(i: int) -> Expression:
            return self._code.scalar(self._code.row(first, i * page.series), index)

        return elementwise(lambda cell: cell.at(read), [array.cells])[None]

    def _over_instants(self, start: list, body: Callable[[Callable, list], list]) -> list:
        """A loop over the instants; `body` is given how to read a series, and what is carried."""
        code, (first,) = self._code, self._code.rows

        def turn(carried: list[Expression]) -> list:
            def read(i: int) -> Expression:
                return code.read(first, i * self._page.series)

            return body(read, carried)

        return code.loop(self._instants, start, turn)

    def reduce(self, cell: Series, combine: Callable, start: Any) -> Expression:
        """By a function of two; `start`, of the type of the series, changes nothing."""

        def body(read: Read, carried: list) -> list:
            return [combine(carried[0], self._existing(cell.at(read), start))]

        (result,) = self._over_instants([start], body)
        parts = [
            self._code.alike(self._code.lane(result, lane))
            for lane in range(self._code.shape.width)
        ]
        for part in parts[1:]:
            parts[0] = combine(parts[0], part)
        return parts[0]

    def argmax(self, cell: Series) -> Expression:
        """The first place of the largest, or of a NaN."""

        def better(one: list, other: list) -> list:
            (best, at), (value, place) = one, other
            larger = (value > best) | ((value != value) & (best == best))
            equal = (value == best) | ((value != value) & (best != best))
            take = larger | (equal & (place < at))
            return [where(take, value, best), where(take, place, at)]

        def body(read: Read, carried: list) -> list:
            return better(carried, [self._existing(cell.at(read), -inf), self._code.positions()])

        pair = self._over_instants([-inf, inf], body)
        lanes = [
            [self._code.alike(self._code.lane(v, i)) for v in pair]
            for i in range(self._code.shape.width)
        ]
        for other in lanes[1:]:
            lanes[0] = better(lanes[0], other)
        return whole_of(lanes[0][1])

    def sum(self, cell: Series, type_: str) -> Any:
        """Of doubles or of whole numbers."""
        total = self.reduce(cell, operator.add, constant(0, type_)[()])
        return wrapped(total) if type_ == "int32" else total

    def _existing(self, value: Any, otherwise: Any) -> Expression:
        """Of the last instants there may be fewer than lanes."""
        if self._instants % self._code.shape.width == 0:
            return self._code.vector(value)
        return where(self._code.positions() < self._instants, self._code.vector(value), otherwise)

    def keep(self, result: Any, place: int) -> int:
        """Write a result behind others; how many numbers it has. Series stand one after another."""
        code, row = self._code, self._code.row(self._code.rows[0], self._page.found)
        if not isinstance(result, Over):
            for i, value in enumerate(result.flat):
                code.write_number(value, row, place + i)
            return result.size
        for i, cell in enumerate(result.cells.flat):

            def body(read: Read, carried: list, cell=cell, at=place + i * self._instants) -> list:
                code.write_from(cell.at(read), row, at)
                return carried

            self._over_instants([], body)
        return result.cells.size * self._instants


# Primitive -> its result of a series, of a type.
_REDUCTIONS: dict[str, Callable[[_Writer, Series, str], Expression]] = {
    "argmax": lambda writer, cell, _: writer.argmax(cell),
    "reduce_max": lambda writer, cell, _: writer.reduce(cell, ELEMENTWISE["max"].write, -inf),
    "reduce_min": lambda writer, cell, _: writer.reduce(cell, ELEMENTWISE["min"].write, inf),
    "reduce_sum": lambda writer, cell, type_: writer.sum(cell, type_),
}
