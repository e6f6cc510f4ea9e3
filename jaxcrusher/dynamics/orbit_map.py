"""The settled motions of a grid of crushers, each solved for from its neighbours."""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float, Scalar

from jaxcrusher.basics.checks import (
    require,
    require_choice,
    require_names,
    require_whole,
)
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.batch.engines import Engine, run_chunks, without_lanes
from jaxcrusher.batch.plan import check_grid, coordinates
from jaxcrusher.dynamics.waiting import waited
from jaxcrusher.files.provenance import provenance
from jaxcrusher.motion.statistic import STATISTIC
from jaxcrusher.scenes.build import build_scene
from jaxcrusher.scenes.parameters import (
    CHOICES,
    PARAMETERS,
    choices_of,
    loose_besides,
    numbers_of,
)
from jaxcrusher.settled.forced import from_rest_unless
from jaxcrusher.settled.periodic_orbit import periodic_orbit
from jaxcrusher.settled.result import PeriodicOrbit, reason
from jaxcrusher.settled.solving import NODES, SETTLED
from jaxcrusher.settled.trigonometric import resample

# Name -> unit and meaning of what a map holds besides the statistics.
VARIABLES = {
    "error": ("1", "estimated error of the RMS, as a share of it"),
    "least_penetration": ("1", "least penetration / clearance"),
    "largest_multiplier": ("1", "largest modulus of the Floquet multipliers"),
    "multipliers_error": ("1", "estimated error of the matrix whose eigenvalues they are"),
    "settling_turns": ("1", "turns in which a disturbance falls to 1/e"),
}
LOGICAL = {"success": "solved", "stable": "disturbances die"}
# Designs solved between two looks at what their neighbours are.
CHUNK = 16
# Steps along an axis to the furthest neighbour. Where a branch folds back from the next cells, one
# that comes from further away may pass: in a tongue the shape of a motion matters more than how
# near it is.
REACH = 4


def orbit_map(
    axes: Mapping[str, Any],
    *,
    base: Mapping[str, Any] | None = None,
    period: int = 1,
    slopes: Sequence[str] = (),
    metric: str = "foundation_rms",
    nodes: int | None = None,
    engine: Engine | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Settled motions over the grid product of any parameters, as `jaxcrusher.periodic_orbit`.

    Every cell is solved from the pin resting in its bore, on all cores; a cell where that fails is
    tried again from neighbours along the axes that are solved, up to four steps away and the
    nearest first, for as long as that helps. What fails still is waited for over 270 turns, and
    solved for from there if it keeps contact. What is found so may lie on another branch than the
    next cell's.

    **Arguments:**

    - `axes`: names of `jaxcrusher.PE250X400` -> values, shape (n,), in SI units, or choices.
      Neighbours are cells some steps along a number, so their order should be increasing.
    - `base`: names -> values of what does not vary, where it is not the paper's.
    - `period`: turns of the motions, as in `periodic_orbit`.
    - `nodes`: even number of nodes a turn. None is 96, and 192 for what these do not solve, or
      leave with an `error` above 1e-8.
    - `slopes`: names of numbers by which `metric`, a statistic of `jaxcrusher.PeriodicOrbit`, is
      differentiated: any number of them costs about as much as one.
    - `engine`: as in `jaxcrusher.map_chunks`; None takes lanes only for what is waited for.
    - `progress`: called with the number of finished and of all designs, first at the start; what
      fails is finished when its neighbours have been tried.

    **Returns:** an `xarray.Dataset` with a dimension for each axis: all statistics, the estimated
    `error` of the RMS (a share of it), `least_penetration` (clearances), `largest_multiplier`,
    `multipliers_error`, `settling_turns`, `slope` (with a dimension `parameter`, in the unit of
    `metric` per unit of the parameter), and `multiplier_real`, `multiplier_imag` (with a dimension
    `multiplier`, in no order). `success` and `stable` are logical. Where there is no success every
    number is NaN, and `failure` says why.

    Raises ValueError for bad arguments, and in one line for scenes that have no such orbit.
    """
    require_set_up()
    require_whole("period", period, 1)
    if nodes is not None:
        require_whole("nodes", nodes, 4)
        require(nodes % 2 == 0, "nodes", "be even", nodes)
    levels = (NODES, 2 * NODES) if nodes is None else (nodes,)
    require_choice("metric", metric, tuple(STATISTIC))
    varied, fixed = check_grid(axes, base or {})
    described = fixed | varied
    require_names("slopes", slopes, tuple(numbers_of(described)))
    cells = list(itertools.product(*varied.values()))
    report = progress or (lambda finished, of: None)
    report(0, len(cells))
    choices = choices_of(described)
    # Another choice is another program, and no neighbour.
    groups: dict[tuple, list[int]] = {}
    for number, cell in enumerate(cells):
        made = {**fixed, **dict(zip(varied, cell, strict=True))}
        groups.setdefault(tuple(made[name] for name in choices), []).append(number)
    numbers = {
        name: np.array([cell[list(varied).index(name)] for cell in cells], float)
        if name in varied
        else np.full(len(cells), fixed[name], float)
        for name in numbers_of(described)
    }
    shape = tuple(len(values) for values in varied.values())
    dims = 2 * (1 + len(loose_besides(described)))
    grid = _Grid(shape, tuple(name in PARAMETERS for name in varied), numbers, dims)
    for chosen, members in groups.items():
        words = dict(zip(choices, chosen, strict=True))
        for level in levels:
            solve = eqx.Partial(
                _cell,
                choices=words,
                slopes=tuple(slopes),
                metric=metric,
                period=period,
                nodes=level,
            )
            grid.fill(solve, members, level * period, engine or without_lanes(), report)
        # What no neighbour leads to is waited for.
        if left := [number for number in members if not grid.rows[number]["success"]]:
            guesses = waited(
                lambda by, words=words: build_scene({**by, **words}),
                grid.numbers_of(left),
                period,
                engine,
            )
            pairs = zip(left, guesses, strict=True)
            known = {number: guess for number, guess in pairs if np.isfinite(guess).all()}
            points = levels[-1] * period
            grid.fill(solve, list(known), points, engine or without_lanes(), report, known)
    rows = [grid.rows[number] for number in range(len(cells))]
    data = _variables(varied, shape, rows, metric)
    labels = {name: (name, *rest) for name, rest in coordinates(varied).items()}
    if slopes:
        labels["parameter"] = ("parameter", np.array(slopes, object), {})
    attributes = provenance(
        "Settled motions of jaw crushers over a grid of parameters",
        parameters={n: [v, PARAMETERS[n].unit] for n, v in fixed.items() if n in PARAMETERS},
        choices={name: value for name, value in fixed.items() if name in CHOICES},
        period=period,
        nodes=list(levels),
    )
    return xr.Dataset(data, labels, attributes)


def _cell(
    case: tuple[dict[str, Scalar], Float[Array, "n dims"]],
    *,
    choices: dict[str, str],
    slopes: tuple[str, ...],
    metric: str,
    period: int,
    nodes: int,
) -> dict[str, Any]:
    """What a map holds of the orbit from a guess (NaN: from the pin at rest)."""
    numbers, guess = case

    def solved(by: dict[str, Scalar]) -> tuple[Scalar, PeriodicOrbit]:
        scene = build_scene({**numbers, **choices, **by})
        first = None if scene.is_ideal else from_rest_unless(guess, scene, period)
        orbit = periodic_orbit(scene, period=period, nodes=nodes, guess=first)
        return orbit[metric], orbit

    by, row = {name: numbers[name] for name in slopes}, {}
    if slopes:
        (_, orbit), found = jax.value_and_grad(solved, has_aux=True)(by)
        row["slope"] = jnp.stack([found[name] for name in slopes])
    else:
        orbit = solved(by)[1]
    row |= dict(orbit.values) | {name: getattr(orbit, name) for name in VARIABLES}
    row |= {name: getattr(orbit, name) for name in LOGICAL} | {"result": orbit.result}
    if orbit.eccentricity is not None:
        multipliers = {"real": orbit.multipliers.real, "imag": orbit.multipliers.imag}
        row |= {f"multiplier_{part}": values for part, values in multipliers.items()}
        row["eccentricity"] = orbit.eccentricity
    return row


@dataclass
class _Grid:
    """Cells in the order of their product, and what is known of each."""

    shape: tuple[int, ...]
    ordered: tuple[bool, ...]  # whether an axis has neighbours
    numbers: dict[str, np.ndarray]
    dims: int = 2  # of a guess
    rows: dict[int, dict[str, Any]] = field(default_factory=dict)

    def fill(
        self,
        solve: Callable,
        members: list[int],
        points: int,
        engine: Engine,
        report: Callable[[int, int], None],
        begin: Mapping[int, np.ndarray] | None = None,
    ) -> None:
        """Solve what is not solved well, then what fails from neighbours, until none is new.

        The guesses of `begin` take the place of what is known of the cells.
        """
        total = math.prod(self.shape)
        wanted = [(n, self._own(n, points)) for n in members if not self._settled(n)]
        if begin is not None:
            wanted = [(n, np.asarray(resample(jnp.asarray(begin[n]), points))) for n in members]
        tried: set[tuple[int, int]] = set()
        while wanted:
            found: set[int] = set()
            for number, row in self._solve(solve, wanted, engine):
                if number not in self.rows or (row["success"] and number not in found):
                    self.rows[number] = row
                    if row["success"]:
                        found.add(number)
                report(len(self.rows), total)
            left = [number for number in members if not self.rows[number]["success"]]
            # As many guesses of each as fill a chunk.
            guesses = max(1, CHUNK // max(1, len(left)))
            pairs = [(n, near) for n in left for near in self._untried(n, tried)[:guesses]]
            tried.update(pairs)
            wanted = [(number, self._own(near, points)) for number, near in pairs]

    def numbers_of(self, cells: Sequence[int] | np.ndarray) -> dict[str, np.ndarray]:
        """The numbers of some cells."""
        return {name: column[np.asarray(cells)] for name, column in self.numbers.items()}

    def _untried(self, number: int, tried: set[tuple[int, int]]) -> list[int]:
        """Neighbours that are solved, and from which a cell was not yet tried."""
        near = self._neighbours(number)
        return [n for n in near if self.rows[n]["success"] and (number, n) not in tried]

    def _settled(self, number: int) -> bool:
        """Whether a cell is known as well as it can be wished for."""
        row = self.rows.get(number)
        return row is not None and bool(row["success"]) and bool(row["error"] <= SETTLED)

    def _own(self, number: int, points: int) -> np.ndarray:
        """The orbit of a cell, as a guess; NaN, which stands for the pin at rest, if none."""
        row = self.rows.get(number)
        if row is None or not row["success"] or "eccentricity" not in row:
            return np.full((points, self.dims), np.nan)
        return np.asarray(resample(jnp.asarray(row["eccentricity"]), points))

    def _solve(self, solve: Callable, wanted: list[tuple[int, np.ndarray]], engine: Engine):
        """Rows as they come; the last chunk is as large as the others, or it were compiled anew."""
        padded = wanted + wanted[-1:] * (-len(wanted) % CHUNK)
        index = np.array([number for number, _ in padded])
        cases = (
            self.numbers_of(index),
            np.stack([guess for _, guess in padded]),
        )
        for part, found in run_chunks(solve, cases, CHUNK, engine):
            for i, (number, _) in enumerate(wanted[part]):
                yield number, jax.tree.map(lambda leaf, i=i: leaf[i], found)

    def _neighbours(self, number: int) -> list[int]:
        """Some steps along one axis of numbers, the nearest first; of the same choices."""
        place = np.unravel_index(number, self.shape)
        steps = [sign * length for length in range(1, REACH + 1) for sign in (-1, 1)]
        found = []
        for step, (axis, size) in itertools.product(steps, enumerate(self.shape)):
            if self.ordered[axis] and 0 <= place[axis] + step < size:
                moved = [p + step * (k == axis) for k, p in enumerate(place)]
                found.append(int(np.ravel_multi_index(moved, self.shape)))
        return found


def _variables(
    varied: dict[str, tuple], shape: tuple[int, ...], rows: list[dict[str, Any]], metric: str
) -> dict[str, tuple]:
    """Of the dataset."""

    def variable(name: str, unit: str, meaning: str, *further: str) -> tuple:
        found = np.array([row[name] for row in rows])
        found = found.reshape(*shape, *found.shape[1:])
        return (*varied, *further), found, {"units": unit, "long_name": meaning}

    # Of an ideal joint, and without friction, there are fewer.
    held = set.intersection(*(set(row) for row in rows))
    meanings = {name: (of.unit, of.meaning) for name, of in STATISTIC.items()} | VARIABLES
    meanings |= {name: ("1", meaning) for name, meaning in LOGICAL.items()}
    data = {name: variable(name, *rest) for name, rest in meanings.items() if name in held}
    if "slope" in held:
        unit, meaning = STATISTIC[metric].unit, f"slope of {metric} by the parameter, per its unit"
        data["slope"] = variable("slope", unit, meaning, "parameter")
    for part in ("real", "imag"):
        if (name := f"multiplier_{part}") in held:
            data[name] = variable(name, "1", f"{part}: Floquet multipliers", "multiplier")
    reasons = [reason(row["result"]) for row in rows]
    failures = np.array(reasons, object).reshape(shape)
    data["failure"] = tuple(varied), failures, {"long_name": "why there is no orbit"}
    return data
