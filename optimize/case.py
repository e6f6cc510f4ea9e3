"""What is free, what is to be small, and the constraints that a design must satisfy."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Scalar

import jaxcrusher as jc
from jaxcrusher.crusher.capacity import CrushingChamber
from jaxcrusher.scenes.build import LINKS, build_chamber
from optimize.design import Design
from optimize.limits import Limit
from optimize.objectives import Objective


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

    def reaches(self, capacity: ArrayLike) -> np.ndarray:
        """Tell whether capacities (m3/h) are at least the floor, but for rounding."""
        return np.asarray(capacity) >= self.capacity_floor * (1 - 1e-12)

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
