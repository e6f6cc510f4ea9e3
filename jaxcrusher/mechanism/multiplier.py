"""The paper's formulation for any linkage: absolute coordinates, multipliers, stabilisation.

Wang, Cui, Wang, Appl. Sci. 2023, 13, 238, (12)-(20): mass centre and angle of each body, a pair of
rows for each joint that is held and for each slide, one for a driven crank, and Baumgarte's
stabilisation. It shares neither trees nor dyads with the eccentricities, and so is their
independent check. (13) of the paper lacks the drive's row; (19) omits the moments of a contact.
"""

import dataclasses
import functools

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import PyTree, Scalar
from typing_extensions import override

from jaxcrusher.basics.linear import SparseRow, solve_constrained
from jaxcrusher.basics.plane import Vector, direction, or_zero, plus, scalar
from jaxcrusher.basics.record import Record
from jaxcrusher.mechanism.equations import Accelerations, Forces, Guiding, guiding
from jaxcrusher.mechanism.linkage import Joint, Slide
from jaxcrusher.mechanism.motion import Crank, Motion, Pose, moving
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.scene import AbstractFormulation, Scene
from jaxcrusher.mechanism.snapshot import Snapshot
from jaxcrusher.mechanism.starts import start_of
from jaxcrusher.mechanism.state import (
    FrameState,
    Parts,
    contacts_of,
    frame_rate,
    frame_units,
    initial_frame,
    snapshot_of,
)
from jaxcrusher.mechanism.topology import FRAME

# The unit of time of the velocities in the state: as long as a contact, so that the error
# of a velocity weighs as much as that of the position it leads to.
CONTACT_TIME = 1e-4  # s


class Placement(Record):
    """Mass centre (m) and angle (rad) of a body in the frame, or a time derivative of them."""

    centre: Vector
    angle: Scalar

    def __mul__(self, factor) -> "Placement":
        return Placement(self.centre * factor, self.angle * factor)


class MultiplierState(Record):
    """q (m, rad), and q' in units per CONTACT_TIME; the crank is the first of the bodies."""

    position: Named[Placement]
    velocity: Named[Placement]
    memories: Named[PyTree[Scalar]]  # of the bearings
    frame: FrameState | None = None

    @property
    def parts(self) -> Parts:
        """Return the parts of the state."""
        angle = self.position.values[0].angle
        return Parts(Named(), Named(), self.memories, angle, self.frame)


class MultiplierFormulation(AbstractFormulation):
    """The index-1 equations (20); Baumgarte's alpha and beta in 1/s, 20 each in Table 2."""

    alpha: Scalar = eqx.field(converter=scalar, default=20.0)
    beta: Scalar = eqx.field(converter=scalar, default=20.0)

    @override
    def initial(self, scene: Scene) -> MultiplierState:
        """Return the scene's start, on the constraints to rounding."""
        linkage, drive = scene.linkage, scene.drive
        crank = drive.crank(scalar(0.0), drive.initial())
        motion = moving(linkage, crank, *start_of(scene).eccentricities(scene))
        position, velocity = {}, {}
        for name in sorted(linkage.bodies.names, key=lambda name: name != linkage.crank):
            pose = motion.poses.at(name)
            # A crank counts its turns.
            turned = jnp.arctan2(pose.axis.y, pose.axis.x)
            angle = crank.angle if name == linkage.crank else turned
            spin = jnp.zeros_like(angle) if pose.spin is None else pose.spin
            position[name] = Placement(motion.centre(name), angle)
            velocity[name] = Placement(motion.centre_velocity(name), spin) * CONTACT_TIME
        memories = scene.joints.map(lambda joint: joint.initial_memory())
        return MultiplierState(Named(position), Named(velocity), memories, initial_frame(scene))

    @override
    def motion(self, time: Scalar, state: MultiplierState, scene: Scene) -> Motion:
        """Return the motion of a state; its loose joints have the eccentricities that they show."""
        linkage, poses = scene.linkage, {}
        for name, at in state.position.items():
            one, rate = linkage.bodies.at(name), state.velocity.at(name) * (1 / CONTACT_TIME)
            axis = direction(at.angle)
            poses[name] = Pose(axis, rate.angle, one.mass_centre, at.centre, rate.centre)
        turning = Crank(state.position.at(linkage.crank).angle, poses[linkage.crank].spin)
        motion = Motion(linkage, turning, Named(poses), Named(), Named())
        gaps = {n: _apart(motion, one) for n, one in linkage.joints.items() if n in scene.joints}
        for name, slide in linkage.slides.items():
            if name in scene.joints:
                across, at = slide.direction.perp(), state.position.at(slide.body).angle
                turned = at, state.velocity.at(slide.body).angle / CONTACT_TIME
                (e, rate), half = _apart(motion, slide.ends), slide.half_length
                gaps[name] = (
                    Vector(across.dot(e), half * turned[0]),
                    Vector(across.dot(rate), half * turned[1]),
                )
        e, rates = ({name: gap[part] for name, gap in gaps.items()} for part in (0, 1))
        return dataclasses.replace(motion, eccentricities=Named(e), rates=Named(rates))

    @override
    def snapshot(self, time: Scalar, state: MultiplierState, scene: Scene) -> Snapshot:
        frame = None if state.frame is None else frame_units(scene).motion(state.frame)
        motion = self.motion(time, state, scene)
        contacts = contacts_of(scene, motion, state.memories)
        torque = scene.drive.torque(time, motion.crank)
        solve = functools.partial(self._accelerations, time, scene)
        return snapshot_of(scene, motion, contacts, torque, frame, solve)

    def _accelerations(
        self, time: Scalar, scene: Scene, motion: Motion, acting: Forces
    ) -> Accelerations:
        linkage, torque, contacts = scene.linkage, acting.torque, acting.contacts
        bodies = _Bodies(motion, acting)
        gaps = {name: bodies.gap(joint) for name, joint in linkage.joints.items()}
        rows, kept = [], []
        for name, gap in gaps.items():
            if name not in scene.joints:
                rows += gap.rows
                kept.append((gap.e.x, gap.rate.x, gap.rest.x))
                kept.append((gap.e.y, gap.rate.y, gap.rest.y))
        guided = {name: bodies.held_by(slide) for name, slide in linkage.slides.items()}
        for name, both in guided.items():
            for row, off in both if name not in scene.joints else ():
                rows.append(row)
                kept.append(off)
        if torque is None:
            rows.append(bodies.turning(linkage.crank))
            kept.append(_off(scene, time, motion))
        right = [-rest - 2 * self.alpha * rate - self.beta**2 * off for off, rate, rest in kept]
        found, multipliers = solve_constrained(bodies.masses, rows, bodies.forces, right)

        held, on_bore = iter(multipliers), {n: one.force for n, one in contacts.items()}
        for name in gaps:
            if name not in scene.joints:
                on_bore[name] = Vector(next(held), next(held))
        second = {n: gap.acceleration(found) for n, gap in gaps.items() if n in contacts}
        guides = {}
        for name, slide in linkage.slides.items():
            if name not in scene.joints:
                guides[name] = Guiding(next(held), next(held))
                continue
            contact = contacts.at(name)
            guides[name] = guiding(slide, contact)
            across, turning = (
                sum(row[i] * found[i] for i in row) + off[2] for row, off in guided[name]
            )
            second[name] = Vector(across, slide.half_length * turning)
        torque = -next(held) if torque is None else torque
        spin_ups = {name: found[3 * i + 2] for i, name in enumerate(bodies.names)}
        none = jnp.zeros_like(motion.crank.speed)  # where no joint is held
        return Accelerations(
            Named(spin_ups),
            Named({n: Vector(*found[3 * i : 3 * i + 2]) for i, n in enumerate(bodies.names)}),
            Named({name: second[name] for name in contacts.names}),
            Named({name: on_bore[name] for name in gaps}),
            torque,
            Named(guides),
            functools.reduce(jnp.maximum, [jnp.abs(off) for off, _, _ in kept], none),
        )

    @override
    def rate(self, snapshot: Snapshot, state: MultiplierState, scene: Scene) -> MultiplierState:
        found, frame = snapshot.accelerations, snapshot.frame
        second = {}
        for name in state.velocity.names:
            centre, spin_up = found.centres.at(name), found.spin_ups.at(name)
            if frame is not None and scene.supports is not None:
                carried, turned = found.centres.at(FRAME), found.spin_ups.at(FRAME)
                arm = snapshot.motion.centre(name) - scene.supports.point
                velocity = snapshot.motion.centre_velocity(name)
                swept = turned * arm.perp() - frame.spin**2 * arm
                centre = centre - carried - swept - 2 * frame.spin * velocity.perp()
                spin_up = spin_up - turned
            second[name] = Placement(centre, spin_up) * CONTACT_TIME
        memories = scene.joints.map(
            lambda joint, contact, memory: joint.memory_rate(contact, memory),
            snapshot.contacts,
            state.memories,
        )
        return MultiplierState(
            state.velocity.map(lambda one: one * (1 / CONTACT_TIME)),
            Named(second),
            memories,
            frame_rate(scene, frame, found),
        )

    @override
    def tolerance(self, scene: Scene, rtol: Scalar | float) -> Scalar | float:
        """Return a tolerance for positions of some 1 m, `rtol` clearances, but above rounding.

        With ideal joints it is `rtol` throws of the crank.
        """
        sizes = [joint.clearance for joint in scene.joints.values] or [scene.throw]
        return jnp.maximum(rtol * functools.reduce(jnp.minimum, sizes), 2e-14)


def _apart(motion: Motion, joint: Joint) -> tuple[Vector, Vector]:
    """Return pin less bore (m), and its rate (m/s)."""
    return (
        motion.position(joint.pin) - motion.position(joint.bore),
        motion.velocity(joint.pin) - motion.velocity(joint.bore),
    )


class _Gap(Record):
    """Pin less bore of a joint: its second derivative is rows . q'' + rest."""

    e: Vector  # m
    rate: Vector  # m/s
    rows: tuple[SparseRow, SparseRow]  # of x and of y
    rest: Vector  # m/s2

    def acceleration(self, found: list[Scalar]) -> Vector:
        """Return e'', from the accelerations of the bodies."""
        x, y = (sum(entry * found[i] for i, entry in row.items()) for row in self.rows)
        return Vector(x, y) + self.rest


class _Bodies:
    """Three coordinates of each body, and of a frame on supports: those past the ground."""

    def __init__(self, motion: Motion, acting: Forces):
        self.motion, self.frame = motion, acting.frame
        self.bodies = acting.bodies(motion.linkage)
        self.names, self.sums = tuple(self.bodies), acting.sums(motion)

    @property
    def masses(self) -> list[Scalar]:
        """Return the diagonal of M, (17)."""
        return [part for one in self.bodies.values() for part in (one.mass, one.mass, one.inertia)]

    @property
    def forces(self) -> list[Scalar]:
        """Return Q of (18), with weight, contacts and their moments."""
        found = []
        for name, one in self.bodies.items():
            force, moment = self.sums[name]
            x, y = or_zero(force).x, or_zero(force).y
            found += [x, y, jnp.zeros_like(one.mass) if moment is None else moment]
        return found

    def gap(self, joint: Joint) -> _Gap:
        """Return how pin and bore of a joint part."""
        e, rate = _apart(self.motion, joint)
        rows: tuple[SparseRow, SparseRow] = ({}, {})
        rest = Vector(0.0, 0.0)
        for point, sign in ((joint.pin, 1), (joint.bore, -1)):
            if point.body not in self.bodies:
                continue
            i, one = 3 * self.names.index(point.body), self.bodies[point.body]
            arm = (point.arm - one.mass_centre).along(self.motion.axis(point.body))
            unit = sign * jnp.ones_like(one.mass)
            rows[0][i], rows[1][i + 1] = unit, unit
            if arm is not None:
                arm = sign * arm
                rows[0][i + 2], rows[1][i + 2] = -arm.y, arm.x
                rest = rest - self._spin(point.body) ** 2 * arm
        if self.frame is not None:
            # e'' past the frame, which turns.
            i, spin = 3 * self.names.index(FRAME) + 2, self.frame.spin
            rest = rest + spin**2 * e - 2 * spin * rate.perp()
            for row, part in zip(rows, (e.y, -e.x), strict=True):
                row[i] = part if i not in row else row[i] + part
        return _Gap(e, rate, rows, rest)

    def _spin(self, body: str) -> Scalar:
        found = plus(self.motion.spin(body), None if self.frame is None else self.frame.spin)
        assert found is not None
        return found

    def held_by(self, slide: Slide) -> list[tuple[SparseRow, tuple[Scalar, Scalar, Scalar]]]:
        """Return a slide's rows: its body's way across the line, and its angle past the frame.

        With each goes how far it is off, that one's rate, and what the row leaves of the second.
        """
        gap, across = self.gap(slide.ends), slide.direction.perp()
        x, y = gap.rows
        row = {i: across.x * x.get(i, 0.0) + across.y * y.get(i, 0.0) for i in sorted(x.keys() | y)}
        off = (across.dot(gap.e), across.dot(gap.rate), across.dot(gap.rest))
        axis, spin = self.motion.axis(slide.body), self.motion.spin(slide.body)
        assert spin is not None
        turned = (jnp.arctan2(axis.y, axis.x), spin, jnp.zeros_like(spin))
        return [(row, off), (self.turning(slide.body), turned)]

    def turning(self, body: str) -> SparseRow:
        """Return the row of a body's angle past the frame."""
        one = jnp.ones_like(self.motion.crank.angle)
        row = {3 * self.names.index(body) + 2: one}
        return row if self.frame is None else {**row, 3 * self.names.index(FRAME) + 2: -one}


def _off(scene: Scene, time: Scalar, motion: Motion) -> tuple[Scalar, Scalar, Scalar]:
    """Return how far a driven crank is off its drive, its rate, and less what it should change."""
    wanted, crank = scene.drive.crank(time, None), motion.crank
    asked = jnp.zeros_like(time) if wanted.acceleration is None else -wanted.acceleration
    return crank.angle - wanted.angle, crank.speed - wanted.speed, asked
