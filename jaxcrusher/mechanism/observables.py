"""Observables of an instant of any linkage: forces, powers, energies, by its snapshot."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
from jax.lax import stop_gradient
from jaxtyping import Scalar

from jaxcrusher.basics.checks import require_own_process, require_positive
from jaxcrusher.basics.plane import Vector, arm_to, or_zero, plus
from jaxcrusher.basics.smooth import norm
from jaxcrusher.joint.clearance import AbstractGap, ClearanceJoint, Contact
from jaxcrusher.joint.rollers import LIFE_EXPONENT, RollerBearing
from jaxcrusher.mechanism.linkage import Point
from jaxcrusher.mechanism.snapshot import FrameMotion, Observable, OfPart, Snapshot
from jaxcrusher.mechanism.supports import OnSupports
from jaxcrusher.mechanism.topology import FRAME

if TYPE_CHECKING:
    from jaxcrusher.mechanism.scene import Scene
else:
    Scene = Any  # whose tables hold these functions

# Smooths a length where it vanishes: a share of what a machine's own size and speed make of it, so
# that numbers of a small machine are right as those of a large one.
WIDTH = 1e-10
# The same of the speed of a frame, which stiff supports make small.
SPEED_WIDTH = 1e-12


def acceleration_width(scene: Scene) -> Scalar:
    """Return a small share of the acceleration of the crank's pin, m/s2, without slopes."""
    return stop_gradient(WIDTH * scene.throw * scene.drive.speed**2)


def force_width(s: Snapshot, scene: Scene) -> Scalar:
    """Return the force that gives all bodies the `acceleration_width`, N."""
    return stop_gradient(s.motion.linkage.mass) * acceleration_width(scene)


def on_bore(s: Snapshot, scene: Scene, joint: str) -> Vector:
    """Return the force on the bore of a joint, N."""
    return s.accelerations.forces.at(joint)


def shaking_force(s: Snapshot, scene: Scene) -> Vector:
    """Return -sum of m a, N: the moving part of what the bodies pass to the frame.

    The load closes inside the machine, as a crusher's between jaw and fixed jaw, and the weight
    stands still: neither shakes.
    """
    one, *others = (rate for _, rate in _momentum_rates(s, scene))
    total = -sum(others, one)
    return total if s.frame is None else total.along(s.frame.axis)


def _momentum_rates(s: Snapshot, scene: Scene) -> list[tuple[str, Vector]]:
    """Return mass times acceleration of each body, in the frame's axes, N."""
    centres, bodies = s.accelerations.centres, scene.linkage.bodies.items()
    return [(name, body.mass * centres.at(name)) for name, body in bodies]


def shaking_size(s: Snapshot, scene: Scene) -> Scalar:
    """Return the length of the shaking force, N."""
    return norm(shaking_force(s, scene), force_width(s, scene))


def ground_force(s: Snapshot, scene: Scene) -> Vector:
    """Return the force of the bodies on the frame, N: their weight less sum of m a.

    A clamped frame passes it to the ground. Of a crusher it equals -(R_O + R_C) less the load on
    the jaw, whose reaction the fixed jaw carries.
    """
    weight = Vector(0.0, -scene.linkage.mass * scene.linkage.gravity)
    return shaking_force(s, scene) + weight


def ground_moment(s: Snapshot, scene: Scene) -> Scalar:
    """Return the moment of the bodies on the frame, N m, about the foundation's point.

    Each body adds (r - p) x m (g - a) - J alpha; without a foundation p is the origin, a crusher's
    C. A load and its reaction on the frame lie in one line and add nothing, nor does a drive that
    stands on the frame.
    """
    fall = Vector(0.0, -scene.linkage.gravity)
    fall = fall if s.frame is None else fall.seen_from(s.frame.axis)
    spin_ups = s.accelerations.spin_ups.at
    return _moment(s, scene, fall, _momentum_rates(s, scene), spin_ups)


def _moment(
    s: Snapshot,
    scene: Scene,
    fall: Vector,
    rates: list[tuple[str, Vector]],
    spin_up: Callable[[str], Scalar],
) -> Scalar:
    """Return the sum of (r - p) x (m fall - rate) - J spin_up, N m."""
    point = Vector(0.0, 0.0) if scene.foundation is None else scene.foundation.point
    total = jnp.zeros_like(s.motion.crank.speed)
    for name, rate in rates:
        body = scene.linkage.bodies.at(name)
        force = body.mass * fall - rate
        total = total + (s.motion.centre(name) - point).cross(force) - body.inertia * spin_up(name)
    return total


def drive_torque(s: Snapshot, scene: Scene) -> Scalar:
    """M0, counterclockwise on the shaft, N m."""
    return s.accelerations.torque


def drive_power(s: Snapshot, scene: Scene) -> Scalar:
    """M0 times the shaft's speed, W."""
    return drive_torque(s, scene) * s.motion.crank.speed


def crank_speed(s: Snapshot, scene: Scene) -> Scalar:
    """Return the speed of the crank, rad/s."""
    return s.motion.crank.speed


def contact_loss(s: Snapshot, scene: Scene) -> Scalar:
    """Power dissipated by the damping of the contact, W."""
    return _over_joints(lambda _, contact: contact.normal_loss, s, scene)


def friction_loss(s: Snapshot, scene: Scene) -> Scalar:
    """Power dissipated by friction, W; may be negative where slip is that of the centres."""
    lost = _over_joints(lambda _, contact: contact.friction_loss, s, scene)
    for name in scene.guides.names:
        slide, friction = scene.linkage.slides.at(name), s.accelerations.slides.at(name).friction
        assert friction is not None, "a guide with friction tells it"
        lost = lost + friction * slide.direction.dot(s.motion.velocity(slide.ends.pin))
    return lost


def _over_joints(
    part: Callable[[AbstractGap, Contact], Scalar | None], s: Snapshot, scene: Scene
) -> Scalar:
    """The sum of a number of each contact; zero where there is none."""
    known = scene.joints.map(part, s.contacts).values
    return sum(known, jnp.zeros_like(s.motion.crank.speed))


def elastic_energy(s: Snapshot, scene: Scene) -> Scalar:
    """Stored in the contacts, in springs at the bodies and in those of the supports, J."""
    stored = _over_joints(lambda one, contact: one.elastic_energy(contact), s, scene)
    stored = sum((spring.energy for spring in s.applied.springs), stored)
    if s.frame is None or scene.supports is None:
        return stored
    return stored + scene.supports.elastic_energy(s.frame)


def force_at(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    """The length of the force in a joint, N."""
    return norm(on_bore(s, scene, joint), force_width(s, scene))


def _normal_force(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    contact = s.contacts[joint]
    return force_at(s, scene, joint) if contact is None else contact.normal_force


def _friction_force(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    contact = s.contacts[joint]
    force = None if contact is None else contact.friction_force
    return jnp.zeros_like(s.motion.crank.speed) if force is None else force


def _eccentricity(s: Snapshot, scene: Scene, joint: str) -> Vector:
    return or_zero(s.motion.eccentricities[joint])


def _penetration_ratio(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    contact, clearance = s.contacts[joint], scene.joints[joint]
    if contact is None:
        return jnp.zeros_like(s.motion.crank.speed)
    return contact.penetration / clearance.clearance


def _penetration_rate(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    contact = s.contacts[joint]
    return jnp.zeros_like(s.motion.crank.speed) if contact is None else contact.penetration_rate


def approach(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    """Return the fastest approach of pin and bore, of a slider that of its corners, m/s."""
    contact = s.contacts[joint]
    return jnp.zeros_like(s.motion.crank.speed) if contact is None else contact.approach


def constraint_residual(s: Snapshot, scene: Scene) -> Scalar:
    """Return the largest gap of the joints that are held together, m or rad."""
    found = s.accelerations.residual
    return jnp.zeros_like(s.motion.crank.speed) if found is None else found


def _on_supports(s: Snapshot, scene: Scene) -> tuple[FrameMotion, OnSupports]:
    """Return the frame's motion and its supports, of a scene that has some."""
    assert s.frame is not None and scene.supports is not None, "the frame is clamped"
    return s.frame, scene.supports


def support_loss(s: Snapshot, scene: Scene) -> Scalar:
    """Power that the dampers of the supports take, W."""
    frame, foundation = _on_supports(s, scene)
    return foundation.loss(frame)


def support_force(s: Snapshot, scene: Scene, side: str) -> Vector:
    """Return the force of the left or the right support on the ground, N."""
    frame, foundation = _on_supports(s, scene)
    left, right = foundation.support_forces(frame)
    return left if side == "left" else right


def transmitted_force(s: Snapshot, scene: Scene) -> Vector:
    """Return the force of both supports on the ground, N."""
    frame, foundation = _on_supports(s, scene)
    left, right = foundation.support_forces(frame)
    return left + right


def _past_frame(s: Snapshot, scene: Scene) -> list[tuple[str, Vector]]:
    """Return mass times acceleration past the frame of each body, in the frame's axes, N."""
    frame, foundation = _on_supports(s, scene)
    origin, spin_up = s.accelerations.centres.at(FRAME), s.accelerations.spin_ups.at(FRAME)
    found = []
    for name, rate in _momentum_rates(s, scene):
        arm, velocity = s.motion.centre(name) - foundation.point, s.motion.centre_velocity(name)
        # Of the point of the frame where the body is, and Coriolis'.
        carried = origin + spin_up * arm.perp() - frame.spin**2 * arm
        carried = carried + 2 * frame.spin * velocity.perp()
        found.append((name, rate - scene.linkage.bodies.at(name).mass * carried))
    return found


def exciting_force(s: Snapshot, scene: Scene) -> Vector:
    """Return -sum of m a of the bodies relative to the frame, N: the force on a frame at rest.

    With a_i = a_G + (terms of the frame's rotation) + (the acceleration relative to the frame),
    Newton's law for frame and bodies together has the first two terms in the mass matrix of the
    whole machine on its block. The third gives this force, which excites that model. It does not
    include the weight, whose mean the springs carry.
    """
    one, *others = (rate for _, rate in _past_frame(s, scene))
    return -sum(others, one)


def exciting_moment(s: Snapshot, scene: Scene) -> Scalar:
    """Return the moment about G that excites a frame, N m, as `exciting_force` does.

    It includes weights that the mechanism moves to and fro, on a frame that stands as drawn.
    """
    fall = Vector(0.0, -scene.linkage.gravity)
    return _moment(s, scene, fall, _past_frame(s, scene), s.accelerations.past_frame)


def _of_frame(s: Snapshot, scene: Scene, part: str) -> Vector | Scalar:
    """Return a part of the frame's motion by its name in `FrameMotion`."""
    return getattr(_on_supports(s, scene)[0], part)


def transmitted_size(s: Snapshot, scene: Scene) -> Scalar:
    """Return the length of what moves of the force on the ground, N: all but the weight."""
    _, foundation = _on_supports(s, scene)
    weight = Vector(0.0, -(foundation.mass + scene.linkage.mass) * scene.linkage.gravity)
    return norm(transmitted_force(s, scene) - weight, force_width(s, scene))


def support_size(s: Snapshot, scene: Scene, side: str) -> Scalar:
    """Return the length of the force of a support, N."""
    return norm(support_force(s, scene, side), force_width(s, scene))


def frame_speed(s: Snapshot, scene: Scene) -> Scalar:
    """Return the speed of G, m/s."""
    width = stop_gradient(SPEED_WIDTH * scene.throw * scene.drive.speed)
    return norm(_on_supports(s, scene)[0].velocity, width)


def velocity_at(s: Snapshot, scene: Scene, point: Point) -> Vector:
    """Return v_G + spin perp(r - r_G) + (the velocity relative to the frame) of a point, m/s.

    It is relative to the ground, in the ground's axes, as a sensor there shows it.
    """
    past = s.motion.velocity(point)
    if s.frame is None:
        return past
    frame, foundation = _on_supports(s, scene)
    arm = s.motion.position(point) - foundation.point
    return frame.velocity + (frame.spin * arm.perp() + past).along(frame.axis)


def acceleration_at(s: Snapshot, scene: Scene, point: Point) -> Vector:
    """Return r_S'' + phi'' perp(arm) - phi'^2 arm of a point from its body's mass centre, m/s2.

    It is relative to the ground, in the ground's axes, as a sensor shows it, but for its tilt.
    """
    if point.body == FRAME:
        middle = arm_to(_on_supports(s, scene)[1].point)
    else:
        middle = scene.linkage.bodies.at(point.body).mass_centre
    found, arm = s.accelerations.centres.at(point.body), point.arm - middle
    if (arm := arm.along(s.motion.axis(point.body))) is not None:
        spin = plus(s.motion.spin(point.body), None if s.frame is None else s.frame.spin)
        spin_up = s.accelerations.spin_ups[point.body]
        turned = None if spin_up is None else spin_up * arm.perp()
        inward = None if spin is None else -(spin**2) * arm
        found = found + or_zero(plus(turned, inward))
    return found if s.frame is None else found.along(s.frame.axis)


def point_velocity(s: Snapshot, scene: Scene, name: str) -> Vector:
    """Return the velocity of a point by its name, or of a body's mass centre, as `velocity_at`."""
    return velocity_at(s, scene, scene.point(name))


def point_acceleration(s: Snapshot, scene: Scene, name: str) -> Vector:
    """Return the acceleration of a point by its name, or of a body's mass centre."""
    return acceleration_at(s, scene, scene.point(name))


def cap_velocity(s: Snapshot, scene: Scene, joint: str) -> Vector:
    """Return the velocity of a bearing's cap: of the body with the bore, at its centre, m/s."""
    return velocity_at(s, scene, scene.linkage.joints.at(joint).bore)


def cap_acceleration(s: Snapshot, scene: Scene, joint: str) -> Vector:
    """Return the acceleration of a bearing's cap, m/s2."""
    return acceleration_at(s, scene, scene.linkage.joints.at(joint).bore)


# What the eccentricity of a joint is.
PIN = "eccentricity of the pin"


def observables_at(joint: str, prefix: str, place: str, play: str) -> dict[str, Observable]:
    """Return the observables of a joint, with its prefix before their names."""
    return {
        prefix + name: Observable(OfPart(function, joint), unit, f"{meaning} at {place}")
        for name, function, unit, meaning in (
            ("normal_force", _normal_force, "N", "normal force"),
            ("friction_force", _friction_force, "N", "friction force"),
            ("eccentricity", _eccentricity, "m", play),
            ("penetration_ratio", _penetration_ratio, "1", "penetration / clearance"),
            ("penetration_rate", _penetration_rate, "m/s", "penetration rate"),
        )
    }


# Turns that a bearing at its dynamic rating lasts (ISO 281), and seconds an hour.
RATED_TURNS, HOUR = 1e6, 3600.0


def bearing_stiffness(scene: Scene, force: float | Scalar, joint: str | None = None) -> Scalar:
    """Return dF/de of a joint at rest under a force (N, > 0), N/m.

    Without a name it is the joint of `Scene.joint_looked_at`. Raises ValueError for an ideal joint.
    """
    require_own_process()
    require_positive("force", force, "N")
    law = scene.joints.at(scene.joint_looked_at(joint)).normal
    return jax.grad(law.elastic_force)(law.penetration_under(jnp.asarray(force, float)))


def stiffness_now(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    """Return dF/de of a joint with clearance where its pin is, N/m."""
    normal = scene.joints.at(joint).normal
    return jax.grad(normal.elastic_force)(s.contacts.at(joint).penetration)


def _rollers(scene: Scene, joint: str) -> RollerBearing:
    bearing = scene.joints[joint]
    assert isinstance(bearing, RollerBearing), f"no rollers at {joint}"
    return bearing


def film_ratio(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    """Return the film's thickness at a joint over the least one; negative in contact."""
    bearing = scene.joints[joint]
    assert isinstance(bearing, ClearanceJoint) and bearing.film is not None, f"dry at {joint}"
    return -s.contacts.at(joint).penetration / bearing.film.least_thickness


def roller_pressure(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    """Return Hertz's pressure of the most loaded roller of a joint, Pa."""
    return _rollers(scene, joint).pressure(s.contacts.at(joint).penetration)


def static_load(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    """Return the load of a roller bearing over its static rating."""
    bearing = _rollers(scene, joint)
    return force_at(s, scene, joint) / (bearing.bearings * bearing.static_rating)


def fatigue(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    """Return the share of its life L10 that a roller bearing uses in an hour.

    ISO 281 with the exponent 10/3, without its factor of lubrication and cleanness.
    """
    bearing = _rollers(scene, joint)
    load = force_at(s, scene, joint) / (bearing.bearings * bearing.dynamic_rating)
    turns = ring_speed(s, scene, joint) / (2 * jnp.pi) * HOUR
    return turns / RATED_TURNS * load**LIFE_EXPONENT


def ring_speed(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    """Return how fast the rings of a joint turn against each other, rad/s, >= 0.

    At a joint of the crank the rings make one turn per turn of the crank, so its speed is used.
    Elsewhere two bodies swing by an angle b to either side: there and back they roll over 4 b.
    So an oscillating bearing counts b / 90 deg of a turn.
    """
    one = scene.linkage.joints.at(joint)
    bodies = one.bore.body, one.pin.body
    if scene.linkage.crank in bodies:
        return jnp.abs(s.motion.crank.speed)
    spins = (s.motion.spin(body) for body in bodies)
    bore, pin = (jnp.zeros(()) if spin is None else spin for spin in spins)
    return jnp.abs(bore - pin)


# Of the machine as a whole.
OF_MACHINE = {
    "shaking_force": Observable(shaking_force, "N", "shaking force"),
    "ground_force": Observable(ground_force, "N", "force of the bodies on the frame"),
    "ground_moment": Observable(ground_moment, "N m", "moment of the bodies on the frame"),
    "drive_torque": Observable(drive_torque, "N m", "drive torque"),
    "drive_power": Observable(drive_power, "W", "drive power"),
    "constraint_residual": Observable(constraint_residual, "m", "largest constraint residual"),
}
# What only a frame on supports has; x to the right and y up, in the ground's axes.
OF_SUPPORTS = {
    **{
        f"{side}_force": Observable(
            OfPart(support_force, side), "N", f"force of the {side} support on the ground"
        )
        for side in ("left", "right")
    },
    "transmitted_force": Observable(transmitted_force, "N", "force of the supports on the ground"),
    "exciting_force": Observable(exciting_force, "N", "force of the motion past the frame"),
    "exciting_moment": Observable(exciting_moment, "N m", "moment of the motion past the frame"),
    "frame_displacement": Observable(
        OfPart(_of_frame, "displacement"), "m", "displacement of the frame's G"
    ),
    "frame_velocity": Observable(OfPart(_of_frame, "velocity"), "m/s", "velocity of the frame's G"),
    "frame_rotation": Observable(OfPart(_of_frame, "rotation"), "rad", "rotation of the frame"),
}


def kinetic_energy(s: Snapshot, scene: Scene) -> Scalar:
    """Return the kinetic energy of the bodies, and of a frame on supports, J."""
    total, drift = jnp.zeros_like(s.motion.crank.speed), None
    frame, foundation = s.frame, scene.supports
    if frame is not None and foundation is not None:
        drift = frame.velocity.seen_from(frame.axis)
        total = foundation.mass * drift.dot(drift) + foundation.inertia * frame.spin**2
    for name, body in scene.linkage.bodies.items():
        velocity, spin = s.motion.centre_velocity(name), s.motion.spin(name)
        if drift is not None and frame is not None and foundation is not None:
            arm = s.motion.centre(name) - foundation.point
            velocity = drift + frame.spin * arm.perp() + velocity
            spin = plus(spin, frame.spin)
        total = total + body.mass * velocity.dot(velocity)
        total = total if spin is None else total + body.inertia * spin**2
    return 0.5 * total


def potential_energy(s: Snapshot, scene: Scene) -> Scalar:
    """Return the potential energy of weight, zero at the height of the origin as drawn, J."""
    total, frame, foundation = jnp.zeros_like(s.motion.crank.speed), s.frame, scene.supports
    places = [(body, s.motion.centre(name)) for name, body in scene.linkage.bodies.items()]
    if frame is not None and foundation is not None:
        centre = foundation.point + frame.displacement
        total = foundation.mass * centre.y
        places = [(b, centre + (at - foundation.point).along(frame.axis)) for b, at in places]
    for body, place in places:
        total = total + body.mass * place.y
    return scene.linkage.gravity * total
