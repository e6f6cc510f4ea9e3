"""Formulations that the paper prints but mechanics forbids, and its own solver's tolerances.

The search asks which of them leads to the paper's numbers that correct mechanics does not give.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree, Scalar

from jaxcrusher.basics.plane import Vector, scalar
from jaxcrusher.basics.smooth import norm
from jaxcrusher.joint.friction import AbstractSlip
from jaxcrusher.mechanism.eccentricity import EccentricityFormulation, EccentricityState
from jaxcrusher.mechanism.equations import solve
from jaxcrusher.mechanism.forces import wrenches_of
from jaxcrusher.mechanism.multiplier import CONTACT_TIME, MultiplierFormulation, MultiplierState
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.scene import AbstractFormulation, AbstractScene
from jaxcrusher.mechanism.snapshot import Snapshot
from jaxcrusher.motion.integrate import Carried


class WeightedSlip(AbstractSlip):
    """Weight 0 is the slip of the centres, 1 that of the surfaces: both in one program."""

    weight: Scalar = eqx.field(converter=scalar)

    def speed(self, centre_speed: Scalar, surface_speed: Scalar) -> Scalar:
        """Return a speed between the two."""
        return centre_speed + self.weight * (surface_speed - centre_speed)


class LiteralContact(AbstractFormulation):
    """The eccentricity formulation with the contact's forces as (16) and (19) print them.

    Force on the jaw: (x_sign (F_n cos phi - F_t sin phi), y_sign (F_n sin phi + F_t cos phi)).
    Correct signs are (1, 1); (16) with (19) gives (-1, 1), and (1, -1) if F is added instead of
    subtracted. `folded` 1 takes phi from (3), in [0, pi], so that sin phi >= 0. `at_joint` 0
    lets the force act at S2, for (19) has no moments; `torque` is the share of friction's R_i
    F_t on the jaw. The ones and zeros are numbers so that all variants are one program.
    """

    x_sign: Scalar = eqx.field(converter=scalar, default=1.0)
    y_sign: Scalar = eqx.field(converter=scalar, default=1.0)
    folded: Scalar = eqx.field(converter=scalar, default=0.0)
    at_joint: Scalar = eqx.field(converter=scalar, default=1.0)
    torque: Scalar = eqx.field(converter=scalar, default=1.0)

    def initial(self, scene: AbstractScene) -> EccentricityState:
        """Do as the correct formulation does."""
        return EccentricityFormulation().initial(scene)

    def snapshot(self, time: Scalar, state: EccentricityState, scene: AbstractScene) -> Snapshot:
        """Return the correct snapshot with the contact's force and moment replaced."""
        s = EccentricityFormulation().snapshot(time, state, scene)
        contact, eccentricity = s.contacts["main"], s.motion.eccentricities["main"]
        joint = scene.joints["main"]
        assert joint is not None and contact is not None and eccentricity is not None
        friction = contact.friction_force
        assert friction is not None and contact.bearing_moment is not None
        axis = eccentricity / norm(eccentricity, joint.norm_width)
        axis = Vector(axis.x, jnp.where(self.folded > 0, jnp.abs(axis.y), axis.y))
        push = contact.normal_force * axis + friction * axis.perp()
        force = Vector(self.x_sign * push.x, self.y_sign * push.y)
        jaw = scene.linkage.body("jaw").mass_centre
        from_s2 = -jaw.vector().along(s.motion.axis("jaw"))
        moment = self.torque * contact.bearing_moment - (1 - self.at_joint) * from_s2.cross(force)
        printed = Named({"main": dataclasses.replace(contact, force=force, bearing_moment=moment)})
        wrenches, gravity, _ = wrenches_of(scene, s.applied, None)
        found = solve(s.motion, wrenches, printed, None, gravity)
        return dataclasses.replace(s, accelerations=found)

    def rate(
        self, snapshot: Snapshot, state: EccentricityState, scene: AbstractScene
    ) -> EccentricityState:
        """Do as the correct formulation does."""
        return EccentricityFormulation().rate(snapshot, state, scene)

    def unwound(self, state: EccentricityState) -> EccentricityState:
        """Do as the correct formulation does."""
        return EccentricityFormulation().unwound(state)

    def tolerance(self, scene: AbstractScene, rtol: Scalar | float) -> Scalar | float:
        """Do as the correct formulation does."""
        return EccentricityFormulation().tolerance(scene, rtol)


class PlainUnits(AbstractFormulation):
    """The paper's nine coordinates with velocities in m/s and rad/s, as a program of 2022 has
    them: so a solver's tolerances mean what they meant there.
    """  # noqa: D205

    multiplier: MultiplierFormulation = eqx.field(default_factory=MultiplierFormulation)

    def initial(self, scene: AbstractScene) -> MultiplierState:
        """Return the state at the scene's start."""
        return _rescaled(self.multiplier.initial(scene), 1 / CONTACT_TIME)

    def snapshot(self, time: Scalar, state: MultiplierState, scene: AbstractScene) -> Snapshot:
        """Do as the multiplier formulation does."""
        return self.multiplier.snapshot(time, _rescaled(state, CONTACT_TIME), scene)

    def rate(
        self, snapshot: Snapshot, state: MultiplierState, scene: AbstractScene
    ) -> MultiplierState:
        """Return the derivatives q' and q'', per second."""
        inner = self.multiplier.rate(snapshot, _rescaled(state, CONTACT_TIME), scene)
        return _rescaled(inner, 1 / CONTACT_TIME)

    def unwound(self, state: MultiplierState) -> MultiplierState:
        """Do as the multiplier formulation does."""
        return self.multiplier.unwound(state)

    def tolerance(self, scene: AbstractScene, rtol: Scalar | float) -> Scalar | float:
        """Return `rtol`, not adapted to the clearance."""
        return rtol


def _rescaled(state: MultiplierState, factor: float) -> MultiplierState:
    velocity = state.velocity.map(lambda one: one * factor)
    return MultiplierState(state.position, velocity, state.impact_velocities)


def largest(error: PyTree) -> Scalar:
    """Return the error norm of MATLAB's ode45: the largest entry; totals do not count."""
    motion = error.motion if isinstance(error, Carried) else error
    return jnp.max(jnp.stack([jnp.max(jnp.abs(leaf)) for leaf in jax.tree.leaves(motion)]))
