"""Equal stroke: the eccentricity that keeps the jaw's work when the links change."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.crusher.capacity import lower_end
from jaxcrusher.crusher.machine import Machine
from jaxcrusher.scenes.build import build_machine

# Angles looked at for the ends of the stroke, and Newton steps from the best of them: from
# 2.5 deg off, three leave less than rounding.
ANGLES, POLISH = 72, 3
# Newton steps on the eccentricity, to which the stroke is nearly proportional.
STEPS = 5


def exact_stroke(machine: Machine) -> Scalar:
    """The stroke, m, with its ends found between the points of `jaxcrusher.crusher.capacity`.

    The extremes of 720 points are short by up to 1e-5 of the stroke, in steps as the ends move.
    At a stationary angle the derivative by the links is exact with the angle held.
    """
    held = jax.lax.stop_gradient(machine)
    rate = jax.grad(lower_end)
    angles = jnp.linspace(0, 2 * jnp.pi, ANGLES, endpoint=False)
    travel = jax.vmap(lower_end, (0, None))(angles, held)
    ends = angles[jnp.stack([jnp.argmax(travel), jnp.argmin(travel)])]

    def newton(_, ends):
        bend = jax.vmap(jax.grad(rate), (0, None))(ends, held)
        return ends - jax.vmap(rate, (0, None))(ends, held) / bend

    ends = jax.lax.fori_loop(0, POLISH, newton, ends)
    right, left = jax.vmap(lower_end, (0, None))(jax.lax.stop_gradient(ends), machine)
    return right - left


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
    def of(cls, values: Mapping[str, Any]) -> "EqualStroke":
        """With the stroke of a description."""
        return cls(float(jax.jit(exact_stroke)(build_machine(values))))

    def __call__(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The numbers with the eccentricity added; differentiable."""

        def excess(eccentricity: Scalar, values: Mapping[str, Any]) -> Scalar:
            machine = build_machine({**values, "shaft.eccentricity": eccentricity})
            return exact_stroke(machine) - self.target

        held = jax.lax.stop_gradient(jax.tree.map(jnp.asarray, dict(values)))

        def newton(_, eccentricity):
            now, slope = jax.value_and_grad(excess)(eccentricity, held)
            return eccentricity - now / slope

        start = jnp.asarray(sum(self.limits) / 2)
        solved = jax.lax.stop_gradient(jax.lax.fori_loop(0, STEPS, newton, start))
        # A last step, differentiated by the links only, has the derivative of the root.
        slope = jax.lax.stop_gradient(jax.grad(excess)(solved, held))
        solved = solved - excess(solved, values) / slope
        inside = (solved > self.limits[0]) & (solved < self.limits[1])
        return {**values, "shaft.eccentricity": jnp.where(inside, solved, jnp.nan)}
