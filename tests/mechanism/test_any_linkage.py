"""What holds for any linkage: power, momentum, and two formulations that share no equation."""

import itertools
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.basics.plane import Vector
from jaxcrusher.joint.clearance import ClearanceJoint
from jaxcrusher.joint.normal import ConstantImpactVelocity, LankaraniNikravesh
from jaxcrusher.mechanism.multiplier import MultiplierFormulation
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.observables import friction_loss, kinetic_energy, potential_energy
from jaxcrusher.mechanism.starts import InContact
from jaxcrusher.mechanism.topology import FRAME
from tests.instants import at_state
from tests.mechanism.loosened import DRIVES, SUPPORTS, moved, scene_of
from tests.pairs import slow

# A bit of everything: one tree, several, some that float, a loop that is left, the crank's bearing.
LOOSE = {
    "four-bar": [(), ("big end",), ("base",), ("small end", "pivot"), "all"],
    "six-bar": [(), ("pivot",), ("middle", "big end"), ("upper", "foot", "base"), "all"],
    "slider-crank": [
        *(
            loose
            for count in range(3)
            for loose in itertools.combinations(("base", "big end", "wrist"), count)
        ),
        "all",
        ("guide",),
        ("guide", "wrist"),
        ("rubbing guide",),
        ("base", "rubbing guide"),
    ],
    "press": [
        (),
        ("upper",),
        ("wrist", "foot"),
        ("big end", "middle"),
        "all",
        ("guide", "upper"),
        ("rubbing guide", "wrist", "middle"),
    ],
    # Triads: what meets in the middle, what they hang by, and the slider's.
    "stephenson": [(), ("middle",), ("corner", "ceiling"), ("big end", "small end"), "all"],
    "chain": [
        (),
        ("hook",),
        ("wrist", "eye"),
        ("knee", "middle"),
        "all",
        ("guide", "hook"),
        ("rubbing guide", "eye"),
    ],
}
ONE, OTHER = [
    [
        (name, loose, list(DRIVES)[(k + more) % 3], k % 2 == more)
        for name, every in LOOSE.items()
        for k, loose in enumerate(every)
    ]
    for more in (0, 1)
]


def energy(s, scene):
    """Kinetic energy, that of weight, and what is stored in contacts and springs, J."""
    total = kinetic_energy(s, scene) + potential_energy(s, scene)
    for joint, contact in s.contacts.items():
        total += scene.joints[joint].elastic_energy(contact)
    return total if s.frame is None else total + scene.supports.elastic_energy(s.frame)


def power(s, scene):
    """What drive, pull, friction and dampers put in, W."""
    total = s.accelerations.torque * s.motion.crank.speed
    pull = s.applied.wrenches[0]
    velocity = s.motion.centre_velocity(pull.body)
    if s.frame is not None:
        total -= scene.supports.loss(s.frame)
    total += pull.force.dot(velocity)  # the frame feels its reaction in the same line
    for contact in s.contacts.values:
        total -= contact.normal_loss
    return total - friction_loss(s, scene)


# All joints of one dyad loose at once, and every third of the other cases.
SOON = [
    case
    for k, case in enumerate(ONE)
    if (case[0] in ("four-bar", "slider-crank") if case[1] == "all" else k % 3 == 0)
]
LATER = [case for case in (*ONE, *OTHER) if case not in SOON]


@pytest.mark.parametrize(("name", "loose", "drive", "frame"), [*SOON, *slow(*LATER)])
def test_power_and_formulations(machine, linkages, name, loose, drive, frame):
    """Energy changes by what is put in; by multipliers all is the same to the digits they have."""
    scene = scene_of(machine, linkages, name, loose, drive, frame)
    other = eqx.tree_at(lambda s: s.formulation, scene, MultiplierFormulation())

    def seen(scene):
        time, state = jnp.zeros(()), moved(scene.formulation.initial(scene))
        s = scene.formulation.snapshot(time, state, scene)
        rate = scene.formulation.rate(s, state, scene)

        def stored(time, state):
            return energy(at_state(s, time, state, scene), scene)

        _, change = jax.jvp(stored, (time, state), (jnp.ones(()), rate))
        found = s.accelerations
        return change - power(s, scene), (
            found.spin_ups,
            found.centres,
            found.eccentricities,
            found.forces,
            found.torque,
            found.slides,
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


def across(s, name):
    """The force of a slider on the frame, N."""
    return s.accelerations.slides[name].force * s.motion.linkage.slides.at(name).direction.perp()


EACH = [(name, every[3]) for name, every in LOOSE.items()]
EACH += [("slider-crank", ("guide",)), ("slider-crank", ("rubbing guide",))]


@pytest.mark.parametrize("frame", [False, True], ids=["clamped", "supports"])
@pytest.mark.parametrize(("name", "loose"), EACH)
def test_each_body_obeys_newton_and_euler(machine, linkages, name, loose, frame):
    """With the forces on bores and pins that the equations say, and their moments; a frame too."""
    scene = scene_of(machine, linkages, name, loose, "uneven", frame)
    s = scene.formulation.snapshot(jnp.zeros(()), moved(scene.formulation.initial(scene)), scene)
    found, linkage, pull = s.accelerations, scene.linkage, s.applied.wrenches[0]
    fall, bodies = Vector(0.0, -linkage.gravity), dict(linkage.bodies.items())
    places = {body: s.motion.centre(body) for body in bodies}
    # Of each body: a force at its centre and a moment.
    outside = {pull.body: (pull.force, 0.0), "crank": (Vector(0.0, 0.0), found.torque)}
    if frame:
        fall, ground = fall.seen_from(s.frame.axis), SUPPORTS.wrench(s.frame)
        bodies[FRAME], places[FRAME] = SUPPORTS.moving(s.frame).body, SUPPORTS.point
        outside[FRAME] = ground.force, ground.moment - found.torque
    # Of each joint and slide: where it pushes which body, with which force and moment.
    pushes = [(FRAME, places[pull.body], -pull.force, 0.0)]
    for joint, ends in linkage.joints.items():
        for end, sign, turned in (
            (ends.bore, 1.0, "bearing_moment"),
            (ends.pin, -1.0, "journal_moment"),
        ):
            contact = s.contacts[joint]
            moment = 0.0 if contact is None else getattr(contact, turned)
            pushes.append((end.body, s.motion.position(end), sign * found.forces[joint], moment))
    for name, slide in linkage.slides.items():
        push, at = found.slides[name], s.motion.position(slide.ends.pin)
        on_frame = push.force * slide.direction.perp()
        if push.friction is not None:
            on_frame = on_frame + push.friction * slide.direction
        pushes.append((FRAME, at, on_frame, push.moment))
        pushes.append((slide.body, at, -on_frame, -push.moment))
    size = max(float(np.hypot(f.x, f.y)) for f in found.forces.values)
    for body, one in bodies.items():
        force, moment = outside.get(body, (Vector(0.0, 0.0), 0.0))
        for pushed, at, push, turning in pushes:
            if pushed == body:
                force, moment = force + push, moment + (at - places[body]).cross(push) + turning
        force = force - one.mass * (found.centres[body] - fall)
        moment = moment - one.inertia * found.spin_ups[body]
        size = max(size, float(one.mass * jnp.hypot(fall.x, fall.y)))
        # Rounding of forces of that size, at arms of less than a metre.
        assert float(np.hypot(force.x, force.y)) < 1e-12 * size, body
        assert abs(float(moment)) < 1e-12 * size, body


@pytest.mark.parametrize("name", ["four-bar", "slider-crank", "press"])
def test_pins_in_contact_rest(machine, linkages, name):
    """Without friction and damping the accelerations left are those of slow motion.

    Not so of the six-bar linkage: the forces of its crank turn by a right angle within the 0.2 rad
    of the collocation, whose refinement then diverges.
    """
    names = linkages[name].joints.names
    law = LankaraniNikravesh(1e11, 1.0, ConstantImpactVelocity(0.1), width=1e-8)
    bearings = Named({joint: ClearanceJoint(0.02, 1e-4, law, None) for joint in names})
    scene = eqx.tree_at(
        lambda s: (s.joints, s.start),
        machine(name, names),
        (bearings, InContact()),
        is_leaf=lambda x: x is None,
    )

    s = scene.formulation.snapshot(jnp.zeros(()), scene.formulation.initial(scene), scene)
    left = [float(jnp.hypot(e.x, e.y)) for e in s.accelerations.eccentricities.values]
    # Eccentricities of 1e-4 m that turn at 20 rad/s and some of their harmonics: 0.04 m/s2 and
    # more. Forces of 600 N on 0.14 kg that nothing carried would leave 4000.
    assert max(left) < 0.1


@pytest.mark.parametrize("name", ["horizontal_damping", "vertical_damping"])
@pytest.mark.parametrize("damping", [-1.0, np.nan])
def test_a_damper_takes_energy(name, damping):
    with pytest.raises(ValueError, match=rf"^Argument `foundation\.{name}` must lie in \[0, inf\]"):
        replace(SUPPORTS, **{name: damping})
