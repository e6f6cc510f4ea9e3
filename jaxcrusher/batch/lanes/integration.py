"""Integrations of all designs of a batch, by lanes."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from jax.extend.core import JaxprEqn

from jaxcrusher.batch.lanes.engine import Device, run
from jaxcrusher.batch.lanes.layout import Designs
from jaxcrusher.batch.lanes.recorded import Recorded

# Exponents that are products and roots.
PLAIN = (1.0, 1.5, 2.0)


class Value(NamedTuple):
    """An array; if `batched`, its first axis is that of the designs."""

    array: Any
    batched: bool


def stacked(value: Value, count: int) -> np.ndarray:
    """With an axis of the designs."""
    array = np.asarray(value.array)
    return array if value.batched else np.broadcast_to(array, (count, *array.shape))


class Integration:
    """Integrations of all designs, by lanes."""

    def __init__(self, equation: JaxprEqn, batched: list[bool], device: Device) -> None:
        self._device = device
        self.operands, self.results = equation.invars, equation.outvars
        self.batched = [True] * len(self.results)
        self._what: Recorded = equation.params["what"]
        # Raises `Unsupported` for what cannot be written out.
        self._exponents = self._what.exponents

    def run(self, operands: list[Value], count: int) -> list[Value]:
        """Summaries, codes, times and steps."""
        times = np.asarray(operands[0].array, float)
        schedule = np.arange(count) if operands[0].batched else np.zeros(count, int)
        times = times if operands[0].batched else times[None]
        columns = [_doubles(stacked(value, count)) for value in operands[1:]]
        states = 2 + self._what.equations.states
        numbers, starts = _table(columns[states:], count), _table(columns[2:states], count)
        tolerances = _table(columns[:2], count)
        # As diffrax: within 100 units in the last place of the end is at the end.
        floors = times[..., -1] - 100 * np.spacing(times[..., -1])
        found: list[np.ndarray] = []
        for known, rows in self._kinds(numbers):
            of_each = starts[rows], numbers[rows], tolerances[rows]
            designs = Designs(*of_each, times.ravel(), floors, schedule[rows])
            what, device = self._what, self._device
            shapes = [shape.shape[1:] for shape in what.shapes[:-3]]
            kernels = what.kernels(known, device.shape)
            summaries, ends = run(kernels, what.control, designs, shapes, device)
            parts = [*summaries, *ends]
            if not found:
                found = [np.empty((count, *part.shape[1:]), part.dtype) for part in parts]
            for whole, part in zip(found, parts, strict=True):
                whole[rows] = part
        return [Value(array, True) for array in found]

    def _kinds(self, numbers: np.ndarray) -> Iterator[tuple[dict[int, float], np.ndarray]]:
        """Designs with the same exponents, as far as these are written into the source.

        By its own numbers only, so that what a design comes to does not depend on the others.
        """
        exponents = numbers[:, self._exponents]
        plain = np.where(np.isin(exponents, PLAIN), exponents, np.nan)
        kinds = [tuple(row) for row in plain.astype(str)]
        for kind in dict.fromkeys(kinds):
            rows = np.flatnonzero([other == kind for other in kinds])
            pairs = zip(self._exponents, map(float, kind), strict=True)
            yield {i: value for i, value in pairs if value in PLAIN}, rows


def _doubles(array: np.ndarray) -> np.ndarray:
    """Numbers as they stand in the memory of lanes (see `emit.as_double`)."""
    if np.issubdtype(array.dtype, np.integer):
        return array.astype(np.int64).view(np.float64)
    return np.asarray(array, float)


def _table(columns: Sequence[np.ndarray], count: int) -> np.ndarray:
    return np.stack(columns, 1) if columns else np.zeros((count, 0))
