"""A slider-crank with clearance between rod and slider: the joint of this package elsewhere.

The mechanism of Flores, Ambrosio, Claro and Lankarani, Proc. IMechE K 220 (2006) 21-34, and
Kinematics and Dynamics of Multibody Systems with Imperfect Joints (Springer 2008). The crank
turns about the origin at constant speed, the slider's pin runs along the x axis, y is up. The
bearing is the rod's, the journal is the slider's pin. Joint, contact and friction laws,
integration, tangents and failures are those of `jaxcrusher`, which knows no slider-crank.
"""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, PyTree, Scalar

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
from jaxcrusher.basics.plane import Vector, direction, scalar
from jaxcrusher.joint.clearance import ClearanceJoint, Contact
from jaxcrusher.joint.friction import AbstractFriction
from jaxcrusher.joint.normal import (
    AbstractImpactVelocity,
    LankaraniNikravesh,
    TrackedImpactVelocity,
    cylinder_stiffness,
)
from jaxcrusher.mechanism.eccentricity import JointState
from jaxcrusher.motion.simulation import require_times


class Link(eqx.Module):
    """A bar with its mass centre in its middle."""

    mass: Scalar = eqx.field(converter=scalar)  # kg
    inertia: Scalar = eqx.field(converter=scalar)  # about the mass centre, kg m2
    length: Scalar = eqx.field(converter=scalar)  # m


class SliderCrank(eqx.Module):
    """Crank, rod and slider; `joint` between rod and slider, None for an ideal one."""

    crank: Link
    rod: Link
    slider_mass: Scalar = eqx.field(converter=scalar)  # kg
    speed: Scalar = eqx.field(converter=scalar)  # omega, rad/s
    gravity: Scalar = eqx.field(converter=scalar)  # downwards, m/s2
    joint: ClearanceJoint | None


class Instant(eqx.Module):
    """One instant of the motion; with an axis of times in every number, the motion."""

    crank: Vector  # unit, from the frame to the crank pin
    rod: Vector  # unit, from the crank pin to the bearing
    rod_spin: Scalar  # rad/s
    rod_acceleration: Scalar  # rad/s2
    slider_position: Scalar  # m
    slider_speed: Scalar  # m/s
    slider_acceleration: Scalar  # m/s2
    eccentricity: Vector  # e, journal centre - bearing centre, m
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
) -> SliderCrank:
    """Return the mechanism of Flores and co-workers; `clearance` in m, None for the ideal joint.

    Bore of radius 10 mm, steel (207 GPa, 0.3), Lankarani-Nikravesh with restitution 0.9, no
    friction. Gravity would be 0.05 % of the slider's 19 400 m/s2. `impact_velocity` None is
    each impact's own, as in the source, tracked with a lag of the relaxation time times the
    acceleration: 0.1 us lag by 0.002 m/s of 4 m/s, the crusher's default would by 2 m/s.

    The papers were not at hand: the numbers are those that later ones repeat, and the rod's
    inertia is a slender rod's, m l^2 / 12 = 2.52e-4 kg m2, in two digits.
    """
    joint = None
    if clearance is not None:
        stiffness = cylinder_stiffness(0.01, clearance, poisson=0.3)
        tracked = TrackedImpactVelocity(relaxation_time=1e-7)
        law = LankaraniNikravesh(
            stiffness=stiffness,
            restitution=0.9,
            impact_velocity=tracked if impact_velocity is None else impact_velocity,
        )
        joint = ClearanceJoint(0.01, clearance, law, friction)
    return SliderCrank(
        crank=Link(0.30, 1e-4, 0.05),
        rod=Link(0.21, 2.5e-4, 0.12),
        slider_mass=0.14,
        speed=5000 * 2 * np.pi / 60,
        gravity=gravity,
        joint=joint,
    )


def turning(arm: Vector, spin: Scalar, acceleration: Scalar | None) -> Vector:
    """Return the second derivative of a vector fixed in a turning body."""
    centripetal = -(spin**2) * arm
    return centripetal if acceleration is None else acceleration * arm.perp() + centripetal


def initial(mechanism: SliderCrank) -> JointState | None:
    """Start with crank and rod in one line, the ideal joint's velocities, centres together."""
    if mechanism.joint is None:
        return None
    zero = Vector(0.0, 0.0)
    return JointState(zero, zero, mechanism.joint.normal.impact_velocity.initial())


def instant(time: Scalar, state: JointState | None, mechanism: SliderCrank) -> Instant:
    """Solve forward dynamics with clearance, kinematics and then forces without.

    The rod's end is at the journal less e, and the journal on the x axis: the rod's sine is
    -(A_y + e_y) / l, its cosine a square root, and no angle but omega t is needed.
    """
    m, rod, joint = mechanism, mechanism.rod, mechanism.joint
    crank = direction(m.speed * time)
    pin = m.crank.length * crank
    pin_velocity = m.crank.length * m.speed * crank.perp()
    pin_acceleration = m.crank.length * turning(crank, m.speed, None)
    still = Vector(0.0, 0.0)
    e, e_rate = still, still
    if joint is not None and state is not None:
        e, e_rate = joint.clearance * state.relative_eccentricity, state.rate
    sine = -(pin.y + e.y) / rod.length
    u = Vector(jnp.sqrt(1 - sine**2), sine)
    spin = -(pin_velocity.y + e_rate.y) / (rod.length * u.x)
    speed = pin_velocity.x - rod.length * spin * u.y + e_rate.x
    # About the crank pin: inertia * rod'' = inertial + l u x F + the contact's moment.
    inertia = rod.inertia + rod.mass * rod.length**2 / 4
    weight = Vector(0.0, -rod.mass * m.gravity)
    inertial = rod.length / 2 * u.cross(weight - rod.mass * pin_acceleration)
    if joint is None or state is None:
        contact = None
        # The bearing stays on the x axis: no acceleration along y.
        turn = (rod.length * spin**2 * u.y - pin_acceleration.y) / (rod.length * u.x)
        slider = (pin_acceleration + rod.length * turning(u, spin, turn)).x
        push = -m.slider_mass * slider
        moment = (inertia * turn - inertial) / rod.length
        force = Vector(push, (moment + u.y * push) / u.x)
    else:
        contact = joint.contact(e, e_rate, spin, jnp.zeros_like(spin), state.impact_velocity)
        force = contact.force
        moment = inertial + rod.length * u.cross(force)
        if contact.bearing_moment is not None:
            moment = moment + contact.bearing_moment
        turn, slider = moment / inertia, -force.x / m.slider_mass
    centre = pin_acceleration + rod.length / 2 * turning(u, spin, turn)
    at_pin = rod.mass * centre - weight - force
    crank_weight = Vector(0.0, -m.crank.mass * m.gravity)
    crank_moment = pin.cross(at_pin) - 0.5 * pin.cross(crank_weight)
    position = pin.x + rod.length * u.x + e.x
    return Instant(crank, u, spin, turn, position, speed, slider, e, contact, force, crank_moment)


def rate(now: Instant, state: JointState, mechanism: SliderCrank) -> JointState:
    """Return the rate by e'': the slider's acceleration less the bearing's."""
    m, joint = mechanism, mechanism.joint
    assert joint is not None and now.contact is not None
    bearing = m.crank.length * turning(now.crank, m.speed, None)
    bearing = bearing + m.rod.length * turning(now.rod, now.rod_spin, now.rod_acceleration)
    return JointState(
        state.rate / joint.clearance,
        Vector(now.slider_acceleration, jnp.zeros_like(bearing.y)) - bearing,
        joint.memory_rate(now.contact, state.impact_velocity),
    )


def energy(now: Instant, mechanism: SliderCrank) -> Scalar:
    """Return kinetic (without the crank's constant), potential and elastic energy, J."""
    m = mechanism
    pin, half = m.crank.length * now.crank, m.rod.length / 2 * now.rod
    velocity = m.speed * pin.perp() + now.rod_spin * half.perp()
    kinetic = m.rod.mass * velocity.dot(velocity) + m.rod.inertia * now.rod_spin**2
    kinetic = 0.5 * (kinetic + m.slider_mass * now.slider_speed**2)
    height = m.crank.mass * pin.y / 2 + m.rod.mass * (pin + half).y
    stored = kinetic + m.gravity * height
    if m.joint is None or now.contact is None:
        return stored
    return stored + m.joint.elastic_energy(now.contact)


def powers(now: Instant, mechanism: SliderCrank) -> dict[str, Scalar]:
    """Return the powers that change the energy, W."""
    found = {"drive": now.crank_moment * mechanism.speed}
    if mechanism.joint is not None and now.contact is not None:
        found["contact"] = -now.contact.normal_loss
        friction = now.contact.friction_loss
        if friction is not None:
            found["friction"] = -friction
    return found


def _initial(mechanism: SliderCrank) -> Carried:
    state = initial(mechanism)
    if state is None:
        return Carried(None, {})
    done = powers(instant(jnp.zeros(()), state, mechanism), mechanism)
    return Carried(state, jax.tree.map(jnp.zeros_like, done))


def _field(time: Scalar, y: Carried, mechanism: SliderCrank) -> Carried:
    now = instant(time, y.motion, mechanism)
    return Carried(rate(now, y.motion, mechanism), powers(now, mechanism))


def _observe(time: Scalar, y: Carried, mechanism: SliderCrank) -> PyTree:
    now = instant(time, y.motion, mechanism)
    return now, y.totals, energy(now, mechanism)


PROBLEM = Problem(_initial, _field, _observe, lambda observed, end: observed)


def simulate(mechanism: SliderCrank, times: ArrayLike, rtol: float = 1e-10) -> Motion:
    """Integrate to `times` (s, increasing) to a tolerance in clearances and m/s.

    Differentiable by every number of the mechanism: see `jaxcrusher.basics.integrate`.
    """
    require_x64()
    require_times(times)
    return _simulate(mechanism, jnp.asarray(times, dtype=float), scalar(rtol))


@eqx.filter_jit
def _simulate(mechanism: SliderCrank, times: Array, rtol: Scalar) -> Motion:
    controller = pi_controller(rtol, smallest=1e-15)
    method = Integration(diffrax.Tsit5(), controller, 10_000_000, 1e-7, None)
    seen, outcome = integrate(mechanism, times[None], problem=PROBLEM, method=method)
    instants, work, stored = jax.tree.map(lambda leaf: leaf[0], seen)
    return Motion(times, instants, work, stored, outcome)


def joint_load(motion: Motion) -> np.ndarray:
    """Return the length of the force between rod and slider, N."""
    force = motion.instants.joint_force
    return np.hypot(force.x, force.y)
