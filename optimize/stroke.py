"""Equal stroke: the eccentricity that keeps the jaw's work when the links change."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.checks import nan_unless
from jaxcrusher.crusher.capacity import stroke
from jaxcrusher.scenes.build import build_machine

# Newton steps on the eccentricity, to which the stroke is nearly proportional.
STEPS = 5


@dataclass(frozen=True)
class EqualStroke:
    """Completes a description by the eccentricity that gives B the horizontal travel `target` (m).

    Where that is not inside `limits` (m), or the linkage does not close, it is NaN, and so is
    every number of a motion made with it. With a given discharge opening the capacity by
    (21)-(25) depends on speed and stroke alone, and so is equal too.
    """

    target: float
    limits: tuple[float, float] = (0.004, 0.04)
    inputs: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def of(
        cls, values: Mapping[str, Any], multiples: tuple[float, float] = (0.4, 4.0)
    ) -> "EqualStroke":
        """With the stroke of a description; limits are multiples of its eccentricity."""
        machine = build_machine(values)
        low, high = (float(machine.shaft.eccentricity) * multiple for multiple in multiples)
        return cls(float(jax.jit(stroke)(machine)), (low, high))

    def __call__(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The numbers with the eccentricity added; differentiable."""

        def excess(eccentricity: Scalar, values: Mapping[str, Any]) -> Scalar:
            machine = build_machine({**values, "shaft.eccentricity": eccentricity})
            return stroke(machine) - self.target

        held = jax.lax.stop_gradient(jax.tree.map(jnp.asarray, dict(values)))

        def newton(_, eccentricity):
            now, slope = jax.value_and_grad(excess)(eccentricity, held)
            return eccentricity - now / slope

        start = jnp.asarray(sum(self.limits) / 2)
        solved = jax.lax.stop_gradient(jax.lax.fori_loop(0, STEPS, newton, start))
        # A step, differentiated by the links only, has the derivative of the root, and a second one
        # has the second derivative too.
        slope = jax.lax.stop_gradient(jax.grad(excess)(solved, held))
        for _ in range(2):
            solved = solved - excess(solved, values) / slope
        inside = (solved > self.limits[0]) & (solved < self.limits[1])
        return {**values, "shaft.eccentricity": nan_unless(inside, solved)}
