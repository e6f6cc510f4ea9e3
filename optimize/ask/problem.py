"""The problem of a search: what is free, what is to be small, and what a design must satisfy."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Scalar

from jaxcrusher.batch.sweep import columns_of_row
from jaxcrusher.crusher.capacity import CrushingChamber
from jaxcrusher.files.table import COLUMNS, Column, columns_of
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.scenes.build import LINKS, build_chamber
from optimize.ask.design import Design
from optimize.ask.limits import Limit
from optimize.ask.objectives import OBJECTIVES, Formula, Objective, plain
from optimize.ask.options import Effort

# Statistics of objectives that are traded against the RMS of a crusher's force on its foundation.
AGAINST_RMS = ("foundation_peak", "shaking_rms", "shaking_peak", "shaking_moment_rms")
# Designs whose capacity is computed at once.
AT_ONCE = 64


@dataclass(frozen=True, eq=False)
class DesignProblem:
    """A search, as its options were read once: a scene file that changes later does not matter.

    `chamber` is that of the numbers that are not free; where links are, see `chamber_of`. A linkage
    that is no crusher has none, and no capacity.
    """

    design: Design
    objective: Objective
    chamber: CrushingChamber | None
    capacity_floor: float = 0.0  # m3/h
    inside_model: bool = False  # also refuse motions outside the contact model
    limits: tuple[Limit, ...] = ()
    reference: Mapping[str, float] = field(default_factory=dict)  # the design to compare with
    compared_with: str = "paper's choice"  # or the scene file's
    bulk_density: float | None = None  # kg/m3, of the crushed rock
    units: Mapping[str, str] = field(default_factory=dict)  # that numbers were given in, if known
    effort: Effort = field(default_factory=Effort)
    settings: Mapping[str, Any] = field(default_factory=dict)  # all that decides the answer

    @cached_property
    def scene(self) -> Scene:
        """The scene in the middle of the box: parts and names are those of every other one."""
        with jax.ensure_compile_time_eval():  # it may be asked for while a program is traced
            return self.design.scene(np.full(len(self.design.names), 0.5))

    @property
    def forces(self) -> tuple[str, ...]:
        """The statistics that every design is told by: its leading one, and what shakes."""
        return tuple(dict.fromkeys((self.scene.headline, "shaking_rms")))

    @property
    def rival(self) -> Objective:
        """The force that the objective is traded against: the peak, or what it leaves aside.

        A linkage that is no crusher trades what shakes against the peak force in its first loose
        joint, and all else against what shakes.
        """
        if self.chamber is not None:
            against = self.objective.outputs[0] in AGAINST_RMS
            return OBJECTIVES["rms" if against else "peak"]
        own = f"{self.scene.joints.names[0]}_force_peak"
        shakes = "shaking_rms" in self.objective.outputs
        return plain(own if shakes else "shaking_rms", self.scene.statistics)

    @cached_property
    def numbers(self) -> dict[str, Formula]:
        """The numbers of an orbit that are differentiated: what is small, traded or limited."""
        limited = {
            one.statistic: plain(one.statistic, self.scene.statistics) for one in self.limits
        }
        objectives = {"objective": self.objective, self.rival.outputs[0]: self.rival, **limited}
        found = {name: one.formula for name, one in objectives.items()}
        return found if self.chamber is None else {**found, "capacity": _crushing}

    @property
    def statistics(self) -> tuple[str, ...]:
        """The statistics of every table: the usual ones, those limited, and the rival's."""
        limited = (limit.statistic for limit in self.limits)
        named = (*self.scene.usual_statistics, *limited, *self.rival.outputs)
        return tuple(dict.fromkeys(named))

    @cached_property
    def columns(self) -> dict[str, Column]:
        """The columns of what is told of a motion that was integrated."""
        scene, of = self.scene, self.objective
        found = columns_of_row(scene.watched, scene.entries(self.statistics))
        found |= columns_of(scene.statistics, of.outputs)
        found["objective"] = Column(of.unit, of.meaning)
        meaning = "may be chosen: succeeded, no whirl, inside the constraints"
        found["counts"] = Column("1", meaning, bool)
        return found | {name: COLUMNS[name] for name in ("steps", "state")}

    def capacity(self, places: Float[np.ndarray, "*batch n"]) -> np.ndarray:
        """Crushing capacity of points of the unit box, m3/h; NaN of what crushes nothing."""
        if self.chamber is None:
            return np.full(np.shape(places)[:-1], np.nan)
        rows = np.reshape(places, (-1, len(self.design.names)))
        # As many at once at any time: each number of rows would be a program of its own.
        filled = np.resize(rows, (-(-len(rows) // AT_ONCE), AT_ONCE, rows.shape[1]))
        found = [np.zeros(0), *(np.asarray(_capacities(self, part)) for part in filled)]
        return np.concatenate(found)[: len(rows)].reshape(np.shape(places)[:-1])

    def reaches(self, capacity: ArrayLike) -> np.ndarray:
        """Tell whether capacities (m3/h) are at least the floor, but for rounding.

        What crushes nothing has no floor to reach.
        """
        if self.chamber is None:
            return np.ones(np.shape(capacity), bool)
        return np.asarray(capacity) >= self.capacity_floor * (1 - 1e-12)

    def chamber_of(self, described: Mapping[str, Any]) -> CrushingChamber | None:
        """Return the chamber of a description, whose numbers may be traced.

        The links decide its stroke.
        """
        return build_chamber(self.design.whole(described)) if self.links_free else self.chamber

    def chamber_at(self, unit: Float[Array, " n"]) -> CrushingChamber | None:
        """Return the chamber of a point of the unit box, which may be traced."""
        return self.chamber_of(self.design.description(unit)) if self.links_free else self.chamber

    @property
    def links_free(self) -> bool:
        """Whether the capacity at a speed depends on what is free, as by the stroke."""
        if self.chamber is None:
            return False
        free, kept = {*self.design.names}, self.design.kept_stroke is not None
        return "gravity" in free or (bool({*LINKS} & free) and not kept)

    @property
    def floor_bends(self) -> bool:
        """Whether the capacity's floor is no corner of the box, but a constraint of its own."""
        return self.links_free and self.capacity_floor > 0

    @property
    def constrained(self) -> bool:
        """Whether there are constraints that are no bounds."""
        return bool(self.limits) or self.floor_bends

    @property
    def slowest(self) -> float:
        """The lowest driving speed, rad/s."""
        if "speed" in self.design.bounds:
            return self.design.bounds["speed"][0]
        return float(self.design.whole(self.design.fixed)["speed"])

    @cached_property
    def speeds(self) -> tuple[float, float] | None:
        """The lowest and the highest speed that the capacity allows, rad/s; None without one."""
        if self.chamber is None:
            return None
        highest = self.chamber.highest_speed(self.capacity_floor)
        return float(self.chamber.lowest_speed()), float(highest)

    @cached_property
    def upper(self) -> Float[np.ndarray, " n"]:
        """The box's upper corner in the unit box: the capacity's floor may cut the speed short.

        Where links are free the floor is no corner: designs below it do not count.
        """
        corner = np.ones(len(self.design.names))
        cut = self.capacity_floor > 0 and not self.links_free
        if "speed" in self.design.names and cut and self.speeds is not None:
            i = self.design.names.index("speed")
            low, high = self.design.bounds["speed"]
            # By rounding a floor that is the capacity at the lowest speed may end below it.
            corner[i] = np.clip((self.speeds[1] - low) / (high - low), 0.0, 1.0)
        return corner


def _crushing(_: Any, scene: Scene, chamber: CrushingChamber) -> Scalar:
    """Crushing capacity at the scene's speed, m3/h."""
    return chamber.capacity(scene.drive.speed)


@eqx.filter_jit
def _capacities(problem: DesignProblem, places: Float[Array | np.ndarray, "points n"]) -> Array:
    def capacity(unit: Array | np.ndarray) -> Scalar:
        described = problem.design.whole(problem.design.description(unit))
        chamber = problem.chamber_of(described)
        assert chamber is not None
        return chamber.capacity(described["speed"])

    return jax.vmap(capacity)(places)
