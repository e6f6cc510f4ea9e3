"""A frame on supports at an instant: momentum, power, formulations, and what is refused."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher import observables as ob
from jaxcrusher.crusher.observables import OBSERVABLES, observables_of
from jaxcrusher.mechanism.drives import GivenTorque
from jaxcrusher.mechanism.frame import frame_units
from jaxcrusher.mechanism.multiplier import MultiplierFormulation
from jaxcrusher.mechanism.snapshot import frame_at
from jaxcrusher.mechanism.starts import Given
from tests.crusher.operations import field_operations
from tests.pairs import slow

NUMBERS = {
    "foundation.mass": 2000.0,
    "foundation.inertia": 900.0,
    "foundation.x": 0.3,
    "foundation.y": 0.2,
    "foundation.left": -0.6,
    "foundation.right": 0.8,
    "foundation.base": -0.5,
    "foundation.horizontal_stiffness": 2e7,
    "foundation.vertical_stiffness": 3e7,
    "foundation.horizontal_damping": 4e4,
    "foundation.vertical_damping": 5e4,
}
# Turned by 6 degrees and fast: what is small in a machine is not here.
MOVING = frame_at(Vector(0.02, -0.03), jnp.array(0.1), Vector(0.4, -0.3), jnp.array(2.0))
LOOSE = {f"{joint}.clearance": 1e-4 for joint in ("elbow", "pivot")}
KINDS = {
    "ideal": {"joint": "ideal"},
    "paper": {"slip": "surface", "load_law": "normal_to_jaw"},
    "all loose": {"slip": "surface", **LOOSE, "load_law": "closing_stroke"},
}


def scene_of(kind, formulation="eccentricity", free=False):
    scene = jc.build_scene({**NUMBERS, **KINDS[kind], "counterweight.mass": 20.0})
    if kind != "ideal":
        # In hard contact, sliding.
        at = Vector(-0.9, -0.6), Vector(0.5, 0.9)
        start = Given(*(scene.joints.map(lambda _, one=one: one) for one in at))
        scene = eqx.tree_at(lambda s: s.start, scene, start)
    if formulation == "multiplier":
        scene = eqx.tree_at(lambda s: s.formulation, scene, MultiplierFormulation())
    if free:
        scene = eqx.tree_at(lambda s: s.drive, scene, GivenTorque(300.0, 30.0))
    return scene


def moving(scene):
    """The scene's start in a frame that moves."""
    state = scene.formulation.initial(scene)
    return eqx.tree_at(lambda s: s.frame, state, frame_units(scene).state(MOVING))


def instant(scene):
    return scene.formulation.snapshot(jnp.array(0.0), moving(scene), scene)


# Each choice once, and the rest of their combinations.
CASES = [("paper", "eccentricity", False), ("ideal", "eccentricity", True)]
CASES += [("all loose", "multiplier", True)]
REST = [
    (kind, formulation, free)
    for kind in KINDS
    for formulation in ("eccentricity", "multiplier")
    for free in (False, True)
    if (kind, formulation) != ("ideal", "multiplier") and (kind, formulation, free) not in CASES
]


@pytest.mark.parametrize(("kind", "formulation", "free"), [*CASES, *slow(*REST)])
def test_momentum_and_energy(kind, formulation, free):
    """Of all four bodies: what they have changes by what acts from outside, to rounding."""
    scene = scene_of(kind, formulation, free)

    @eqx.filter_jit
    def found(scene):
        state = moving(scene)
        s = scene.formulation.snapshot(jnp.array(0.0), state, scene)
        rate = scene.formulation.rate(s, state, scene)
        foundation, machine = scene.supports, scene.machine

        def places(time, state):
            now = scene.formulation.snapshot(time, state, scene)
            frame, point = now.frame, foundation.point
            centre = point + frame.displacement
            return [centre] + [
                centre + (at - point).along(frame.axis)
                for at in map(now.motion.centre, scene.linkage.bodies.names)
            ], now

        bodies = (foundation, *scene.linkage.bodies.values)

        def momenta(time, state):
            """Momentum, moment of momentum about C as drawn, and energy."""
            rate = field(time, state)
            (at, now), (velocity, _) = jax.jvp(places, (time, state), (jnp.ones(()), rate))
            spins = 0.0, *map(now.motion.spin, scene.linkage.bodies.names)
            x = sum(b.mass * v.x for b, v in zip(bodies, velocity, strict=True))
            y = sum(b.mass * v.y for b, v in zip(bodies, velocity, strict=True))
            turning = sum(
                b.mass * r.cross(v) + b.inertia * (now.frame.spin + spin)
                for b, r, v, spin in zip(bodies, at, velocity, spins, strict=True)
            )
            parts = ob.kinetic_energy, ob.potential_energy, ob.elastic_energy
            return x, y, turning, sum(part(now, scene) for part in parts)

        def field(time, state):
            now = scene.formulation.snapshot(time, state, scene)
            return scene.formulation.rate(now, state, scene)

        start = jnp.array(0.0), state
        change = jax.jvp(momenta, start, (jnp.ones(()), rate))[1]
        on_ground = [ob.left_force(s, scene), ob.right_force(s, scene)]
        centre = foundation.point + s.frame.displacement
        force = Vector(0.0, 0.0)
        moment = 0.0
        for arm, one in zip(foundation.arms(), on_ground, strict=True):
            force = force - one
            moment = moment - (centre + arm.along(s.frame.axis)).cross(one)
        for body, at in zip(bodies, places(*start)[0], strict=True):
            force = force - Vector(0.0, body.mass * machine.gravity)
            moment = moment - body.mass * machine.gravity * at.x
        power = ob.drive_power(s, scene) + ob.load_power(s, scene)
        power -= ob.contact_loss(s, scene) + ob.friction_loss(s, scene)
        power -= ob.support_loss(s, scene)
        size = jnp.abs(force.array()).sum() + ob.foundation_force(s, scene)
        return jnp.stack(change), jnp.stack([force.x, force.y, moment, power]), size

    change, outside, size = found(scene)
    # Forces at arms of a metre and at speeds of metres a second; q'' of the nine coordinates is
    # known to 1e-10 of the contact's forces.
    allowed = (1e-9 if formulation == "multiplier" else 1e-11) * float(size)
    np.testing.assert_allclose(change, outside, rtol=0, atol=10 * allowed)


@pytest.mark.parametrize("kind", ["paper", "all loose"])
def test_formulations_agree(kind):
    @eqx.filter_jit
    def observe(scene):
        s = instant(scene)
        return {name: OBSERVABLES[name](s, scene) for name in observables_of(scene)}

    one, other = (observe(scene_of(kind, name)) for name in ("eccentricity", "multiplier"))
    assert "left_force" in one
    for name in set(one) - {"constraint_residual"}:
        scale = np.abs(one[name]).max()
        # As without a frame: e is a difference of positions of 0.6 m.
        np.testing.assert_allclose(other[name], one[name], rtol=0, atol=1e-8 * scale + 1e-11)


def test_force_on_the_frame_is_what_pushes_it():
    """Bearing, pivot, load, drive and supports give the frame alone its acceleration."""
    scene = scene_of("paper")
    s = eqx.filter_jit(instant)(scene)
    foundation, frame = scene.supports, s.frame
    pushes = {
        "bearing": (scene.machine.bearing, -ob.bearing_reaction(s, scene)),
        "pivot": (Vector(0.0, 0.0), -ob.toggle_reaction(s, scene)),
        "fixed jaw": (ob.jaw_mass_centre(s, scene), -s.applied.load.force),
    }
    force = Vector(0.0, -foundation.mass * 9.81).seen_from(frame.axis)
    moment = -ob.drive_torque(s, scene)
    on_ground = foundation.support_forces(frame)
    for arm, one in zip(foundation.arms(), on_ground, strict=True):
        pushes[f"support {len(pushes)}"] = foundation.point + arm, -one.seen_from(frame.axis)
    for at, push in pushes.values():
        force = force + push
        moment = moment + (at - foundation.point).cross(push)
    expected = s.accelerations.centres["frame"]
    size = float(ob.foundation_force(s, scene)) + 1e6
    # Rounding of forces of 1e6 N.
    np.testing.assert_allclose(force.array(), (2000.0 * expected).array(), atol=1e-11 * size)
    assert float(moment) == pytest.approx(
        900.0 * float(s.accelerations.spin_ups["frame"]), abs=1e-11 * size
    )


def test_start_is_at_rest_on_the_springs():
    """All weight hangs in the springs: by the lever rule, in small rotations of 1e-4."""
    scene = jc.build_scene({**NUMBERS, "joint": "ideal"})
    s = scene.formulation.snapshot(jnp.array(0.0), scene.formulation.initial(scene), scene)
    left, right = (force(s, scene) for force in (ob.left_force, ob.right_force))
    places = [s.motion.centre(name) for name in scene.linkage.bodies.names]
    masses = [2000.0, *(float(body.mass) for body in scene.linkage.bodies.values)]
    at = np.array([0.3, *(float(place.x) for place in places)])
    lever = 9.81 * np.sum(masses * (at + 0.6)) / 1.4
    assert float(right.y) == pytest.approx(-lever, rel=1e-3)
    assert float(left.y) == pytest.approx(-9.81 * sum(masses) + lever, rel=1e-3)
    np.testing.assert_allclose(left.x + right.x, 0, atol=1e-3 * lever)
    assert float(s.frame.spin) == 0 and float(s.frame.velocity.y) == 0


def test_a_clamped_frame_traces_nothing_of_supports():
    for values in ({}, {"joint": "ideal"}, {"formulation": "multiplier"}):
        clamped = field_operations(jc.build_scene(values))
        assert field_operations(jc.build_scene({**values, "foundation.x": 0.3})) == clamped
        assert field_operations(jc.build_scene({**values, **NUMBERS})) > 1.3 * clamped
    state = jc.build_scene({}).formulation.initial(jc.build_scene({}))
    assert len(jax.tree.leaves(state)) == 4 and state.frame is None


@pytest.mark.parametrize("name", ["left_force", "transmitted_force", "frame_rotation"])
def test_a_clamped_frame_has_no_supports(name):
    with pytest.raises(ValueError, match=rf"must not ask for {name} of a clamped frame"):
        jc.simulate(jc.ideal_scene(30.0), [0.0, 0.1], outputs=(name,))
    orbit = jc.periodic_orbit(jc.ideal_scene(30.0))
    assert name not in orbit.motion(np.zeros(1)) and "transmitted_rms" not in orbit.values


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"foundation.left": 1.0}, "`foundation.left` must be less than foundation.right"),
        ({"foundation.vertical_stiffness": 0.0}, "`foundation.vertical_stiffness` must be"),
        ({"foundation.mass": -1.0}, "`foundation.mass` must be"),
        ({"foundation.vertical_damping": -1.0}, "`foundation.vertical_damping` must lie"),
    ],
)
def test_refused(values, message):
    with pytest.raises(ValueError, match=message):
        jc.build_scene({**NUMBERS, **values})


def test_numbers_of_supports_come_with_the_mass():
    for name in NUMBERS.keys() - {"foundation.mass", "foundation.x", "foundation.y"}:
        with pytest.raises(ValueError, match=f"`{name}` must come with `foundation.mass`"):
            jc.build_scene({name: NUMBERS[name]})
