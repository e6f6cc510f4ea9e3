"""A design: named parameters with bounds, the unit box the search works on, and its scenes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

import jaxcrusher as jc
from jaxcrusher.basics.checks import concrete, require, require_known
from jaxcrusher.scenes.own_laws import check_described
from jaxcrusher.scenes.parameters import check_number


class Completion(Protocol):
    """Adds to the numbers of a description what follows from them; differentiable by JAX."""

    inputs: ClassVar[tuple[str, ...]]  # names it takes beyond those of `jaxcrusher.PARAMETERS`

    def __call__(self, values: dict[str, Any]) -> dict[str, Any]:
        """The numbers with its inputs replaced by names of `jaxcrusher.PARAMETERS`."""
        ...


@dataclass(frozen=True)
class CounterweightMoment:
    """The counterweight by its first moment about O (kg m), along and across O-A.

    By mass and angle it would have a trap: a mass that comes to zero no longer feels its angle,
    and a descent stays there although another angle would help.
    """

    inputs: ClassVar[tuple[str, ...]] = (
        "counterweight.moment_along",
        "counterweight.moment_across",
    )

    def __call__(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Mass and angle, at the description's `counterweight.radius`."""
        rest = dict(values)
        along, across = (rest.pop(name) for name in self.inputs)
        # At zero the length of the moment has no slope: that towards O-A is taken.
        along = along + jnp.where((along == 0) & (across == 0), 1e-12, 0.0)
        radius = rest.get("counterweight.radius", jc.PARAMETERS["counterweight.radius"].default)
        moment = jnp.sqrt(along**2 + across**2)
        rest["counterweight.mass"] = moment / radius
        rest["counterweight.angle"] = jnp.arctan2(across, along)
        return rest


@dataclass(frozen=True, eq=False)
class Design:
    """The free parameters of a crusher with their bounds, and those that are fixed.

    **Arguments:**

    - `bounds`: names of `jaxcrusher.PARAMETERS`, or inputs of a completion, with their lowest
      and highest value in SI units.
    - `fixed`: the other numbers and choices of the description; what is missing is the paper's.
    - `completions`: called one after the other with all numbers of the description.

    Raises ValueError for unknown names, bounds that are not LOW < HIGH inside the parameter's
    limits, and a name that is both free and fixed.
    """

    bounds: Mapping[str, tuple[float, float]]
    fixed: Mapping[str, Any] = field(default_factory=dict)
    completions: tuple[Completion, ...] = ()

    def __post_init__(self):
        require(len(self.bounds) > 0, "bounds", "name a parameter", dict(self.bounds))
        check_described(self.fixed)  # a law of one's own makes its numbers known
        extra = [name for completion in self.completions for name in completion.inputs]
        for name, (low, high) in self.bounds.items():
            require_known(name, (*jc.PARAMETERS, *extra))
            good = bool(np.isfinite([low, high]).all()) and low < high
            require(good, f"bounds of {name}", "be finite, LOW < HIGH", (low, high))
            if name in jc.PARAMETERS:
                check_number(name, np.array([low, high]))
            require(name not in self.fixed, "fixed", "hold no free parameter", name)

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the free parameters, in the order of the unit box."""
        return tuple(self.bounds)

    def values(self, unit: Float[ArrayLike, "*batch n"]) -> dict[str, Array]:
        """The free parameters at a point of the unit box, in SI units."""
        low, high = jnp.array(list(self.bounds.values())).T
        numbers = low + jnp.asarray(unit) * (high - low)
        return {name: numbers[..., i] for i, name in enumerate(self.names)}

    def numbers(self, unit: Float[ArrayLike, " n"]) -> dict[str, float]:
        """`values` of one point, as Python's numbers."""
        return {name: float(value) for name, value in self.values(unit).items()}

    def unit(self, values: Mapping[str, ArrayLike]) -> np.ndarray:
        """The inverse of `values`, with every free name; outside the bounds, outside the box."""
        rows = [
            (np.asarray(values[name]) - low) / (high - low)
            for name, (low, high) in self.bounds.items()
        ]
        return np.stack(rows, axis=-1)

    def description(
        self, unit: Float[ArrayLike, " n"], conditions: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """The completed description at a point; `conditions` go before everything else.

        Raises ValueError for a concrete point outside the box.
        """
        point = concrete(unit)
        if point is not None:
            good = point.shape == (len(self.bounds),) and bool(((point >= 0) & (point <= 1)).all())
            require(good, "unit", f"be {len(self.bounds)} numbers in [0, 1]", point)
        described = {**self.fixed, **self.values(unit), **(conditions or {})}
        choices = {name: value for name, value in described.items() if isinstance(value, str)}
        numbers = {name: value for name, value in described.items() if name not in choices}
        complete = self._complete if point is None else self._compiled
        return {**choices, **complete(numbers)}

    def _complete(self, numbers: dict[str, Any]) -> dict[str, Any]:
        for completion in self.completions:
            numbers = completion(numbers)
        return numbers

    @cached_property
    def _compiled(self):
        """For concrete points: a loop that is not compiled once is compiled at every call."""
        return jax.jit(self._complete)

    def scene(
        self, unit: Float[ArrayLike, " n"], conditions: Mapping[str, Any] | None = None
    ) -> jc.Scene:
        """The scene at a point of the unit box, which may be traced.

        Raises ValueError (concrete points only) outside the box and for a machine that cannot
        be built; a traced one has NaN in every number of its motion.
        """
        return jc.build_scene(self.description(unit, conditions))
