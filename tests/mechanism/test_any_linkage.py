"""What holds for any linkage: power, momentum, and two formulations that share no equation."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.basics.plane import Vector
from jaxcrusher.mechanism.drives import ConstantSpeed, GivenTorque, UnevenSpeed
from jaxcrusher.mechanism.multiplier import MultiplierFormulation
from jaxcrusher.mechanism.starts import Given, InContact
from jaxcrusher.mechanism.supports import OnSupports

SUPPORTS = OnSupports(
    mass=60.0,
    inertia=3.0,
    point=Vector(0.1, -0.1),
    left=-0.2,
    right=0.4,
    base=-0.3,
    horizontal_stiffness=1e6,
    vertical_stiffness=2e6,
    horizontal_damping=1e3,
    vertical_damping=2e3,
)
DRIVES = {"even": ConstantSpeed(20.0), "uneven": UnevenSpeed(20.0, 0.2, 2.0, 0.5)}
DRIVES["torque"] = GivenTorque(30.0, 20.0)
# A bit of everything: one tree, several, some that float, a loop that is left, the crank's bearing.
LOOSE = {
    "four-bar": [(), ("big end",), ("base",), ("small end", "pivot"), "all"],
    "six-bar": [(), ("pivot",), ("middle", "big end"), ("upper", "foot", "base"), "all"],
}
CASES = [
    (name, loose, drive, frame)
    for name, every in LOOSE.items()
    for k, loose in enumerate(every)
    for drive, frame in ((list(DRIVES)[k % 3], k % 2 == 0), (list(DRIVES)[(k + 1) % 3], k % 2 == 1))
]


def scene_of(machine, linkages, name, loose, drive, frame):
    loose = linkages[name].joints.names if loose == "all" else loose
    scene = machine(name, loose, DRIVES[drive])
    random = np.random.default_rng(7)
    at = {joint: random.normal(size=2) for joint in loose}
    start = Given(
        # Some 3 % beyond touching, and moving.
        {joint: Vector(*(1.03 * one / np.hypot(*one))) for joint, one in at.items()},
        {joint: Vector(*random.normal(scale=0.05, size=2)) for joint in loose},
    )
    foundation = SUPPORTS if frame else None
    return eqx.tree_at(
        lambda s: (s.start, s.foundation), scene, (start, foundation), is_leaf=lambda x: x is None
    )


def moved(state):
    """The state with its frame off its place, turning."""
    if state.frame is None:
        return state
    where = (lambda s: s.frame.rotation, lambda s: s.frame.spin, lambda s: s.frame.velocity.y)
    return eqx.tree_at(
        lambda s: [one(s) for one in where], state, [jnp.asarray(x) for x in (0.3, 0.4, -0.2)]
    )


def energy(s, scene):
    """Kinetic energy, that of weight, and what is stored in contacts and springs, J."""
    total, frame, supports = 0.0, s.frame, scene.supports
    for name, body in scene.linkage.bodies.items():
        at, velocity = s.motion.centre(name), s.motion.centre_velocity(name)
        spin, height = s.motion.spin(name), at.y
        if frame is not None:
            arm = at - supports.point
            drift = frame.velocity.seen_from(frame.axis)
            velocity, spin = drift + frame.spin * arm.perp() + velocity, spin + frame.spin
            height = (supports.point + frame.displacement + arm.along(frame.axis)).y
        total += body.mass * velocity.dot(velocity) / 2 + body.inertia * spin**2 / 2
        total += body.mass * scene.linkage.gravity * height
    for joint, contact in s.contacts.items():
        total += scene.joints[joint].elastic_energy(contact)
    if frame is not None:
        total += supports.mass * frame.velocity.dot(frame.velocity) / 2
        total += supports.inertia * frame.spin**2 / 2 + supports.elastic_energy(frame)
        total += supports.mass * scene.linkage.gravity * frame.displacement.y
    return total


def power(s, scene):
    """What drive, pull, friction and dampers put in, W."""
    total = s.accelerations.torque * s.motion.crank.speed
    pull = s.applied.wrenches[0]
    velocity = s.motion.centre_velocity(pull.body)
    if s.frame is not None:
        # The pull is fixed to the axes of the frame, and acts on the ground.
        arm = s.motion.centre(pull.body) - scene.supports.point
        drift = s.frame.velocity.seen_from(s.frame.axis)
        velocity = velocity + drift + s.frame.spin * arm.perp()
        total -= scene.supports.loss(s.frame)
    total += pull.force.dot(velocity)
    for contact in s.contacts.values:
        total -= contact.normal_loss + contact.friction_loss
    return total


@pytest.mark.parametrize(("name", "loose", "drive", "frame"), CASES)
def test_power_and_formulations(machine, linkages, name, loose, drive, frame):
    """Energy changes by what is put in; by multipliers all is the same to the digits they have."""
    scene = scene_of(machine, linkages, name, loose, drive, frame)
    other = eqx.tree_at(lambda s: s.formulation, scene, MultiplierFormulation())

    @jax.jit
    def seen(scene):
        time, state = jnp.zeros(()), moved(scene.formulation.initial(scene))
        s = scene.formulation.snapshot(time, state, scene)
        rate = scene.formulation.rate(s, state, scene)

        def stored(time, state):
            return energy(scene.formulation.snapshot(time, state, scene), scene)

        _, change = jax.jvp(stored, (time, state), (jnp.ones(()), rate))
        found = s.accelerations
        return change - power(s, scene), (
            found.spin_ups,
            found.centres,
            found.eccentricities,
            found.forces,
            found.torque,
        )

    (difference, one), (again, two) = seen(scene), seen(other) if scene.joints.names else (0, None)
    force = max(float(np.hypot(f.x, f.y)) for f in one[3].values)
    # Forces at speeds of some m/s, to rounding; a depth of 3e-6 m of places of 0.3 m, to 1e-10.
    assert abs(float(difference)) < 1e-12 * force and abs(float(again)) < 1e-8 * force
    if two is not None:
        for found, expected in zip(two, one, strict=True):
            both = [np.array(jax.tree.leaves(numbers)) for numbers in (found, expected)]
            size = np.abs(both[1]).max(initial=0.0)
            np.testing.assert_allclose(*both, rtol=0, atol=2e-8 * size)


@pytest.mark.parametrize("name", LOOSE)
def test_each_body_obeys_newton_and_euler(machine, linkages, name):
    """With the forces on bores and pins that the equations say, and their moments."""
    scene = scene_of(machine, linkages, name, LOOSE[name][3], "even", False)
    s = scene.formulation.snapshot(jnp.zeros(()), scene.formulation.initial(scene), scene)
    found = s.accelerations
    for body, one in scene.linkage.bodies.items():
        force = one.mass * (found.centres[body] + Vector(0.0, scene.linkage.gravity))
        moment = one.inertia * found.spin_ups[body]
        if body == "rocker":
            force = force - s.applied.wrenches[0].force
        if body == "crank":
            moment = moment - found.torque
        for joint, ends in scene.linkage.joints.items():
            contact = s.contacts[joint]
            for end, sign, turned in (
                (ends.bore, 1, "bearing_moment"),
                (ends.pin, -1, "journal_moment"),
            ):
                if end.body == body:
                    push = sign * found.forces[joint]
                    force = force - push
                    moment = moment - (s.motion.position(end) - s.motion.centre(body)).cross(push)
                    moment = moment if contact is None else moment - getattr(contact, turned)
        size = max(float(np.hypot(f.x, f.y)) for f in found.forces.values)
        # Rounding of forces of that size, at arms of less than a metre.
        assert (
            float(np.hypot(force.x, force.y)) < 1e-12 * size and abs(float(moment)) < 1e-12 * size
        )


@pytest.mark.parametrize("name", LOOSE)
def test_pins_in_contact_rest(machine, linkages, name):
    """The start in contact carries the forces; the accelerations left are those of slow motion."""
    scene = machine(name, linkages[name].joints.names)
    resting, thrown = (
        eqx.tree_at(lambda s: s.start, scene, start, is_leaf=lambda x: x is None)
        for start in (InContact(), InContact(refinements=0))
    )

    @jax.jit
    def left(scene):
        s = scene.formulation.snapshot(jnp.zeros(()), scene.formulation.initial(scene), scene)
        return [jnp.hypot(e.x, e.y) for e in s.accelerations.eccentricities.values]

    # Friction is not in the balance: some 10 % of a force on some kg. Without refinement more.
    assert max(map(float, left(resting))) <= max(map(float, left(thrown)))
