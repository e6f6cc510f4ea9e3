"""Kinematics and dynamics of toggle and jaw, an open chain from C over B to A.

Its spins are those of toggle and jaw, counterclockwise (theta3 of the paper counts clockwise:
theta3' = -toggle spin). With clearance at C and B it is no chain: the toggle's foot is e_C off C,
the jaw's lower end e_B off the toggle's pin, and each of the two adds what is there.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher.joints import AtJoints
from jaxcrusher.crusher.machine import Machine

# Eccentricities e = pin less bore at the joints (m), or a time derivative of them; that of the main
# joint is not the chain's, and is passed over.
Play = AtJoints[Vector]
NO_PLAY: Play = AtJoints()


class Wrench(eqx.Module):
    """A force and a moment at the mass centre of a body."""

    force: Vector  # N
    moment: Scalar  # N m


class AtJaw(eqx.Module):
    """A force on the jaw at its mass centre S2, and a moment about it."""

    force: Vector  # N
    moment: Scalar | None  # N m; None: none


class InertialForces(eqx.Module):
    """Inertial forces of a moving frame on the bodies, in the frame's axes.

    It holds inertial forces, and by how much the weight differs from that in an upright frame.
    """

    shaft: Wrench
    jaw: Wrench
    toggle: Wrench

    def all(self) -> tuple[Wrench, Wrench, Wrench]:
        """Return those of shaft, jaw and toggle."""
        return self.shaft, self.jaw, self.toggle


class Chain(eqx.Module):
    """Position and velocity of the chain, as unit vectors and spins, and what is loose in it."""

    toggle: Vector  # along C-B, (cos theta3, -sin theta3)
    jaw: Vector  # along B-A, (-sin theta2, cos theta2)
    toggle_spin: Scalar  # -theta3', rad/s
    jaw_spin: Scalar  # theta2', rad/s
    play: Play = NO_PLAY
    play_rate: Play = NO_PLAY


class ChainAcceleration(eqx.Module):
    """Angular accelerations, rad/s2, counterclockwise, and what is loose."""

    toggle: Scalar
    jaw: Scalar
    play: Play = NO_PLAY


def assemble(
    machine: Machine, a: Vector, velocity: Vector, play: Play = NO_PLAY, rate: Play = NO_PLAY
) -> Chain:
    """The chain whose end A is at `a` (m) and moves at `velocity` (m/s).

    A - e_C + e_B is where the end of one without play would be. There B is where
    the circles of radius l3 about C and l2 about A meet: one square root, no trigonometry. The
    spins solve velocity = l3 spin3 perp(C-B) + l2 spin2 perp(B-A).
    """
    l2, l3 = machine.jaw.length, machine.toggle.length
    a, velocity = _less(a, play), _less(velocity, rate)
    distance_squared = a.dot(a)
    share = (distance_squared + l3**2 - l2**2) / (2 * distance_squared)
    height = machine.elbow_side * jnp.sqrt(l3**2 / distance_squared - share**2)
    toggle = (share * a + height * a.perp()) / l3
    jaw = (a - l3 * toggle) / l2
    lever = toggle.cross(jaw)
    spins = velocity.dot(jaw) / (l3 * lever), -velocity.dot(toggle) / (l2 * lever)
    return Chain(toggle, jaw, *spins, play, rate)


def _more(end: Vector, play: Play) -> Vector:
    """The jaw's lower end from the toggle's upper one, by what is loose below it."""
    end = end if play.pivot is None else end + play.pivot
    return end if play.elbow is None else end - play.elbow


def _less(end: Vector, play: Play) -> Vector:
    """The inverse of `_more`."""
    end = end if play.pivot is None else end - play.pivot
    return end if play.elbow is None else end + play.elbow


def _middle(end: Vector, play: Play) -> Vector:
    """The toggle's mass centre from its upper end relative to its foot."""
    return end / 2 if play.pivot is None else end / 2 + play.pivot


def elbow_position(machine: Machine, chain: Chain) -> Vector:
    """B, the jaw's lower end, m; C is the origin."""
    return _more(machine.toggle.length * chain.toggle, chain.play)


def elbow_velocity(machine: Machine, chain: Chain) -> Vector:
    """The velocity of B, m/s."""
    return _more(_swing(machine, chain), chain.play_rate)


def elbow_acceleration(machine: Machine, chain: Chain, acceleration: ChainAcceleration) -> Vector:
    """The acceleration of B, m/s2."""
    return _more(_swinging(machine, chain, acceleration), acceleration.play)


def toggle_centre(machine: Machine, chain: Chain) -> Vector:
    """S3, m."""
    return _middle(machine.toggle.length * chain.toggle, chain.play)


def toggle_centre_velocity(machine: Machine, chain: Chain) -> Vector:
    """The velocity of S3, m/s."""
    return _middle(_swing(machine, chain), chain.play_rate)


def toggle_centre_acceleration(
    machine: Machine, chain: Chain, acceleration: ChainAcceleration
) -> Vector:
    """The acceleration of S3, m/s2."""
    return _middle(_swinging(machine, chain, acceleration), acceleration.play)


def _swing(machine: Machine, chain: Chain) -> Vector:
    """The velocity of the toggle's upper end past its foot, m/s."""
    return machine.toggle.length * chain.toggle_spin * chain.toggle.perp()


def _swinging(machine: Machine, chain: Chain, acceleration: ChainAcceleration) -> Vector:
    """The acceleration of the toggle's upper end past its foot, m/s2."""
    return machine.toggle.length * turning(chain.toggle, chain.toggle_spin, acceleration.toggle)


def turning(arm: Vector, spin: Scalar, acceleration: Scalar | None) -> Vector:
    """The second derivative of a vector fixed in a turning body."""
    centripetal = -(spin**2) * arm
    return centripetal if acceleration is None else acceleration * arm.perp() + centripetal


def mass_centre_arm(machine: Machine, chain: Chain) -> Vector:
    """S2 relative to B, m."""
    return machine.jaw.length * chain.jaw + machine.jaw.mass_centre.along(chain.jaw)


def mass_centre_velocity(machine: Machine, chain: Chain) -> Vector:
    """The velocity of S2, m/s."""
    arm = mass_centre_arm(machine, chain)
    return elbow_velocity(machine, chain) + chain.jaw_spin * arm.perp()


def mass_centre_acceleration(
    machine: Machine, chain: Chain, acceleration: ChainAcceleration
) -> Vector:
    """The acceleration of S2, m/s2."""
    arm = mass_centre_arm(machine, chain)
    return elbow_acceleration(machine, chain, acceleration) + turning(
        arm, chain.jaw_spin, acceleration.jaw
    )


def joint_acceleration(machine: Machine, chain: Chain, acceleration: ChainAcceleration) -> Vector:
    """The acceleration of A, m/s2."""
    return elbow_acceleration(machine, chain, acceleration) + machine.jaw.length * turning(
        chain.jaw, chain.jaw_spin, acceleration.jaw
    )


def chain_acceleration_to_reach(
    machine: Machine, chain: Chain, acceleration: Vector, play: Play = NO_PLAY
) -> ChainAcceleration:
    """The angular accelerations that give A the `acceleration` (m/s2), given those of the play."""
    l2, l3 = machine.jaw.length, machine.toggle.length
    still = jnp.zeros_like(chain.jaw_spin)
    centripetal = joint_acceleration(machine, chain, ChainAcceleration(still, still, play))
    remaining = acceleration - centripetal
    lever = chain.toggle.cross(chain.jaw)
    return ChainAcceleration(
        remaining.dot(chain.jaw) / (l3 * lever), -remaining.dot(chain.toggle) / (l2 * lever), play
    )


class _Equations(eqx.Module):
    """M (toggle'', jaw'') = (toggle_moment, jaw_moment) + what acts at A."""

    toggle_inertia: Scalar
    coupling: Scalar
    jaw_inertia: Scalar
    toggle_moment: Scalar
    jaw_moment: Scalar


def _equations(
    machine: Machine, chain: Chain, applied: AtJaw | None, inertial: InertialForces | None
) -> _Equations:
    """Lagrange's equations of the chain under gravity, what is applied and centrifugal terms."""
    jaw, toggle = machine.jaw, machine.toggle
    arm = mass_centre_arm(machine, chain)
    weight = Vector(0.0, -jaw.mass * machine.gravity)
    at_s2 = weight if applied is None else weight + applied.force
    at_s2 = at_s2 if inertial is None else at_s2 + inertial.jaw.force
    swing = jaw.mass * toggle.length * chain.toggle.cross(arm)
    on_toggle = (
        swing * chain.jaw_spin**2
        + toggle.length * chain.toggle.cross(at_s2)
        - toggle.mass * machine.gravity * toggle.length / 2 * chain.toggle.x
    )
    on_jaw = -swing * chain.toggle_spin**2 + arm.cross(at_s2)
    if applied is not None and applied.moment is not None:
        on_jaw += applied.moment
    if inertial is not None:
        at_s3 = inertial.toggle
        on_toggle += toggle.length / 2 * chain.toggle.cross(at_s3.force) + at_s3.moment
        on_jaw += inertial.jaw.moment
    return _Equations(
        toggle.inertia + (toggle.mass / 4 + jaw.mass) * toggle.length**2,
        jaw.mass * toggle.length * chain.toggle.dot(arm),
        jaw.inertia + jaw.mass * arm.dot(arm),
        on_toggle,
        on_jaw,
    )


def chain_acceleration(
    machine: Machine,
    chain: Chain,
    applied: AtJaw | None,
    force: Vector,
    moment: Scalar | None,
    inertial: InertialForces | None = None,
) -> ChainAcceleration:
    """Forward dynamics without play: force (N) and moment (N m) act at A, `applied` at S2."""
    equations = _equations(machine, chain, applied, inertial)
    on_toggle = equations.toggle_moment + machine.toggle.length * chain.toggle.cross(force)
    on_jaw = equations.jaw_moment + machine.jaw.length * chain.jaw.cross(force)
    if moment is not None:
        on_jaw = on_jaw + moment
    m11, m12, m22 = equations.toggle_inertia, equations.coupling, equations.jaw_inertia
    determinant = m11 * m22 - m12**2
    return ChainAcceleration(
        (m22 * on_toggle - m12 * on_jaw) / determinant,
        (m11 * on_jaw - m12 * on_toggle) / determinant,
    )


def joint_force_for(
    machine: Machine,
    chain: Chain,
    applied: AtJaw | None,
    acceleration: ChainAcceleration,
    inertial: InertialForces | None = None,
) -> Vector:
    """Inverse dynamics: the force (N) on the jaw at A that gives `acceleration`."""
    equations = _equations(machine, chain, applied, inertial)
    on_toggle = (
        equations.toggle_inertia * acceleration.toggle
        + equations.coupling * acceleration.jaw
        - equations.toggle_moment
    ) / machine.toggle.length
    on_jaw = (
        equations.coupling * acceleration.toggle
        + equations.jaw_inertia * acceleration.jaw
        - equations.jaw_moment
    ) / machine.jaw.length
    # toggle x force = on_toggle, jaw x force = on_jaw
    return (on_toggle * chain.jaw - on_jaw * chain.toggle) / chain.toggle.cross(chain.jaw)
