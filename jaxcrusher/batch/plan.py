"""A grid of crushers cut into chunks, and the statistics of one chunk.

What a chunk holds depends on its plan and number only: each design is a scalar program of its
own numbers, run by a sequential loop, and knows neither its neighbours nor how many there are.
"""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import equinox as eqx
import jax
import numpy as np

from jaxcrusher.basics.checks import require, require_known, require_whole
from jaxcrusher.batch.engines import Engine, run_all
from jaxcrusher.batch.rows import row_of, variables_of
from jaxcrusher.files.provenance import machine, now
from jaxcrusher.motion.method import require_tolerance, resolve
from jaxcrusher.motion.statistic import ALWAYS, STATISTICS, Chosen, always_with, chosen
from jaxcrusher.motion.statistics import over_turns
from jaxcrusher.scenes.build import build_scene
from jaxcrusher.scenes.parameters import (
    CHOICES,
    PARAMETERS,
    choices_of,
    complete,
    loose_besides,
    numbers_of,
)

# A chunk's number, its variables, and a record of how they were computed.
Result = tuple[int, dict[str, np.ndarray], dict[str, Any]]


@dataclass(frozen=True)
class Plan:
    """The grid product of `axes`, with every other parameter as in `base`.

    `axes` maps names to tuples of numbers or of choices, `base` names to values. `chunk` is the
    shape of a chunk: one choice, or some of the numbers, of each axis. `engine` as in `map_chunks`.
    `statistics` are entries of the table: another process may know others.
    """

    axes: dict[str, tuple]
    base: dict[str, float | str]
    settle_turns: int
    turns: int
    rtol: float
    chunk: tuple[int, ...]
    engine: Engine | None = None
    statistics: Chosen = field(default_factory=lambda: chosen(always_with(())))

    @property
    def shape(self) -> tuple[int, ...]:
        """Designs along each axis."""
        return tuple(len(values) for values in self.axes.values())

    @property
    def variables(self) -> dict[str, tuple[str, str]]:
        """Name -> unit and meaning of what is kept of a design."""
        return variables_of(loose_besides((*self.axes, *self.base)), self.statistics)

    @property
    def chunks(self) -> tuple[int, ...]:
        """Chunks along each axis."""
        return tuple(-(-n // m) for n, m in zip(self.shape, self.chunk, strict=True))

    def position(self, number: int) -> tuple[int, ...]:
        """Where a chunk lies among the chunks."""
        return tuple(int(i) for i in np.unravel_index(number, self.chunks))

    def region(self, number: int) -> tuple[slice, ...]:
        """The designs of a chunk, along each axis; the last ones may be fewer."""
        sizes = zip(self.position(number), self.chunk, self.shape, strict=True)
        return tuple(slice(i * m, min((i + 1) * m, n)) for i, m, n in sizes)

    def size(self, number: int) -> int:
        """The designs of a chunk."""
        return math.prod(part.stop - part.start for part in self.region(number))

    def coordinates(self) -> dict[str, tuple[np.ndarray, dict[str, Any]]]:
        """The values along each axis, and their labels."""
        return coordinates(self.axes)

    def settings(self) -> dict[str, Any]:
        """Everything that decides the results, as JSON keeps it."""
        axes = {name: list(values) for name, values in self.axes.items()}
        # A class's name where the engine is an object.
        engine = getattr(self.engine, "__qualname__", type(self.engine).__qualname__)
        known = {*STATISTICS, *itertools.chain(*ALWAYS.values())}
        added = {name: one.meaning for name, one in self.statistics if name not in known}
        return {
            "order of axes": list(axes),
            "axes": axes,
            "base": self.base,
            "settle_turns": self.settle_turns,
            "turns": self.turns,
            "rtol": self.rtol,
            "shape of a chunk": list(self.chunk),
            **({} if self.engine is None else {"engine": engine}),
            **({"further statistics": added} if added else {}),
        }


def make_plan(
    axes: Mapping[str, Any],
    base: Mapping[str, Any],
    settle_turns: int,
    turns: int,
    rtol: float,
    designs: int,
    engine: Engine | None = None,
) -> Plan:
    """A checked plan with at most `designs` designs a chunk.

    Raises ValueError for unknown names, and for values that no crusher can be built from.
    """
    require_whole("settle_turns", settle_turns, 0)
    require_whole("turns", turns, 1)
    require_tolerance(rtol)
    require_whole("chunk", designs, 1)
    varied, fixed = check_grid(axes, base)
    shape = _chunk_shape(varied, designs)
    seen = chosen(always_with(loose_besides((*varied, *fixed))))
    return Plan(varied, fixed, settle_turns, turns, float(rtol), shape, engine, seen)


def check_grid(
    axes: Mapping[str, Any], base: Mapping[str, Any]
) -> tuple[dict[str, tuple], dict[str, float | str]]:
    """What varies, and the value of everything else.

    Raises ValueError for unknown names, and for values that no crusher can be built from.
    """
    good = isinstance(axes, Mapping) and len(axes) > 0
    require(good, "axes", 'map names to values, as {"speed": [30.0, 32.0]}', repr(axes))
    mapping = isinstance(base, Mapping)
    require(
        mapping, "base", 'map names to values, as {"start": "contact"}', f"a {type(base).__name__}"
    )
    varied = {name: _axis(name, values) for name, values in axes.items()}
    fixed = {}
    for name, value in base.items():
        require_known(name, (*PARAMETERS, *CHOICES))
        require(name not in varied, "base", "name none of the axes", repr(name))
        fixed[name] = value if name in CHOICES else float(_numbers(f"base[{name!r}]", value, 0))
    lowest = {name: values[0] for name, values in varied.items()}
    described = complete({**fixed, **lowest})
    fixed = {name: value for name, value in described.items() if name not in varied}
    # All limits are intervals, and what keeps off the dead points is convex: the grid's corners
    # speak for what lies between.
    ends = [
        values if name in CHOICES else {min(values), max(values)} for name, values in varied.items()
    ]
    for corner in itertools.product(*ends):
        build_scene({**fixed, **dict(zip(varied, corner, strict=True))})
    return varied, fixed


def coordinates(axes: Mapping[str, tuple]) -> dict[str, tuple[np.ndarray, dict[str, Any]]]:
    """The values along each axis, and their labels."""
    return {
        name: (np.array(values, float), {"long_name": of.meaning, "units": of.unit})
        if (of := PARAMETERS.get(name))
        else (np.array(values, object), {})
        for name, values in axes.items()
    }


def _axis(name: str, values: Any) -> tuple:
    require_known(name, (*PARAMETERS, *CHOICES))
    called = f"axes[{name!r}]"
    array = np.asarray(values, object) if name in CHOICES else _numbers(called, values, 1)
    good = array.ndim == 1 and array.size > 0
    require(good, called, "have shape (n,), n > 0", f"of shape {array.shape}")
    axis = tuple(array.tolist())
    require(len(set(axis)) == len(axis), called, "hold every value once", values)
    return axis


def _numbers(called: str, values: Any, dimensions: int) -> np.ndarray:
    try:
        array = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    good = array.ndim == dimensions and bool(np.all(np.isfinite(array)))
    require(
        good,
        called,
        "be a finite number" if dimensions == 0 else "be a row of finite numbers",
        repr(values),
    )
    return array


def _chunk_shape(axes: dict[str, tuple], designs: int) -> tuple[int, ...]:
    """Whole last axes as far as they fit, an even part of the next, single values before."""
    shape = []
    for name, values in reversed(axes.items()):
        # Another choice is another program.
        parts = len(values) if name in CHOICES else -(-len(values) // designs)
        shape.append(-(-len(values) // parts))
        designs = max(1, designs // shape[-1])
    return tuple(reversed(shape))


def compute_chunk(plan: Plan, number: int) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """The variables of a chunk, each of the shape of its region, and how they were computed."""
    started = perf_counter()
    region = plan.region(number)
    # A short chunk repeats its last designs, so that every chunk is the same program.
    parts = [
        [axis[min(part.start + i, len(axis) - 1)] for i in range(size)]
        for axis, part, size in zip(plan.axes.values(), region, plan.chunk, strict=True)
    ]
    cells = list(itertools.product(*parts))
    # XLA opens a loop over one design, and then rounds differently: each device gets two.
    lanes = max(len(cells), 2 * jax.device_count())
    cells += cells[-1:] * (lanes - len(cells))
    varied = dict(zip(plan.axes, zip(*cells, strict=True), strict=True))
    # Numbers that do not vary are traced too: a design's bits do not depend on what varies.
    described = dict(plan.base) | varied
    numbers = {
        name: np.asarray(varied.get(name, [plan.base.get(name)] * len(cells)), float)
        for name in numbers_of(described)
    }
    choices = {
        name: varied[name][0] if name in varied else plan.base[name]
        for name in choices_of(described)
    }
    function = eqx.Partial(
        _design,
        choices=choices,
        settle_turns=plan.settle_turns,
        turns=plan.turns,
        rtol=plan.rtol,
        outputs=plan.statistics,
    )
    rows = run_all(function, numbers, lanes, plan.engine)
    size = math.prod(plan.chunk)
    kept = tuple(slice(part.stop - part.start) for part in region)
    values = {name: column[:size].reshape(plan.chunk)[kept] for name, column in rows.items()}
    record = {
        "machine": machine(),
        "designs": plan.size(number),
        "seconds": round(perf_counter() - started, 3),
        "finished": now(),
    }
    return values, record


def _design(numbers, choices, settle_turns, turns, rtol, outputs: Chosen):
    scene = build_scene({**numbers, **choices})
    found = over_turns(scene, None, settle_turns, turns, outputs, resolve(scene, rtol))
    return row_of(found, (name for name, _ in outputs))
