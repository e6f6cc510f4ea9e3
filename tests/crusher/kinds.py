"""Scenes by which of their joints are loose, and what holds of each at any instant."""

from types import SimpleNamespace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import jaxcrusher as jc
from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher import template as ob
from jaxcrusher.crusher.machine import JOINTS
from jaxcrusher.mechanism import observables as general
from jaxcrusher.mechanism.acting import push_power, spring_loss
from jaxcrusher.mechanism.drives import CrankState
from jaxcrusher.mechanism.multiplier import MultiplierFormulation
from jaxcrusher.mechanism.snapshot import frame_at
from jaxcrusher.mechanism.starts import Given
from jaxcrusher.mechanism.state import frame_units
from jaxcrusher.mechanism.topology import FRAME
from tests.instants import at_state

LOOSE = {f"{joint}.clearance": 1e-4 for joint in ("elbow", "pivot")}
KINDS = {
    "A": {},
    "ideal": {"joint": "ideal"},
    "A by multipliers": {"formulation": "multiplier"},
    "all": LOOSE,
    "all by multipliers": {"formulation": "multiplier", **LOOSE},
}
# Shares of a turn at which laws are looked at: at time zero the sine of an acceleration is zero.
INSTANTS = np.array([0.0, 0.13, 0.4, 0.77])
# A frame that is turned by 6 degrees and fast: what is small in a machine is not here.
MOVING = frame_at(Vector(0.02, -0.03), jnp.array(0.1), Vector(0.4, -0.3), jnp.array(2.0))


def sliding(kind, **values):
    """Return a scene of a kind whose joints with clearance start in hard contact and slide."""
    scene = jc.build_scene({"slip": "surface", **KINDS[kind], **values})
    return scene if kind == "ideal" else placed(scene, ((-0.9, -0.6), (0.5, 0.9)))


def placed(scene, *states):
    """Return the scene with (e in clearances, e' in m/s) of A, B, C, O; the last is of the rest.

    Those of joints without clearance are left out.
    """
    states = [*states, *states[-1:] * len(JOINTS)]
    places, rates = (
        {
            name: Vector(*state[part])
            for name, state in zip(JOINTS, states, strict=False)
            if name in scene.joints
        }
        for part in (0, 1)
    )
    return eqx.tree_at(lambda s: s.start, scene, Given(places, rates))


def moving(scene):
    """Return a scene's first state, in a frame that moves if it stands on supports."""
    state = scene.formulation.initial(scene)
    if state.frame is None:
        return state
    return eqx.tree_at(lambda s: s.frame, state, frame_units(scene).state(MOVING))


def at_start(scene):
    """Return the snapshot of a scene at time zero."""
    return scene.formulation.snapshot(jnp.array(0.0), moving(scene), scene)


def turned(scene, time):
    """Return the scene whose start is the shaft's place at a time, prescribed or free."""
    drive = scene.drive

    def initial():
        free = drive.initial()
        return free if free is None else CrankState(drive.speed * time, free.relative_speed)

    def crank(_, state):
        return drive.crank(time, state)

    later = SimpleNamespace(initial=initial, crank=crank, speed=drive.speed)
    return eqx.tree_at(lambda s: s.drive, scene, later)


def check_laws(scene):
    """Energy changes by the powers, and the frame is pushed by what the bodies' momentum says.

    The pins are as at the scene's start, the shaft has turned by each of `INSTANTS`.
    """
    power, pushes = map(float, unaccounted(scene))
    nine = isinstance(scene.formulation, MultiplierFormulation)
    # Rounding of some dozen terms of the size of the powers, and of forces at arms of half a metre.
    # Nine coordinates know the depth of a contact to 1e-10 of itself, and q'' to that of forces.
    assert power < (1e-8 if nine else 1e-10), power
    assert pushes < (1e-9 if nine else 1e-11), pushes


@eqx.filter_jit
def unaccounted(scene):
    """Return what is not accounted for of the power and of the frame's pushes, as shares."""

    def at(time):
        formulation = scene.formulation
        state = moving(turned(scene, time))

        s = formulation.snapshot(time, state, scene)

        def energy(time, state):
            at = at_state(s, time, state, scene)
            parts = (general.kinetic_energy, general.potential_energy, general.elastic_energy)
            return sum(part(at, scene) for part in parts)

        rate = formulation.rate(s, state, scene)
        _, change = jax.jvp(energy, (time, state), (jnp.array(1.0), rate))
        inputs = general.drive_power(s, scene), push_power(s, scene)
        losses = [general.contact_loss(s, scene), general.friction_loss(s, scene)]
        losses += [spring_loss(s, scene)]
        losses += [] if s.frame is None else [general.support_loss(s, scene)]
        force, moment, size = _pushes(s, scene)
        # Forces at speeds of about 1 m/s.
        scale = sum(jnp.abs(power) for power in (*inputs, *losses)) + size
        scale += sum(general.force_at(s, scene, joint) for joint in JOINTS)
        left = jnp.abs(change - sum(inputs) + sum(losses)) / scale
        return left, jnp.maximum(jnp.abs(force.array()).max(), jnp.abs(moment)) / size

    times = 2 * jnp.pi * INSTANTS / scene.drive.speed
    return jax.tree.map(jnp.max, jax.lax.map(at, times))


def _pushes(s, scene):
    """Return what pushes the frame less what it passes on or is accelerated by, and a size."""
    point = Vector(0.0, 0.0) if scene.foundation is None else scene.foundation.point
    pushes = [
        (
            scene.linkage.joints.at("shaft_bearing").bore.arm.vector(),
            -ob.bearing_reaction(s, scene),
        ),
        (Vector(0.0, 0.0), -ob.toggle_reaction(s, scene)),
    ]
    if scene.pushes:
        ((_, load),) = s.applied.pushes
        pushes.append((ob.load_position(s, scene), -load))
    if scene.springs:
        (rod,) = s.applied.springs
        pushes.append((rod.spring.ends[0].arm.vector(), rod.pull * rod.axis))
    moment = -general.drive_torque(s, scene)
    for name, contact in s.contacts.items():
        if scene.linkage.joints.at(name).bore.body == FRAME:
            moment += contact.bearing_moment
    # In flight bearing and pivot may feel nothing.
    weight = scene.linkage.gravity * sum(body.mass for body in scene.linkage.bodies.values)
    size = ob.foundation_force(s, scene) + weight
    if s.frame is None:
        force = -1.0 * general.ground_force(s, scene)
        moment -= general.ground_moment(s, scene)
    else:
        supports, axis = scene.supports, s.frame.axis
        on_ground = supports.support_forces(s.frame)
        for arm, one in zip(supports.arms(), on_ground, strict=True):
            pushes.append((point + arm, -one.seen_from(axis)))
            size += jnp.abs(one.array()).sum()
        if supports.rocking_damping is not None:
            moment -= supports.rocking_damping * s.frame.spin
        own = Vector(0.0, -supports.mass * scene.linkage.gravity).seen_from(axis)
        force = own - supports.mass * s.accelerations.centres["frame"]
        moment -= supports.inertia * s.accelerations.spin_ups["frame"]
    for at, push in pushes:
        force, moment = force + push, moment + (at - point).cross(push)
    return force, moment, size
