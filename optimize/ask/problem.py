"""The problem of a search: free parameters, objective, and constraints of a design."""

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

# Statistics of objectives whose rival is the RMS of a crusher's force on its foundation.
AGAINST_RMS = ("foundation_peak", "shaking_rms", "shaking_peak", "shaking_moment_rms")
# Number of designs whose capacities are computed together.
AT_ONCE = 64


@dataclass(frozen=True, eq=False)
class DesignProblem:
    """The problem of a search. Files are read once, so later changes of a scene file do not matter.

    `chamber` has the fixed numbers; if links are free, see `chamber_of`. A linkage that is not a
    crusher has no chamber and no capacity.
    """

    design: Design
    objective: Objective
    chamber: CrushingChamber | None
    capacity_floor: float = 0.0  # m3/h
    inside_model: bool = False  # whether motions outside the contact model are refused
    limits: tuple[Limit, ...] = ()
    reference: Mapping[str, float] = field(default_factory=dict)  # the design to compare with
    compared_with: str = "paper's choice"  # or "scene file's choice"
    bulk_density: float | None = None  # kg/m3, of the crushed rock
    units: Mapping[str, str] = field(default_factory=dict)  # in which numbers were given
    effort: Effort = field(default_factory=Effort)
    settings: Mapping[str, Any] = field(default_factory=dict)  # everything that decides the answer

    @cached_property
    def scene(self) -> Scene:
        """The scene in the middle of the box; all designs have the same parts and names."""
        with jax.ensure_compile_time_eval():  # the caller may be traced
            return self.design.scene(np.full(len(self.design.names), 0.5))

    @property
    def forces(self) -> tuple[str, ...]:
        """The forces reported for every design: the headline RMS and the RMS shaking force."""
        return tuple(dict.fromkeys((self.scene.headline, "shaking_rms")))

    @property
    def rival(self) -> Objective:
        """The second number of a Pareto front: a force that the objective does not contain.

        A linkage that is not a crusher has the RMS shaking force, or the peak force in its first
        loose joint if the objective is the shaking force.
        """
        if self.chamber is not None:
            against = self.objective.outputs[0] in AGAINST_RMS
            return OBJECTIVES["rms" if against else "peak"]
        own = f"{self.scene.joints.names[0]}_force_peak"
        shakes = "shaking_rms" in self.objective.outputs
        return plain(own if shakes else "shaking_rms", self.scene.statistics)

    @cached_property
    def numbers(self) -> dict[str, Formula]:
        """The differentiated numbers of an orbit: objective, rival, limits and capacity."""
        limited = {
            one.statistic: plain(one.statistic, self.scene.statistics) for one in self.limits
        }
        objectives = {"objective": self.objective, self.rival.outputs[0]: self.rival, **limited}
        found = {name: one.formula for name, one in objectives.items()}
        return found if self.chamber is None else {**found, "capacity": _crushing}

    @property
    def statistics(self) -> tuple[str, ...]:
        """The statistics of every table: usual statistics, limited statistics, and the rival's."""
        limited = (limit.statistic for limit in self.limits)
        named = (*self.scene.usual_statistics, *limited, *self.rival.outputs)
        return tuple(dict.fromkeys(named))

    @cached_property
    def columns(self) -> dict[str, Column]:
        """The columns of the table of integrated motions."""
        scene, of = self.scene, self.objective
        found = columns_of_row(scene.watched, scene.entries(self.statistics))
        found |= columns_of(scene.statistics, of.outputs)
        found["objective"] = Column(of.unit, of.meaning)
        meaning = "may be chosen: succeeded, no whirl, inside the constraints"
        found["counts"] = Column("1", meaning, bool)
        return found | {name: COLUMNS[name] for name in ("steps", "state")}

    def capacity(self, places: Float[np.ndarray, "*batch n"]) -> np.ndarray:
        """Return the capacity (m3/h) at points of the unit box; NaN for a linkage, no crusher."""
        if self.chamber is None:
            return np.full(np.shape(places)[:-1], np.nan)
        rows = np.reshape(places, (-1, len(self.design.names)))
        # Batches have a fixed size: each number of rows would compile another program.
        filled = np.resize(rows, (-(-len(rows) // AT_ONCE), AT_ONCE, rows.shape[1]))
        found = [np.zeros(0), *(np.asarray(_capacities(self, part)) for part in filled)]
        return np.concatenate(found)[: len(rows)].reshape(np.shape(places)[:-1])

    def reaches(self, capacity: ArrayLike) -> np.ndarray:
        """Tell which capacities (m3/h) reach the floor, up to rounding.

        A linkage that is not a crusher has no floor: all values are true.
        """
        if self.chamber is None:
            return np.ones(np.shape(capacity), bool)
        return np.asarray(capacity) >= self.capacity_floor * (1 - 1e-12)

    def chamber_of(self, described: Mapping[str, Any]) -> CrushingChamber | None:
        """Return the chamber of a description, whose numbers may be traced.

        Free links change the stroke of the chamber.
        """
        return build_chamber(self.design.whole(described)) if self.links_free else self.chamber

    def chamber_at(self, unit: Float[Array, " n"]) -> CrushingChamber | None:
        """Return the chamber at a point of the unit box, which may be traced."""
        return self.chamber_of(self.design.description(unit)) if self.links_free else self.chamber

    @property
    def links_free(self) -> bool:
        """Whether the capacity at a given speed depends on free parameters, as by the stroke."""
        if self.chamber is None:
            return False
        free, kept = {*self.design.names}, self.design.kept_stroke is not None
        return "gravity" in free or (bool({*LINKS} & free) and not kept)

    @property
    def floor_bends(self) -> bool:
        """Whether the floor of the capacity is a separate constraint, not a bound of the speed."""
        return self.links_free and self.capacity_floor > 0

    @property
    def constrained(self) -> bool:
        """Whether there are constraints besides the bounds of parameters."""
        return bool(self.limits) or self.floor_bends

    @property
    def slowest(self) -> float:
        """The lowest driving speed of the box, rad/s."""
        if "speed" in self.design.bounds:
            return self.design.bounds["speed"][0]
        return float(self.design.whole(self.design.fixed)["speed"])

    @cached_property
    def speeds(self) -> tuple[float, float] | None:
        """The lowest and highest speed (rad/s) that the capacity allows; None without a chamber."""
        if self.chamber is None:
            return None
        highest = self.chamber.highest_speed(self.capacity_floor)
        return float(self.chamber.lowest_speed()), float(highest)

    @cached_property
    def upper(self) -> Float[np.ndarray, " n"]:
        """The upper corner of the searched box: the capacity's floor may lower the highest speed.

        If `links_free`, the corner is not lowered: designs below the floor do not count.
        """
        corner = np.ones(len(self.design.names))
        cut = self.capacity_floor > 0 and not self.links_free
        if "speed" in self.design.names and cut and self.speeds is not None:
            i = self.design.names.index("speed")
            low, high = self.design.bounds["speed"]
            # By rounding the speed of the floor may lie below the lowest speed.
            corner[i] = np.clip((self.speeds[1] - low) / (high - low), 0.0, 1.0)
        return corner


def _crushing(_: Any, scene: Scene, chamber: CrushingChamber) -> Scalar:
    """Return the crushing capacity at the scene's speed, m3/h."""
    return chamber.capacity(scene.drive.speed)


@eqx.filter_jit
def _capacities(problem: DesignProblem, places: Float[Array | np.ndarray, "points n"]) -> Array:
    def capacity(unit: Array | np.ndarray) -> Scalar:
        described = problem.design.whole(problem.design.description(unit))
        chamber = problem.chamber_of(described)
        assert chamber is not None
        return chamber.capacity(described["speed"])

    return jax.vmap(capacity)(places)
