"""A load that no two strokes have alike: any other one, times a random wave over the angle.

F (1 + s w(theta)) with the scatter s. The wave w has a mean of 0, a variance of 1, and a flat
spectrum from order 0 to the bandwidth, in multiples of the shaft's speed.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Scalar

from jaxcrusher.basics.plane import scalar
from jaxcrusher.crusher.loads import AbstractLoad, JawForce, JawMotion
from jaxcrusher.crusher.scene import Scene

# Cosines of a wave.
COSINES = 64


class RoughFeed(AbstractLoad):
    """A load times 1 + s w, w = sqrt(2 / K) sum of K cosines of order nu_k and phase phi_k.

    Shinozuka and Jan, J. Sound Vib. 25, 1972. Each order lies at random in a K-th of the band, as
    equal steps would repeat the wave after some turns.
    """

    load: AbstractLoad  # the mean
    scatter: Scalar = eqx.field(converter=scalar)  # s
    bandwidth: Scalar = eqx.field(converter=scalar)  # largest order
    places: Float[Array, " cosines"]  # nu_k / bandwidth
    phases: Float[Array, " cosines"]  # rad

    def steady(self) -> AbstractLoad:
        """Return the mean load."""
        return self.load

    def force(self, jaw: JawMotion) -> JawForce:
        """The mean load's, times 1 + s w."""
        return _times(1 + self.scatter * self.wave(jaw.turned), self.load.force(jaw))

    def wave(self, angle: Scalar) -> Scalar:
        """Return w at an angle that the shaft has turned by since time zero, rad."""
        turned = self.places * (self.bandwidth * angle) + self.phases
        return np.sqrt(2 / len(self.phases)) * jnp.sum(jnp.cos(turned))


class Multiplied(AbstractLoad):
    """A load times a number."""

    load: AbstractLoad
    factor: Scalar = eqx.field(converter=scalar)

    def force(self, jaw: JawMotion) -> JawForce:
        """The load's, times the factor."""
        return _times(self.factor, self.load.force(jaw))


def _times(factor: Scalar, one: JawForce) -> JawForce:
    return JawForce(factor * one.force, one.along)


def rough_feed(load: AbstractLoad, scatter: Any, bandwidth: Any, seed: Any) -> RoughFeed:
    """Return a load with a wave of its own for each `seed`, a whole number that may be traced."""
    keys = jax.random.split(jax.random.key(jnp.asarray(seed).astype(jnp.uint32)))
    random = [jax.random.uniform(key, (COSINES,), float) for key in keys]
    places, phases = (jnp.arange(COSINES) + random[0]) / COSINES, 2 * np.pi * random[1]
    return RoughFeed(load, scatter, bandwidth, places, phases)


def later(scene: Scene, angle: Any) -> Scene:
    """Return the scene whose time zero is when the shaft has turned by `angle` (rad).

    A run that goes on from the state of another one begins its rough feed again; under this scene
    it goes on with it. `angle` is whole turns, as states are known at angle zero.
    """
    load = scene.load
    if not isinstance(load, RoughFeed):
        return scene
    phases = load.phases + load.places * (load.bandwidth * angle)
    return dataclasses.replace(scene, load=dataclasses.replace(load, phases=phases))
