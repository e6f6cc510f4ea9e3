"""A frame on supports at an instant: momentum, power, formulations, and what is refused."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.mechanism import observables as general
from jaxcrusher.mechanism.drives import GivenTorque
from jaxcrusher.mechanism.multiplier import MultiplierFormulation
from tests.crusher.kinds import check_laws, moving, placed
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
ROCKING = {"foundation.rocking_damping": 3e4}
LOOSE = {f"{joint}.clearance": 1e-4 for joint in ("elbow", "pivot")}
KINDS = {
    "ideal": {"joint": "ideal"},
    "paper": {"slip": "surface", "load_law": "normal_to_jaw"},
    "all loose": {"slip": "surface", **LOOSE, "load_law": "closing_stroke"} | ROCKING,
}


def scene_of(kind, formulation="eccentricity", free=False):
    scene = jc.build_scene({**NUMBERS, **KINDS[kind], "counterweight.mass": 20.0})
    if kind != "ideal":
        # In hard contact, sliding.
        scene = placed(scene, ((-0.9, -0.6), (0.5, 0.9)))
    if formulation == "multiplier":
        scene = eqx.tree_at(lambda s: s.formulation, scene, MultiplierFormulation())
    if free:
        scene = eqx.tree_at(lambda s: s.drive, scene, GivenTorque(300.0, 30.0))
    return scene


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
def test_energy_and_the_force_on_the_frame(kind, formulation, free):
    """Bearing, pivot, load, drive and supports give the frame alone its acceleration."""
    check_laws(scene_of(kind, formulation, free))


@pytest.mark.parametrize(("kind", "formulation", "free"), [*CASES, *slow(*REST)])
def test_what_excites_a_frame_is_the_momentum_past_it(kind, formulation, free):
    """Its loss is the force on a frame at rest; about G the bodies' weight has a moment besides."""
    scene = scene_of(kind, formulation, free)

    @eqx.filter_jit
    def both():
        formulation, state, point = scene.formulation, moving(scene), scene.foundation.point

        def momentum(time, state):
            motion = formulation.snapshot(time, state, scene).motion
            total, turning = jnp.zeros(2), 0.0
            for name, body in scene.linkage.bodies.items():
                arm, own = motion.centre(name) - point, body.mass * motion.centre_velocity(name)
                total = total + own.array()
                spin = motion.spin(name)
                turning = turning + arm.cross(own)
                turning = turning if spin is None else turning + body.inertia * spin
            return total, turning

        time = jnp.array(0.1)
        s = formulation.snapshot(time, state, scene)
        rate = formulation.rate(s, state, scene)
        _, (force, moment) = jax.jvp(momentum, (time, state), (jnp.array(1.0), rate))
        levers = [
            body.mass * (s.motion.centre(name) - point).x
            for name, body in scene.linkage.bodies.items()
        ]
        found = general.exciting_force(s, scene).array(), general.exciting_moment(s, scene)
        return found, (-force, -moment - scene.linkage.gravity * sum(levers))

    found, expected = both()
    # Rounding of forces that contacts and Baumgarte's terms make larger than these.
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-9)
    np.testing.assert_allclose(found[1], expected[1], rtol=1e-9)


def test_start_is_at_rest_on_the_springs():
    """All weight hangs in the springs: by the lever rule, in small rotations of 1e-4."""
    scene = jc.build_scene({**NUMBERS, "joint": "ideal"})
    s = scene.formulation.snapshot(jnp.array(0.0), scene.formulation.initial(scene), scene)
    left, right = (general.support_force(s, scene, side) for side in ("left", "right"))
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
    with pytest.raises(ValueError, match=rf"must ask for {name} only of a scene with supports"):
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
