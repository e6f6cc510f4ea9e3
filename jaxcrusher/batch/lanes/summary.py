"""What a segment comes to: reductions of what was seen at its instants, as one compiled function.

It reads and writes the segment's page (see `layout.Page`).
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import inf, prod
from typing import Any, NamedTuple

import numpy as np
from jax.extend.core import ClosedJaxpr

from jaxcrusher.batch.lanes.emit import (
    ELEMENTWISE,
    STRUCTURAL,
    Unsupported,
    elementwise,
    operation,
    walk,
)
from jaxcrusher.batch.lanes.expression import Expression, where
from jaxcrusher.batch.lanes.layout import Page, page_of
from jaxcrusher.batch.lanes.vector import Code, Module

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
    module: Module, function: ClosedJaxpr, seen: Iterable[tuple[int, ...]], instants: int
) -> Summary:
    """The function `summarise` of a page: of arrays over instants, of shapes `seen`, and states.

    Raises `Unsupported` for a primitive that lanes do not know.
    """
    code = Code(module, "summarise", rows=1)
    shapes, operands, count = list(seen), [], 0
    for shape in shapes:
        cells = [Series(lambda read, i=count + i: read(i)) for i in range(prod(shape))]
        operands.append(Over(np.array([*cells, None], object)[:-1].reshape(shape)))
        count += len(cells)
    states = len(function.jaxpr.invars) - len(operands)
    found = sum(prod(variable.aval.shape) for variable in function.jaxpr.outvars)
    page = page_of(count, instants, states, found, module.shape.lanes)
    (first,) = code.rows
    for i in range(states):
        operands.append(np.array(code.scalar(code.row(first, page.last + i)), object))
    writer, place = _Writer(code, page, instants), 0
    results = walk(function, operands, writer.primitive, _constant)
    for result in results:
        place += writer.keep(result, place)
    over = [isinstance(result, Over) for result in results]
    return Summary(code.end(by_name=True), page, found, over)


def _constant(value: Any) -> np.ndarray:
    array = np.asarray(value)
    kind = np.bool_ if array.dtype == bool else np.float64
    return np.array([*map(kind, array.flat), None], object)[:-1].reshape(array.shape)


class _Writer:
    """Writes primitives of arrays, those over the instants among them."""

    def __init__(self, code: Code, page: Page, instants: int) -> None:
        self._code, self._page, self._instants = code, page, instants

    def primitive(self, name: str, params: dict[str, Any], operands: list) -> Any:
        """One of them; whole numbers are doubles too."""
        if name == "broadcast_in_dim" and params["shape"][:1] == (self._instants,):
            (scalar,) = operands
            if isinstance(scalar, np.ndarray) and scalar.ndim == 0:
                same = Series(lambda read: scalar[()])
                return Over(np.full(params["shape"][1:], same, object))
        if not any(isinstance(operand, Over) for operand in operands):
            if name in STRUCTURAL:
                return STRUCTURAL[name](*operands, **params)
            return elementwise(operation(name, params), operands)
        first: Any = operands[0]
        if name in _REDUCTIONS and params["axes"] == (0,):
            return elementwise(lambda cell: _REDUCTIONS[name](self, cell), [first.cells])
        if name == "dynamic_slice" and params["slice_sizes"][0] == 1:
            return self._taken(first, operands[1][()])
        if name == "slice":
            return self._sliced(first, params)
        if name == "squeeze" and 0 not in params["dimensions"]:
            return Over(first.cells.squeeze(tuple(axis - 1 for axis in params["dimensions"])))
        return self._of_each(operation(name, params), operands)

    def _of_each(self, meaning: Callable, operands: list) -> Over:
        """Elementwise."""

        def one(*cells: Any) -> Series:
            def of(read: Read) -> Any:
                return meaning(*(c.at(read) if isinstance(c, Series) else c for c in cells))

            return Series(of)

        arrays = [v.cells if isinstance(v, Over) else v for v in operands]
        return Over(elementwise(one, arrays))

    def _sliced(self, array: Over, params: dict[str, Any]) -> Any:
        (first, *starts), (end, *ends) = params["start_indices"], params["limit_indices"]
        part = tuple(slice(*pair) for pair in zip(starts, ends, strict=True))
        within = Over(array.cells[part])
        if params["strides"] is None and (first, end) == (0, self._instants):
            return within
        if end != first + 1:
            raise Unsupported("a part of the instants")
        return self._taken(within, np.float64(first))

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

    def reduce(self, cell: Series, combine: Callable, start: float) -> Expression:
        """By a function of two; `start` changes nothing."""

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
        return lanes[0][1]

    def _existing(self, value: Any, otherwise: float) -> Expression:
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


_REDUCTIONS: dict[str, Callable[[_Writer, Series], Expression]] = {
    "argmax": lambda writer, cell: writer.argmax(cell),
    "reduce_max": lambda writer, cell: writer.reduce(cell, ELEMENTWISE["max"], -inf),
    "reduce_min": lambda writer, cell: writer.reduce(cell, ELEMENTWISE["min"], inf),
    "reduce_sum": lambda writer, cell: writer.reduce(cell, ELEMENTWISE["add"], 0.0),
}
