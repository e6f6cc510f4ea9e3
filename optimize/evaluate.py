"""Evaluate designs: their statistics from both starts, and what they count for."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Scalar

import jaxcrusher as jc
from jaxcrusher.basics.plane import Vector
from jaxcrusher.batch.engines import chunk_of, run_all
from jaxcrusher.batch.sweep import row_of
from jaxcrusher.crusher.capacity import CrushingChamber
from jaxcrusher.crusher.rough_feed import steady
from jaxcrusher.files.journal import Journal
from jaxcrusher.mechanism.starts import shifted_start
from jaxcrusher.motion.statistics_table import always_of
from jaxcrusher.scenes.build import LINKS, build_chamber
from optimize.design import Design
from optimize.limits import OF_RUN, Limit
from optimize.objectives import Objective

# A machine may start either way: with its pin centred in the bore (hard impacts), and resting in
# contact (quiet).
STARTS = ("centred", "contact")

Progress = Callable[[int, int], None]
Rows = dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Case:
    """The design, the objective, and the constraints that a design must satisfy to count.

    `chamber` is that of the numbers that are not free; where links are, see `chamber_of`.
    """

    design: Design
    objective: Objective
    chamber: CrushingChamber
    capacity_floor: float = 0.0  # m3/h
    inside_model: bool = False  # also refuse motions outside the contact model
    limits: tuple[Limit, ...] = ()

    def capacity(self, units: Float[np.ndarray, "*batch n"]) -> np.ndarray:
        """Crushing capacity of points of the unit box, m3/h."""
        rows = jnp.reshape(units, (-1, len(self.design.names)))
        return np.asarray(_capacities(self, rows)).reshape(np.shape(units)[:-1])

    def capacity_slope(self, unit: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the slope of the capacity by the axes of the unit box, m3/h."""
        return np.asarray(_capacity_slope(self, jnp.asarray(unit)))

    def chamber_of(self, described: Mapping[str, Any]) -> CrushingChamber:
        """Return the chamber of a description, whose numbers may be traced.

        The links decide its stroke.
        """
        return build_chamber({**jc.PE250X400, **described}) if self.links_free else self.chamber

    @property
    def links_free(self) -> bool:
        """Whether the capacity at a speed depends on what is free, as by the stroke."""
        free, kept = {*self.design.names}, self.design.kept_stroke is not None
        return "gravity" in free or (bool({*LINKS} & free) and not kept)

    @property
    def slowest(self) -> float:
        """The lowest driving speed, rad/s."""
        if "speed" in self.design.bounds:
            return self.design.bounds["speed"][0]
        return float(self.design.fixed.get("speed", jc.PE250X400["speed"]))

    @property
    def upper(self) -> Float[np.ndarray, " n"]:
        """The box's upper corner in the unit box: the capacity's floor may cut the speed short.

        Where links are free the floor is no corner: designs below it do not count.
        """
        corner = np.ones(len(self.design.names))
        cut = self.capacity_floor > 0 and not self.links_free
        if "speed" in self.design.names and cut:
            i = self.design.names.index("speed")
            low, high = self.design.bounds["speed"]
            fastest = float(self.chamber.highest_speed(self.capacity_floor))
            # By rounding a floor that is the capacity at the lowest speed may end below it.
            corner[i] = np.clip((fastest - low) / (high - low), 0.0, 1.0)
        return corner


def _capacity(unit: Float[Array, " n"], case: Case) -> Scalar:
    described = {**jc.PE250X400, **case.design.description(unit)}
    return case.chamber_of(described).capacity(described["speed"])


@eqx.filter_jit
def _capacities(case: Case, units: Float[Array, "points n"]) -> Float[Array, " points"]:
    return jax.vmap(lambda unit: _capacity(unit, case))(units)


@eqx.filter_jit
def _capacity_slope(case: Case, unit: Float[Array, " n"]) -> Float[Array, " n"]:
    return jax.grad(_capacity)(unit, case)


@dataclass(frozen=True)
class Window:
    """Turns before statistics start, turns they cover, and the tolerance of a step."""

    settle: int
    turns: int
    rtol: float


def evaluate(
    case: Case,
    units: Float[np.ndarray, "points n"],
    window: Window,
    *,
    shifts: Float[np.ndarray, "points 2"] | None = None,
    chunk: int = 128,
    journal: Journal | None = None,
    progress: Progress | None = None,
) -> Rows:
    """Return the statistics of unit points from both starts.

    `shifts` moves the starts by so many clearances, `chunk` is how many motions are integrated
    between two reports of progress, on a GPU more, and `journal` keeps finished chunks. Rows have
    the shape (starts, points): the columns of `jaxcrusher.sweep`, `objective` in its unit, the
    number of `steps`, `counts`, whether the design may be chosen (see `may_count`), and the `state`
    at the end, (starts, points, dims), to go on from.
    """
    moves = np.zeros((len(units), 2)) if shifts is None else shifts
    points = jnp.asarray(units)
    batch = stacked_scenes(case, points, jnp.asarray(moves)), np.tile(points, (len(STARTS), 1))
    function = eqx.Partial(_row, case=case, window=window)
    at_once = chunk_of(len(STARTS) * len(units), usual=chunk)
    found = run_all(function, batch, at_once, progress=progress, journal=journal)
    rows = {
        name: column.reshape(len(STARTS), len(units), *column.shape[1:])
        for name, column in found.items()
    }
    return rows | {"counts": may_count(rows, case, case.capacity(units))}


def may_count(rows: Mapping[str, Any], case: Case, capacity) -> np.ndarray:
    """Whether the motion of each start succeeded, without whirl, within the constraints.

    A whirl's numbers are outside the contact theory, whatever the objective says of it.
    """
    good = rows["success"].astype(bool) & ~rows["whirl"].astype(bool)
    if case.inside_model:
        good = good & rows["inside_model"].astype(bool)
    for limit in case.limits:
        good = good & limit.kept(rows, OF_RUN)
    return good & (np.asarray(capacity) >= case.capacity_floor * (1 - 1e-12))


def losses(
    rows: Mapping[str, Any], case: Case, capacity: Float[np.ndarray, " designs"], designs: str
) -> str:
    """Say why none of some `designs` counts, and of how many each reason is true.

    Rows have the shape (starts, designs, ...), as those of `evaluate` or of long runs.
    """
    limited = (limit.statistic for limit in case.limits)
    columns = ("success", "whirl", "inside_model", "objective", *limited)
    seen = {
        name: np.asarray(rows[name]).reshape(len(STARTS), len(capacity), -1) for name in columns
    }
    failed = ~seen["success"].astype(bool)
    lost = {"failed to integrate": failed, "come to a friction whirl": seen["whirl"].astype(bool)}
    if case.inside_model:
        lost["leave the contact model"] = ~failed & ~seen["inside_model"].astype(bool)
    for limit in case.limits:
        beyond = f"have a {limit.statistic} above {limit.most:.4g} {limit.unit}"
        lost[beyond] = ~failed & ~limit.kept(seen, OF_RUN)
    lost["have no number of the objective"] = ~failed & np.isnan(seen["objective"])
    counts = {why: int(each.any(axis=(0, 2)).sum()) for why, each in lost.items()}
    short = f"are below the capacity of {case.capacity_floor:.4g} m3/h"
    if len(capacity):
        short += f" (the highest is {np.max(capacity):.4g} m3/h)"
    counts[short] = int((capacity < case.capacity_floor * (1 - 1e-12)).sum())
    told = [f"{count} {why}" for why, count in counts.items() if count]
    return f"of {len(capacity)} {designs} {', '.join(told)}"


def judged(rows: Mapping[str, Any]) -> np.ndarray:
    """The objective of the worse start, shape (points,); NaN where either does not count."""
    worse = np.max(rows["objective"], axis=0)
    return np.where(np.all(rows["counts"], axis=0), worse, np.nan)


def started(
    description: Mapping[str, Any], start: str, shift: Iterable[ArrayLike] = (0.0, 0.0)
) -> jc.Scene:
    """The scene of a description from one of the `STARTS`, `shift` clearances off.

    With the start as numbers, the scenes of all starts run as one program. A rough feed's motions
    are those under its mean load.
    """
    scene = steady(jc.build_scene({**description, "start": start}))
    return shifted_start(scene, Vector(*shift))


@eqx.filter_jit
def stacked_scenes(
    case: Case, units: Float[Array, "points n"], shifts: Float[Array, "points 2"] | None = None
) -> jc.Scene:
    """The scenes of all points from one start, then from the other, stacked."""
    shifts = jnp.zeros((len(units), 2)) if shifts is None else shifts

    def one(unit: Array, shift: Array, start: str) -> jc.Scene:
        return started(case.design.description(unit), start, shift)

    parts = [jax.vmap(eqx.Partial(one, start=start))(units, shifts) for start in STARTS]
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *parts)


def _row(batch: tuple[jc.Scene, Array], case: Case, window: Window) -> dict[str, Array]:
    """Return the row of a scene at a point of the unit box."""
    scene, unit = batch
    limited = (limit.statistic for limit in case.limits)
    always = tuple(dict.fromkeys((*always_of(scene), *limited)))
    outputs = tuple(dict.fromkeys((*always, *case.objective.outputs)))
    result = jc.statistics(scene, window.settle, window.turns, outputs=outputs, rtol=window.rtol)
    chamber = case.chamber_of(case.design.description(unit))
    objective = case.objective.formula(result, scene, chamber)
    further = {"objective": objective, "steps": result.outcome.steps, "state": result.state}
    return row_of(result, always) | further
