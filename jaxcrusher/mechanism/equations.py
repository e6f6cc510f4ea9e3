"""Accelerations of a linkage under given forces, and the forces that hold it together.

Kane's equations. Cutting the loose joints leaves trees of bodies that joints hold together.
A mass centre moves by the arms of the bodies on its way through the tree. With their spins w_i

    r = root + sum of arm_i,   r'' = root'' + sum of (w_i' perp(arm_i) - w_i^2 arm_i),

so that perp(arm_i) is its partial velocity by w_i, and for each spin, over all bodies of the tree,

    sum of arm_i x (m r'' - F) + J_i w_i' - N_i = 0.

A slide adds s'' d along its line, so that d is the partial velocity by s', as of an arm -perp(d).
The root of a tree that floats moves with the force on all of it. A joint that closes a loop adds
its two rows, whose multipliers are its force. A frame on supports is one more body, and the tree
that begins with it floats. Spins and accelerations are relative to the ground, in the frame's axes.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Scalar

from jaxcrusher.basics.linear import solve_symmetric
from jaxcrusher.basics.plane import Arm, Vector, arm_to, minus, or_zero, plus, total
from jaxcrusher.basics.record import Record
from jaxcrusher.joint.clearance import Contact
from jaxcrusher.mechanism.linkage import Body, Joint, Linkage, Point, Slide
from jaxcrusher.mechanism.motion import Motion
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.topology import FRAME, Tree, forest

# By body: a force (N), and a moment about its mass centre (N m).
Sums = dict[str, tuple[Vector | None, Scalar | None]]


class Wrench(Record):
    """A force on a body, or on the frame, and a moment about its mass centre; None: none."""

    body: str = eqx.field(static=True)
    force: Vector | None  # N
    moment: Scalar | None = None  # N m


class MovingFrame(Record):
    """A frame on supports, as the equations see it."""

    body: Body  # from the origin of its axes
    spin: Scalar  # rad/s


class Forces(NamedTuple):
    """The applied forces on the bodies of a motion, without the reactions of joints."""

    wrenches: tuple[Wrench, ...]  # besides the weight and the contacts
    gravity: Vector  # in the frame's axes, m/s2
    contacts: Named[Contact]  # of the loose joints
    torque: Scalar | None = None  # on the crank, N m; None: it turns as the motion says
    frame: MovingFrame | None = None  # None: clamped

    def bodies(self, linkage: Linkage) -> dict[str, Body]:
        """Return all bodies; a frame on supports is the last one."""
        bodies = dict(linkage.bodies.items())
        return bodies if self.frame is None else {**bodies, FRAME: self.frame.body}

    def sums(self, motion: Motion) -> Sums:
        """Return the force and the moment on each body."""
        bodies = self.bodies(motion.linkage)
        found = [Wrench(name, one.mass * self.gravity) for name, one in bodies.items()]
        found += self.wrenches
        for name, contact in self.contacts.items():
            joint = motion.ends(name)
            found += pair_at(motion, joint, contact.force, self.frame)
            found += [
                Wrench(joint.bore.body, None, contact.bearing_moment),
                Wrench(joint.pin.body, None, contact.journal_moment),
            ]
        if self.torque is not None:
            crank = motion.linkage.crank
            found += [Wrench(crank, None, self.torque), Wrench(FRAME, None, -self.torque)]
        return _sums(found)


class Guiding(Record):
    """The force and the moment of a slider on its slide, in the frame."""

    force: Scalar  # to the left of the slide's direction, N
    moment: Scalar  # about the slider's origin, N m
    friction: Scalar | None = None  # ahead, N; None: none
    feedback: Scalar | None = None  # share of it that it brings about itself; it jams at one


def guiding(slide: Slide, contact: Contact) -> Guiding:
    """Return the force and the moment of a slider on a guide with a gap."""
    assert contact.bearing_moment is not None, "a guide tells its moment"
    ahead = None if contact.friction_force is None else slide.direction.dot(contact.force)
    return Guiding(slide.direction.cross(contact.force), contact.bearing_moment, ahead)


class Accelerations(Record):
    """What a motion does next, in the frame's axes, and what holds it together."""

    spin_ups: Named[Scalar]  # of bodies and of a frame on supports, past the ground, rad/s2
    centres: Named[Vector]  # of their mass centres, past the ground, m/s2
    eccentricities: Named[Vector]  # e'' of loose joints, past the frame, m/s2
    forces: Named[Vector]  # on the bore of each joint, N
    torque: Scalar  # on the crank by what drives it, N m
    slides: Named[Guiding] = eqx.field(default_factory=Named)  # on the frame by each slide
    residual: Scalar | None = None  # of held joints, m or rad; None: they are held exactly

    def past_frame(self, body: str) -> Scalar:
        """Return the angular acceleration of a body relative to the frame, rad/s2."""
        spin_up, frame = self.spin_ups.at(body), self.spin_ups[FRAME]
        return spin_up if frame is None else spin_up - frame


@dataclass
class _Way:
    """The way from the root of a tree to a point: arms of bodies, held eccentricities, slides."""

    arms: dict[str, Vector] = field(default_factory=dict)
    steps: dict[str, int] = field(default_factory=dict)

    def __sub__(self, other: "_Way") -> "_Way":
        apart = {b: minus(self.arms.get(b), other.arms.get(b)) for b in self.arms | other.arms}
        arms = {body: arm for body, arm in apart.items() if arm is not None}
        steps = {j: self.steps.get(j, 0) - other.steps.get(j, 0) for j in self.steps | other.steps}
        return _Way(arms, steps)


class _Ways:
    """The ways to any point of a motion, and what moves along them."""

    def __init__(
        self,
        motion: Motion,
        trees: tuple[Tree, ...],
        curvatures: Named[Vector],
        forces: Forces,
    ):
        linkage, frame, driven = motion.linkage, forces.frame, forces.torque is None
        self.motion, self.frame, self.curvatures = motion, frame, curvatures
        self.bodies = forces.bodies(linkage)
        slides = {n: one for n, one in linkage.slides.items() if n not in forces.contacts}
        self.slides = {slide.body: name for name, slide in slides.items()}
        # What turns past the frame by a spin that is known.
        self.spin_ups = {
            one.body: curvatures.at(name).y / one.half_length
            for name, one in slides.items()
            if name in curvatures
        }
        if driven and motion.crank.acceleration is not None:
            self.spin_ups[linkage.crank] = motion.crank.acceleration
        # Sliders turn with the frame. So does a driven crank, and past it by a spin that is known.
        self.turning_with = {body: body for body in self.bodies}
        for body in (*self.slides, *([linkage.crank] if driven else [])):
            del self.turning_with[body]
            if frame is not None:
                self.turning_with[body] = FRAME
        self.hung: dict[str, tuple[Arm, _Way]] = {}
        for tree in trees:
            floats = tree.base in self.bodies
            base = self.bodies[tree.base].mass_centre if floats else Arm()
            self.hung[tree.base] = base, _Way()
            for body, parent, joint in tree.branches:
                if joint in linkage.slides:
                    place = motion.position(linkage.slides.at(joint).ends.pin)
                    way = self.to(FRAME, arm_to(place))
                    self.hung[body] = Arm(), _Way(way.arms, {joint: 1})
                    continue
                way = self.to(parent, linkage.side_of(joint, parent))
                if joint in curvatures:
                    sign = 1 if linkage.joints.at(joint).pin.body == body else -1
                    way = _Way(way.arms, {**way.steps, joint: sign})
                self.hung[body] = linkage.side_of(joint, body), way

    def to(self, body: str, arm: Arm) -> _Way:
        """Return the way to a point of a body."""
        begin, way = self.hung[body]
        own = (arm - begin).along(self.motion.axis(body)) if body in self.bodies else None
        return way if own is None else _Way({**way.arms, body: own}, way.steps)

    def to_centre(self, body: str) -> _Way:
        """Return the way to the mass centre of a body."""
        return self.to(body, self.bodies[body].mass_centre)

    def to_end(self, point: Point) -> _Way:
        """Return the way to a point of a joint."""
        return self.to(point.body, point.arm)

    def by_speed(self, way: _Way) -> dict[str, Vector]:
        """Return the arms of a way by the bodies whose unknown spins they turn with.

        A slider's unknown speed stands with them, by its arm.
        """
        found: dict[str, Vector] = {}
        for body, arm in way.arms.items():
            if body in self.turning_with:
                name = self.turning_with[body]
                found[name] = arm if name not in found else found[name] + arm
        for body, name in self.slides.items():
            if name in way.steps:
                found[body] = (
                    -way.steps[name] * self.motion.linkage.slides.at(name).direction.perp()
                )
        return found

    def known(self, way: _Way) -> Vector | None:
        """Return the acceleration of a way's end past its root, of spins that do not change."""
        found = []
        for body, arm in way.arms.items():
            spin = plus(self.motion.spin(body), None if self.frame is None else self.frame.spin)
            if spin is not None:
                found.append(-(spin**2) * arm)
            if body in self.spin_ups:
                found.append(self.spin_ups[body] * arm.perp())
        for joint, sign in way.steps.items():
            curvature, slide = self.curvatures[joint], self.motion.linkage.slides[joint]
            if curvature is not None:
                parted = curvature if slide is None else curvature.x * slide.direction.perp()
                found.append(sign * parted)
            if slide is not None and self.frame is not None:  # which turns with the frame
                rate = self.motion.velocity(slide.ends.pin)
                found.append(sign * 2 * self.frame.spin * rate.perp())
        return total(found)


def solve(motion: Motion, acting: Forces, curvatures: Named[Vector] | None = None) -> Accelerations:
    """Return the accelerations of a motion, and the forces that hold its joints.

    `curvatures` are e'' (m/s2) of slides, and of joints that have an eccentricity but are not
    loose.
    """
    linkage, curvatures = motion.linkage, Named() if curvatures is None else curvatures
    contacts, torque, frame = acting.contacts, acting.torque, acting.frame
    trees, closing = forest(linkage.ends, linkage.bodies.names, contacts.names)
    ways, sums = _Ways(motion, trees, curvatures, acting), acting.sums(motion)

    unknown = [
        name
        for tree in trees
        for name in tree.bodies
        if name in ways.slides or ways.turning_with.get(name) == name
    ]
    rows = [_Rows(ways, tree, sums, unknown) for tree in trees]
    speed_ups, closed = _speed_rates(ways, rows, unknown, closing)
    roots = {body: one.root(speed_ups) for one in rows for body in one.tree.bodies}

    def acceleration(body: str, way: _Way) -> Vector | None:
        parts = [speed_ups[name] * arm.perp() for name, arm in ways.by_speed(way).items()]
        return total([roots[body], ways.known(way), *parts])

    centres = {name: or_zero(acceleration(name, ways.to_centre(name))) for name in ways.bodies}
    turned = {name: jnp.zeros_like(motion.crank.speed) for name in ways.slides}
    turned |= {name: speed_ups[other] for name, other in ways.turning_with.items()}
    if torque is None and linkage.crank not in turned:
        turned[linkage.crank] = jnp.zeros_like(motion.crank.speed)
    turned |= {body: turned[body] + known for body, known in ways.spin_ups.items()}
    second = {}
    for name in contacts.names:
        pin, bore = motion.ends(name).pin, motion.ends(name).bore
        ends = [acceleration(point.body, ways.to_end(point)) for point in (pin, bore)]
        parted = or_zero(minus(*ends))
        slide, swung = linkage.slides[name], turned.get(FRAME)
        if slide is None:
            e, rate = motion.eccentricities.at(name), motion.rates.at(name)
            second[name] = _past(frame, e, rate, parted, swung)
            continue
        # Past the point of the frame where the slider is, which lies at its origin.
        still = Vector(0.0, 0.0)
        parted = _past(frame, still, motion.velocity(slide.ends.pin), parted, swung)
        tilting = turned[slide.body] if swung is None else turned[slide.body] - swung
        second[name] = Vector(slide.direction.cross(parted), slide.half_length * tilting)

    for name, force in closed.items():
        sums = _sums(pair_at(motion, linkage.joints.at(name), force, frame), sums)
    missing = {
        name: minus(one.mass * centres[name], sums[name][0]) for name, one in ways.bodies.items()
    }
    forces = {name: contact.force for name, contact in contacts.items()} | closed
    guides = {
        name: guiding(slide, contacts.at(name))
        for name, slide in linkage.slides.items()
        if name in contacts
    }
    for tree in trees:
        for body, _, name in tree.branches:
            on_body = or_zero(total([missing[one] for one in tree.beyond(body)]))
            if name in linkage.slides:
                across = linkage.slides.at(name).direction.cross(on_body)
                turning = _moment(body, ways, trees, turned, missing, sums)
                guides[name] = Guiding(-across, -turning)
                continue
            forces[name] = on_body if linkage.joints.at(name).bore.body == body else -on_body
    if torque is None:
        torque = _moment(linkage.crank, ways, trees, turned, missing, sums)
    return Accelerations(
        Named({name: turned[name] for name in ways.bodies}),
        Named(centres),
        Named(second),
        Named({name: forces[name] for name in linkage.joints.names}),
        torque,
        Named({name: guides[name] for name in linkage.slides.names}),
    )


def _speed_rates(
    ways: _Ways, rows: "list[_Rows]", unknown: list[str], closing: tuple[str, ...]
) -> tuple[dict[str, Scalar], dict[str, Vector]]:
    """Return the derivatives of the unknown speeds, and the forces on the bores that close loops.

    Pin and bore of a closing joint move alike: rows . w' = right. The multipliers of the rows are
    forces on the bore, M w' + rows^T force = moments.
    """
    linkage = ways.motion.linkage
    sides = [total([one.right.get(name) for one in rows]) for name in unknown]
    # Nothing pushes a body without a force whose mass centre lies in its origin.
    lower, right = {}, [0.0 if side is None else side for side in sides]
    for place in dict.fromkeys(place for one in rows for place in one.lower):
        lower[place] = total([one.lower.get(place) for one in rows])
    for joint in closing:
        ends = linkage.joints.at(joint)
        apart = ways.to_end(ends.pin) - ways.to_end(ends.bore)
        left = minus(ways.known(apart), ways.curvatures[joint])
        assert left is not None
        for name, arm in ways.by_speed(apart).items():
            partial = arm.perp()
            lower[len(right), unknown.index(name)] = partial.x
            lower[len(right) + 1, unknown.index(name)] = partial.y
        right += [-left.x, -left.y]
    found = solve_symmetric(lower, right)
    held = iter(found[len(unknown) :])
    forces = {joint: Vector(next(held), next(held)) for joint in closing}
    return dict(zip(unknown, found, strict=False)), forces


class _Rows:
    """What one tree adds to the equations of the unknown speeds: mass matrix and right sides."""

    def __init__(self, ways: _Ways, tree: Tree, sums: Sums, unknown: list[str]):
        self.tree = tree
        self.lower: dict[tuple[int, int], Any] = {}
        members = [body for body in tree.bodies if body in ways.bodies]
        moving = {ways.turning_with[body] for body in members if body in ways.turning_with}
        moving |= ways.slides.keys() & set(members)
        self.right: dict[str, Any] = {name: None for name in unknown if name in moving}
        columns, products, pushes = {}, {}, {}
        for body in members:
            one, way = ways.bodies[body], ways.to_centre(body)
            columns[body], known = ways.by_speed(way), ways.known(way)
            products[body] = {name: one.mass * arm for name, arm in columns[body].items()}
            lost = None if known is None else one.mass * known
            pushes[body] = minus(sums[body][0], lost)
            if body in ways.turning_with:
                name = ways.turning_with[body]
                place = (unknown.index(name), unknown.index(name))
                self.lower[place] = plus(self.lower.get(place), one.inertia)
                self.right[name] = plus(self.right[name], sums[body][1])
                changing = ways.spin_ups.get(body)
                if changing is not None:
                    self.right[name] = minus(self.right[name], one.inertia * changing)
        # Of a tree that floats: its mass, the force on it, and its mass moments about its root.
        self.floats = tree.base in ways.bodies
        self.mass = total([ways.bodies[body].mass for body in members])
        self.push = total(list(pushes.values()))
        self.sums = {n: total([products[b].get(n) for b in members]) for n in self.right}
        names = list(self.right)
        for i, name in enumerate(names):
            moved = [body for body in members if name in columns[body]]
            moments = [columns[body][name].cross(pushes[body]) for body in moved]
            of_root = self.sums[name] if self.floats else None
            if of_root is not None:
                of_root = of_root / self.mass
                moments.append(-of_root.cross(self.push))
            self.right[name] = total([self.right[name], *moments])
            for other in names[: i + 1]:
                entries = [
                    products[body][name].dot(columns[body][other])
                    for body in moved
                    if other in columns[body]
                ]
                if of_root is not None and self.sums[other] is not None:
                    entries.append(-of_root.dot(self.sums[other]))
                place = unknown.index(name), unknown.index(other)
                entry = total([self.lower.get(place), *entries])
                if entry is not None:
                    self.lower[place] = entry

    def root(self, speed_ups: dict[str, Scalar]) -> Vector | None:
        """Return the acceleration of the root."""
        if not self.floats:
            return None
        parts = [-speed_ups[n] * s.perp() for n, s in self.sums.items() if s is not None]
        push = total([self.push, *parts])
        assert push is not None
        return push / self.mass


def pair_at(
    motion: Motion, joint: Joint, force: Vector, frame: MovingFrame | None
) -> tuple[Wrench, Wrench]:
    """Return a force on the bore of a joint, and its reaction on the pin."""
    return (
        wrench_at(motion, joint.bore, force, frame),
        wrench_at(motion, joint.pin, -force, frame),
    )


def wrench_at(
    motion: Motion, point: Point, force: Vector, frame: MovingFrame | None = None
) -> Wrench:
    """Return the wrench about the mass centre of a force at a point of a body, or of the frame."""
    if point.body == FRAME:
        centre = Arm() if frame is None else frame.body.mass_centre
    else:
        centre = motion.linkage.bodies.at(point.body).mass_centre
    arm = (point.arm - centre).along(motion.axis(point.body))
    return Wrench(point.body, force, None if arm is None else arm.cross(force))


def _sums(wrenches: Iterable[Wrench], before: Sums | None = None) -> Sums:
    """Return force and moment on each body, added to those before."""
    found = {} if before is None else dict(before)
    for one in wrenches:
        force, moment = found.get(one.body, (None, None))
        found[one.body] = plus(force, one.force), plus(moment, one.moment)
    return found


def _past(
    frame: MovingFrame | None, e: Vector, rate: Vector, second: Vector, spin_up: Scalar | None
) -> Vector:
    """Return e'' past the frame, from what pin and bore do past the ground."""
    if frame is None or spin_up is None:
        return second
    turning = frame.spin**2 * e - 2 * frame.spin * rate.perp()
    return second + turning - spin_up * e.perp()


def _moment(
    body: str,
    ways: _Ways,
    trees: tuple[Tree, ...],
    spin_ups: dict[str, Scalar],
    missing: dict[str, Vector | None],
    sums: Sums,
) -> Scalar:
    """Return the moment that holds a body as it turns: that of a driven crank, or of a slide."""
    tree = next(one for one in trees if body in one.bodies)
    parts = [ways.bodies[body].inertia * spin_ups[body], minus(None, sums[body][1])]
    for one in tree.beyond(body):
        arm, force = ways.to_centre(one).arms.get(body), missing[one]
        parts.append(None if arm is None or force is None else arm.cross(force))
    found = total(parts)
    assert found is not None
    return found
