"""A design: named parameters with bounds, the unit box the search works on, and its scenes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import jax
import numpy as np
from jaxtyping import Array, ArrayLike, Float

import jaxcrusher as jc
from jaxcrusher.basics.checks import concrete, require, require_known
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.scenes.parameters import MOMENTS, check_number
from optimize.ask.completions import CounterweightMoment, EqualStroke

# More free numbers than these get a Sobol sequence instead of a grid.
GRID_DIMENSIONS = 2


@dataclass(frozen=True, eq=False)
class Design:
    """The free parameters of a machine with their bounds.

    **Arguments:**

    - `bounds`: names of the machine's numbers, or both of `CounterweightMoment.inputs`, with their
      lowest and highest value in SI units.
    - `machine`: what is not free of it is fixed.
    - `kept_stroke`: by which the eccentricity follows from the other numbers, if anything.

    Raises ValueError for unknown names, bounds that are not LOW < HIGH inside the parameter's
    limits, and a name that is free and follows.
    """

    bounds: Mapping[str, tuple[float, float]]
    machine: jc.Machine = field(default_factory=jc.paper_machine)
    kept_stroke: EqualStroke | None = None

    def __post_init__(self):
        require(len(self.bounds) > 0, "bounds", "name a parameter", dict(self.bounds))
        known = {**self.machine.numbers, **MOMENTS}
        for name, (low, high) in self.bounds.items():
            require_known(name, known)
            good = bool(np.isfinite([low, high]).all()) and low < high
            require(good, f"bounds of {name}", "be finite, LOW < HIGH", (low, high))
            check_number(name, np.array([low, high]), known)
            require(name not in self.following, "bounds", "name nothing that follows", name)
        moment = [name for name in CounterweightMoment.inputs if name in self.bounds]
        require(len(moment) != 1, "bounds", "name both parts of the moment", moment)

    @cached_property
    def fixed(self) -> dict[str, Any]:
        """Return the numbers and choices that are given, and neither free nor follow."""
        apart = {*self.bounds, *self.following}
        return {name: value for name, value in self.machine.given.items() if name not in apart}

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the free parameters, in the order of the unit box."""
        return tuple(self.bounds)

    @property
    def completions(self) -> tuple[CounterweightMoment | EqualStroke, ...]:
        """Return what is called one after the other with all numbers of the description."""
        by_moment = bool({*CounterweightMoment.inputs} & {*self.bounds})
        found = (CounterweightMoment() if by_moment else None, self.kept_stroke)
        return tuple(one for one in found if one is not None)

    @property
    def following(self) -> tuple[str, ...]:
        """Return the names of the numbers that follow from the others."""
        return tuple(name for completion in self.completions for name in completion.outputs)

    def values(self, unit: Float[Array | np.ndarray, "*batch n"]) -> dict[str, Any]:
        """The free parameters at a point of the unit box, in SI units."""
        low, high = np.array(list(self.bounds.values())).T
        numbers = low + unit * (high - low)
        return {name: numbers[..., i] for i, name in enumerate(self.names)}

    def numbers(self, unit: Float[np.ndarray, " n"]) -> dict[str, float]:
        """`values` of one point, as Python's numbers."""
        return {name: float(value) for name, value in self.values(unit).items()}

    def unit(self, values: Mapping[str, ArrayLike]) -> np.ndarray:
        """The inverse of `values`, with every free name; outside the bounds, outside the box."""
        rows = [
            (np.asarray(values[name]) - low) / (high - low)
            for name, (low, high) in self.bounds.items()
        ]
        return np.stack(rows, axis=-1)

    def description(self, unit: Float[Array | np.ndarray, " n"]) -> dict[str, Any]:
        """The completed description at a point; ValueError for a concrete one outside the box."""
        point = concrete(unit)
        if point is not None:
            good = point.shape == (len(self.bounds),) and bool(((point >= 0) & (point <= 1)).all())
            require(good, "unit", f"be {len(self.bounds)} numbers in [0, 1]", point)
        return self.described(self.values(unit))

    def described(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The completed description of the free parameters' values, which may be traced."""
        described = {**self.fixed, **values}
        if not self.completions:
            return described
        choices = {name: value for name, value in described.items() if isinstance(value, str)}
        numbers = {name: value for name, value in described.items() if name not in choices}
        known = all(concrete(value) is not None for value in numbers.values())
        complete = self._compiled if known else self._complete
        return {**choices, **complete(numbers)}

    def _complete(self, numbers: dict[str, Any]) -> dict[str, Any]:
        for completion in self.completions:
            numbers = completion(numbers)
        return numbers

    @cached_property
    def _compiled(self):
        """For concrete points: a loop that is not compiled once is compiled at every call."""
        return jax.jit(self._complete)

    def scene(self, unit: Float[Array | np.ndarray, " n"]) -> Scene:
        """The scene at a point of the unit box, which may be traced.

        Raises ValueError (concrete points only) outside the box and for a machine that cannot
        be built; a traced one has NaN in every number of its motion.
        """
        return self.build(self.description(unit))

    def build(self, described: Mapping[str, Any]) -> Scene:
        """The scene of a completed description; raises as `scene` does."""
        return self.machine.structure.scene(described)

    def whole(self, described: Mapping[str, Any]) -> dict[str, Any]:
        """The description with what it leaves to the machine."""
        return {**self.machine.values, **described}
