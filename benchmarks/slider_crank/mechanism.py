"""A slider-crank with clearance between rod and slider, as a linkage of `jaxcrusher.mechanism`.

The mechanism of Flores, Ambrosio, Claro and Lankarani, Proc. IMechE K 220 (2006) 21-34, and
Kinematics and Dynamics of Multibody Systems with Imperfect Joints (Springer 2008). The crank
turns about the origin at constant speed, the slider's pin runs along the x axis, y is up. The
bearing is the rod's, the journal is the slider's pin.
"""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Scalar

from jaxcrusher.basics.checks import require_x64
from jaxcrusher.basics.integrate import (
    Carried,
    Integration,
    Outcome,
    Problem,
    failure_text,
    integrate,
    pi_controller,
)
from jaxcrusher.basics.plane import Vector, scalar
from jaxcrusher.joint.clearance import ClearanceJoint, Contact
from jaxcrusher.joint.friction import AbstractFriction
from jaxcrusher.joint.normal import (
    AbstractImpactVelocity,
    LankaraniNikravesh,
    TrackedImpactVelocity,
    cylinder_stiffness,
)
from jaxcrusher.mechanism.arms import Arm
from jaxcrusher.mechanism.drives import ConstantSpeed
from jaxcrusher.mechanism.energies import kinetic_energy, potential_energy
from jaxcrusher.mechanism.linkage import Body, Joint, Linkage, Point, Slide
from jaxcrusher.mechanism.linkage_scene import LinkageScene
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.snapshot import Snapshot
from jaxcrusher.motion.simulation import require_times


class Instant(eqx.Module):
    """One instant of the motion; with an axis of times in every number, the motion."""

    slider_position: Scalar  # m
    slider_acceleration: Scalar  # m/s2
    rod_acceleration: Scalar  # rad/s2
    eccentricity: Vector | None  # e, journal centre - bearing centre, m
    contact: Contact | None
    joint_force: Vector  # on the rod at the bearing, N
    crank_moment: Scalar  # that keeps the speed, N m


class Motion(eqx.Module):
    """Instants at given times, and what was done until then; NaN after a failure."""

    time: Float[Array, " times"]  # s
    instants: Instant
    work: dict[str, Float[Array, " times"]]  # of the drive, less contact's and friction's loss, J
    energy: Float[Array, " times"]  # kinetic, of weight, and elastic, J
    outcome: Outcome

    @property
    def failure(self) -> str:
        """Why and when (s) the integration stopped, or nothing (concrete values only)."""
        return failure_text(self.outcome, "s")


def flores(
    clearance: ArrayLike | None = 0.5e-3,
    impact_velocity: AbstractImpactVelocity | None = None,
    friction: AbstractFriction | None = None,
    gravity: ArrayLike = 0.0,
) -> LinkageScene:
    """Return the mechanism of Flores and co-workers; `clearance` in m, None for the ideal joint.

    Bore of radius 10 mm, steel (207 GPa, 0.3), Lankarani-Nikravesh with restitution 0.9, no
    friction. Gravity would be 0.05 % of the slider's 19 400 m/s2. `impact_velocity` None is
    each impact's own, as in the source, tracked with a lag of the relaxation time times the
    acceleration: 0.1 us lag by 0.002 m/s of 4 m/s, the crusher's default would by 2 m/s.

    The papers were not at hand: the numbers are those that later ones repeat, and the rod's
    inertia is a slender rod's, m l^2 / 12 = 2.52e-4 kg m2, in two digits. The slider does not turn:
    its inertia does not matter.
    """
    bearings = {}
    if clearance is not None:
        stiffness = cylinder_stiffness(0.01, clearance, poisson=0.3)
        tracked = TrackedImpactVelocity(relaxation_time=1e-7)
        law = LankaraniNikravesh(
            stiffness=stiffness,
            restitution=0.9,
            impact_velocity=tracked if impact_velocity is None else impact_velocity,
        )
        bearings["wrist"] = ClearanceJoint(0.01, clearance, law, friction)
    bodies = {
        "crank": Body(0.30, 1e-4, Arm(0.025)),
        "rod": Body(0.21, 2.5e-4, Arm(0.06)),
        "slider": Body(0.14, 1e-4),
    }
    joints = {
        "base": Joint(bore=Point("frame"), pin=Point("crank")),
        "big end": Joint(bore=Point("rod"), pin=Point("crank", Arm(0.05))),
        "wrist": Joint(bore=Point("rod", Arm(0.12)), pin=Point("slider")),
    }
    slides = {"guide": Slide("slider", along=Vector(1.0, 0.0))}
    drawn = Linkage(
        Named(bodies), Named(joints), "crank", "base", (1,), gravity, slides=Named(slides)
    )
    drive = ConstantSpeed(5000 * 2 * np.pi / 60)
    return LinkageScene(drawn=drawn, bearings=Named(bearings), drive=drive)


def instant(s: Snapshot) -> Instant:
    """Return what is told of an instant."""
    found = s.accelerations
    slider, rod_acceleration = found.centres["slider"], found.spin_ups["rod"]
    force = found.forces["wrist"]
    assert slider is not None and rod_acceleration is not None and force is not None
    return Instant(
        s.motion.centre("slider").x,
        slider.x,
        rod_acceleration,
        s.motion.eccentricities["wrist"],
        s.contacts["wrist"],
        force,
        found.torque,
    )


def energy(s: Snapshot, mechanism: LinkageScene) -> Scalar:
    """Return kinetic, potential and elastic energy, J."""
    stored = kinetic_energy(s, mechanism) + potential_energy(s, mechanism)
    elastic = mechanism.joints.map(lambda joint, at: joint.elastic_energy(at), s.contacts)
    return sum(elastic.values, stored)


def powers(s: Snapshot) -> dict[str, Scalar]:
    """Return the powers that change the energy, W."""
    found = {"drive": s.accelerations.torque * s.motion.crank.speed}
    for contact in s.contacts.values:
        found["contact"] = -contact.normal_loss
        if contact.friction_loss is not None:
            found["friction"] = -contact.friction_loss
    return found


def _initial(mechanism: LinkageScene) -> Carried:
    state = mechanism.formulation.initial(mechanism)
    done = powers(mechanism.formulation.snapshot(jnp.zeros(()), state, mechanism))
    return Carried(state, jax.tree.map(jnp.zeros_like, done))


def _field(time: Scalar, y: Carried, mechanism: LinkageScene) -> Carried:
    s = mechanism.formulation.snapshot(time, y.motion, mechanism)
    return Carried(mechanism.formulation.rate(s, y.motion, mechanism), powers(s))


def _observe(time: Scalar, y: Carried, mechanism: LinkageScene) -> tuple:
    s = mechanism.formulation.snapshot(time, y.motion, mechanism)
    return instant(s), y.totals, energy(s, mechanism)


PROBLEM = Problem(_initial, _field, _observe, lambda observed, end: observed)


def simulate(mechanism: LinkageScene, times: ArrayLike, rtol: float = 1e-10) -> Motion:
    """Integrate to `times` (s, increasing) to a tolerance in clearances and m/s.

    Differentiable by every number of the mechanism: see `jaxcrusher.basics.integrate`.
    """
    require_x64()
    require_times(times)
    return _simulate(mechanism, jnp.asarray(times, dtype=float), scalar(rtol))


@eqx.filter_jit
def _simulate(mechanism: LinkageScene, times: Array, rtol: Scalar) -> Motion:
    controller = pi_controller(rtol, smallest=1e-15)
    method = Integration(diffrax.Tsit5(), controller, 10_000_000, 1e-7, None)
    seen, outcome = integrate(mechanism, times[None], problem=PROBLEM, method=method)
    instants, work, stored = jax.tree.map(lambda leaf: leaf[0], seen)
    return Motion(times, instants, work, stored, outcome)


def joint_load(motion: Motion) -> np.ndarray:
    """Return the length of the force between rod and slider, N."""
    force = motion.instants.joint_force
    return np.hypot(force.x, force.y)
