"""Positions and velocities of a linkage's bodies, from its crank and its eccentricities.

All is relative to the frame and in its axes. The bodies of a dyad follow from where two circles, or
a circle and a line, meet; their spins follow from the lever formula. So a dyad needs one square
root and no trigonometry. The middle body of a triad is found by Newton's method (`triads`).
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Scalar

from jaxcrusher.basics.checks import require
from jaxcrusher.basics.plane import Arm, Vector, arm_to, direction, minus, or_zero, plus
from jaxcrusher.basics.record import Record
from jaxcrusher.mechanism.linkage import Joint, Linkage, Point
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.topology import FRAME, Dyad, Leg, Triad
from jaxcrusher.mechanism.triads import (
    AbstractCourse,
    AbstractHold,
    Lines,
    Rail,
    Rod,
    Spot,
    course_through,
    size_squared,
)


class Crank(Record):
    """The crank: its angle since time zero (rad), speed (rad/s) and acceleration (rad/s2)."""

    angle: Scalar
    speed: Scalar
    acceleration: Scalar | None = None  # None: zero, or not known yet


class Pose(Record):
    """A body: the unit vector of its x axis, its spin, and where one of its points is."""

    axis: Vector
    spin: Scalar | None  # counterclockwise, rad/s; None of a slider, which does not turn
    anchor: Arm  # the point
    place: Vector | None  # of the point, m
    rate: Vector | None  # and its velocity, m/s

    def position(self, arm: Arm) -> Vector | None:
        """Return where a point of the body is, m."""
        return plus(self.place, (arm - self.anchor).along(self.axis))

    def velocity(self, arm: Arm) -> Vector | None:
        """Return the velocity of a point of the body, m/s."""
        apart = (arm - self.anchor).along(self.axis)
        still = apart is None or self.spin is None
        return plus(self.rate, None if still else self.spin * apart.perp())


class Motion(Record):
    """A linkage in motion; points of the frame are at rest in it."""

    linkage: Linkage
    crank: Crank
    poses: Named[Pose]
    # Pin less bore of the loose joints, m. Of a guide with a gap x is how far the slider's origin
    # lies to the left of its line, and y the tilt times half of the slider's length.
    eccentricities: Named[Vector]
    rates: Named[Vector]  # m/s

    def axis(self, body: str) -> Vector:
        """Return the unit vector of a body's x axis."""
        return Vector(1.0, 0.0) if body == FRAME else self.poses.at(body).axis

    def spin(self, body: str) -> Scalar | None:
        """Return the spin of a body, rad/s; None of the frame and of sliders."""
        return None if body == FRAME else self.poses.at(body).spin

    def ends(self, name: str) -> Joint:
        """Return the points at which the two bodies of a joint or a slide act on each other.

        Of a slide both lie in the slider's origin.
        """
        slide = self.linkage.slides[name]
        if slide is None:
            return self.linkage.joints.at(name)
        slider = slide.ends.pin
        return Joint(Point(FRAME, arm_to(self.position(slider))), slider)

    def centre(self, body: str) -> Vector:
        """Return the mass centre of a body, m."""
        return self.position(self.linkage.centre(body))

    def centre_velocity(self, body: str) -> Vector:
        """Return the velocity of the mass centre of a body, m/s."""
        return self.velocity(self.linkage.centre(body))

    def position(self, point: Point) -> Vector:
        """Return where a point is, m."""
        return or_zero(_position(self.poses, point))

    def velocity(self, point: Point) -> Vector:
        """Return the velocity of a point, m/s."""
        return or_zero(_velocity(self.poses, point))


def _position(poses: Named[Pose], point: Point) -> Vector | None:
    if point.body == FRAME:
        arm = point.arm
        return None if arm.x is None and arm.y is None else arm.vector()
    return poses.at(point.body).position(point.arm)


def _velocity(poses: Named[Pose], point: Point) -> Vector | None:
    pose = poses[point.body]
    return None if pose is None else pose.velocity(point.arm)


def moving(
    linkage: Linkage,
    crank: Crank,
    e: Named[Vector],
    rates: Named[Vector],
    courses: Named[AbstractCourse] | None = None,
) -> Motion:
    """Return the motion whose pins are `e` (m) off their bores and move there at `rates` (m/s).

    A joint that has no eccentricity is held together. The middle bodies of triads are searched near
    `courses`, or near those of the linkage if None. A triad that is not found is NaN.
    """
    so_far = Motion(linkage, crank, Named(), e, rates)
    place, rate = _hung(so_far, linkage.bearing, linkage.crank)
    anchor = linkage.side_of(linkage.bearing, linkage.crank)
    poses = {linkage.crank: Pose(direction(crank.angle), crank.speed, anchor, place, rate)}
    sides = iter(linkage.sides)
    for group in linkage.groups:
        so_far = Motion(linkage, crank, Named(poses), e, rates)
        if isinstance(group, Triad):
            course = (linkage.courses if courses is None else courses)[group.middle]
            poses |= _three_and_middle(so_far, group, course)
            continue
        placed = _link_and_slider if group.second_joint in linkage.slides else _two_links
        poses |= placed(so_far, group, next(sides))
    return Motion(linkage, crank, Named(poses), e, rates)


def ideal_at_rest(linkage: Linkage, angle: Scalar | float) -> Motion:
    """Return a linkage of ideal joints that stands still at an angle of its crank (rad)."""
    crank = Crank(jnp.asarray(angle, float), jnp.zeros(()))
    return moving(linkage, crank, Named(), Named())


def _hung(motion: Motion, joint: str, body: str) -> tuple[Vector | None, Vector | None]:
    """Return place and velocity of a joint on the second of its bodies, from the other one."""
    one = motion.linkage.joints.at(joint)
    other = one.bore if one.pin.body == body else one.pin
    place, rate = _position(motion.poses, other), _velocity(motion.poses, other)
    return _parted(motion, joint, body, place, rate)


def _parted(
    motion: Motion, joint: str, body: str, place: Vector | None, rate: Vector | None
) -> tuple[Vector | None, Vector | None]:
    """Return a place and its rate, shifted by the eccentricity of a joint from bore to pin.

    From pin to bore, if the pin is not the body's.
    """
    shifted = plus if motion.linkage.joints.at(joint).pin.body == body else minus
    return shifted(place, motion.eccentricities[joint]), shifted(rate, motion.rates[joint])


def _two_links(motion: Motion, dyad: Dyad, side: int) -> dict[str, Pose]:
    """Return the poses of two links: u from the first outer joint, v to the second one.

    la u + lb v = p, where p leads from the one to the other. The two meet to the left of p for
    side 1, to the right for side -1. Their spins solve la spin_u perp(u) + lb spin_v perp(v) = p'.
    """
    linkage = motion.linkage
    start, start_rate = _hung(motion, dyad.first_joint, dyad.first)
    end, end_rate = _hung(motion, dyad.second_joint, dyad.second)
    span, change = minus(end, start), minus(end_rate, start_rate)
    span, change = map(or_zero, _parted(motion, dyad.meeting, dyad.first, span, change))
    arms = [linkage.side_of(dyad.first_joint, dyad.first)]
    arms += [linkage.side_of(dyad.second_joint, dyad.second)]
    first = _Link(linkage.side_of(dyad.meeting, dyad.first) - arms[0])
    second = _Link(arms[1] - linkage.side_of(dyad.meeting, dyad.second))
    la, lb, distance = first.length, second.length, span.dot(span)
    share = (distance + la**2 - lb**2) / (2 * distance)
    height = side * jnp.sqrt(la**2 / distance - share**2)
    u = (share * span + height * span.perp()) / la
    v = (span - la * u) / lb
    lever = u.cross(v)
    spins = change.dot(v) / (la * lever), -change.dot(u) / (lb * lever)
    return {
        dyad.first: Pose(first.axis(u), spins[0], arms[0], start, start_rate),
        dyad.second: Pose(second.axis(v), spins[1], arms[1], end, end_rate),
    }


def _link_and_slider(motion: Motion, dyad: Dyad, side: int) -> dict[str, Pose]:
    """Return the poses of a link and a slider: u from the link's outer joint, l u = p + s d.

    p is there where the slider's way s along d is zero. They meet ahead of the foot of the
    perpendicular for side 1, behind it for side -1. The rates solve l spin perp(u) = p' + s' d. In
    a guide with a gap the slider lies off the line, and is tilted.
    """
    linkage = motion.linkage
    start, start_rate = _hung(motion, dyad.first_joint, dyad.first)
    rail, pin = _on_rail(motion, dyad.second_joint), linkage.side_of(dyad.meeting, dyad.second)
    ahead = linkage.slides.at(dyad.second_joint).direction
    still = minus(rail.position(pin), start), minus(rail.velocity(pin), start_rate)
    span, change = map(or_zero, _parted(motion, dyad.meeting, dyad.first, *still))
    arm = linkage.side_of(dyad.first_joint, dyad.first)
    link = _Link(linkage.side_of(dyad.meeting, dyad.first) - arm)
    distance = ahead.cross(span)
    from_foot = side * jnp.sqrt(link.length**2 - distance**2)
    u = (from_foot * ahead + distance * ahead.perp()) / link.length
    spin = ahead.cross(change) / from_foot
    way = from_foot - ahead.dot(span)
    speed = -(spin * distance + ahead.dot(change))
    return {
        dyad.first: Pose(link.axis(u), spin, arm, start, start_rate),
        dyad.second: _moved(rail, way * ahead, speed * ahead),
    }


def _on_rail(motion: Motion, name: str) -> Pose:
    """Return the pose of a slider whose way along its slide is zero.

    In a guide with a gap it lies off the line, and is tilted.
    """
    slide = motion.linkage.slides.at(name)
    begin = _position(motion.poses, slide.ends.bore)
    play, leaving = motion.eccentricities[name], motion.rates[name]
    if play is None:
        return Pose(Vector(1.0, 0.0), None, Arm(), begin, None)
    across, axis = slide.direction.perp(), direction(play.y / slide.half_length)
    place = plus(begin, play.x * across)
    if leaving is None:
        return Pose(axis, None, Arm(), place, None)
    return Pose(axis, leaving.y / slide.half_length, Arm(), place, leaving.x * across)


def _moved(pose: Pose, way: Vector, speed: Vector) -> Pose:
    """Return the pose of a body that has moved without turning, with its speed along that way."""
    place, rate = plus(pose.place, way), plus(pose.rate, speed)
    return Pose(pose.axis, pose.spin, pose.anchor, place, rate)


def _three_and_middle(
    motion: Motion, triad: Triad, course: AbstractCourse | None
) -> dict[str, Pose]:
    """Return the poses of a triad: that of its middle body by what holds it, then of its legs."""
    must = f"be continued round a turn, for the course of {triad.middle}"
    require(course is not None, "linkage", must, "without it")
    assert course is not None
    holds = _holds(motion, triad)
    spot = course.placed(holds, motion.crank.angle)
    lines = Lines(holds, spot)
    fed = zip(holds, lines.normals, strict=True)
    velocity, spin = lines.solve([None if h.rate is None else n.dot(h.rate) for h, n in fed])
    poses = {triad.middle: Pose(spot.axis, spin, Arm(), spot.place, velocity)}
    for leg, hold, arm, u in zip(triad.legs, holds, lines.arms, lines.reaches, strict=True):
        rate = plus(velocity, None if arm is None else spin * arm.perp())
        poses[leg.body] = _leg(motion, leg, u, or_zero(minus(rate, hold.rate)))
    return poses


def _leg(motion: Motion, leg: Leg, u: Vector, change: Vector) -> Pose:
    """Return the pose of a body of a triad that hangs outside, of what its hold reaches over."""
    linkage = motion.linkage
    if leg.joint in linkage.slides:
        return _moved(_on_rail(motion, leg.joint), u, change)
    start, start_rate = _hung(motion, leg.joint, leg.body)
    arm = linkage.side_of(leg.joint, leg.body)
    link = _Link(linkage.side_of(leg.meeting, leg.body) - arm)
    spin = u.cross(change) / link.length**2
    return Pose(link.axis(u / link.length), spin, arm, start, start_rate)


def _holds(motion: Motion, triad: Triad) -> list[AbstractHold]:
    """Return what holds the middle body of a triad, shifted by the eccentricities of its joints."""
    linkage, found = motion.linkage, []
    for leg in triad.legs:
        arm, on_leg = (linkage.side_of(leg.meeting, body) for body in (triad.middle, leg.body))
        if leg.joint in linkage.slides:
            across = linkage.slides.at(leg.joint).direction.perp()
            rail = _on_rail(motion, leg.joint)
            line = rail.position(on_leg), rail.velocity(on_leg)
            base = _parted(motion, leg.meeting, triad.middle, *line)
            found.append(Rail(arm, *base, across))
            continue
        hung = _hung(motion, leg.joint, leg.body)
        base = _parted(motion, leg.meeting, triad.middle, *hung)
        length = _Link(on_leg - linkage.side_of(leg.joint, leg.body)).length
        found.append(Rod(arm, *base, length))
    return found


def triad_lever(motion: Motion, triad: Triad) -> Scalar:
    """Return the determinant of the lines that hold a triad's middle body, over its size.

    It is zero where they meet in one point, and changes its sign there.
    """
    holds, pose = _holds(motion, triad), motion.poses.at(triad.middle)
    lines = Lines(holds, Spot(or_zero(pose.place), pose.axis))
    return lines.determinant / jnp.sqrt(size_squared(holds))


COUNT = 120  # angles of a turn at which triads are followed, each from the one before


@eqx.filter_jit
def followed(linkage: Linkage) -> tuple[Named[Spot], Float[Array, "angles triads"]]:
    """Return where the middle bodies of an ideal linkage are round a turn, and their levers.

    The first of the angles and the last one are 0 and 360 degrees.
    """
    held = jax.lax.stop_gradient(linkage)

    def onward(courses, angle):
        crank = Crank(angle, jnp.zeros_like(angle))
        motion = moving(held, crank, Named(), Named(), courses)
        poses = {triad.middle: motion.poses.at(triad.middle) for triad in held.triads}
        spots = {name: Spot(or_zero(pose.place), pose.axis) for name, pose in poses.items()}
        return Named(spots), jnp.stack([triad_lever(motion, triad) for triad in held.triads])

    def step(spots, angle):
        found = onward(spots, angle)
        return found[0], found

    angles = jnp.asarray(np.linspace(0, 2 * np.pi, COUNT + 1))
    return jax.lax.scan(step, onward(held.guesses, angles[0])[0], angles)[1]


def continued(linkage: Linkage) -> Linkage:
    """Return the linkage with the courses of its triads, followed round a turn from the guesses.

    It is done once, before anything moves; a linkage whose numbers have changed much needs it anew.
    """
    if not linkage.triads:
        return linkage
    spots, _ = followed(linkage)
    turn = jax.tree.map(lambda part: part[:COUNT], spots)
    return dataclasses.replace(linkage, courses=turn.map(course_through))


class _Link:
    """The line between two joints of a body: its length, negative where it runs against x."""

    def __init__(self, arm: Arm):
        self.arm = arm
        squared = arm.squared()
        assert squared is not None, "two joints of a body are apart"
        self.length: Scalar = jnp.sqrt(squared) if arm.x is None or arm.y is not None else arm.x

    def axis(self, unit: Vector) -> Vector:
        """Return the x axis of the body whose line points along a unit vector."""
        if self.arm.y is None:
            return unit
        return unit.seen_from(self.arm.vector() / self.length)
