"""The tension rod: energy, momentum, slackness, and what it is for."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.mechanism.acting import spring_loss
from jaxcrusher.scenes.parameters import PARAMETERS
from tests.crusher.kinds import KINDS, at_start, check_laws, sliding
from tests.crusher.operations import field_operations
from tests.differences import assert_slopes
from tests.pairs import crossed

ROD = {"rod.stiffness": 3e5, "rod.preload": 2e4, "rod.damping": 2e3}


def scene_of(kind, **values):
    return sliding(kind, **(ROD | values))


BARE = {"rod.stiffness": 0.0, "rod.damping": 0.0, "rod.preload": 5e3}
STAND = {"foundation.mass": 2000.0, "foundation.x": 0.3, "foundation.y": 0.2}


@pytest.mark.parametrize(
    ("kind", "rod", "stand"),
    crossed(KINDS, (ROD, BARE), ({"foundation.x": 0.3}, STAND), later=["all by multipliers"]),
)
def test_what_it_does_to_energy_and_frame(kind, rod, stand):
    """Spring and damper take what its force does, and its frame end is pulled, clamped or not."""
    scene = scene_of(kind, load_law="normal_to_jaw", load_point=0.3, **rod, **stand)
    check_laws(scene)
    lost = float(spring_loss(at_start(scene), scene))
    assert lost > 1 if scene.springs[0].damping > 0 and kind != "ideal" else lost >= 0


def test_its_frame_end_is_by_default_behind_and_below_the_seat_of_the_toggle():
    assert PARAMETERS["rod.x"].default < 0 and PARAMETERS["rod.y"].default < 0


def test_tension_is_preload_where_it_was_set():
    """At phase 0 with ideal joints, whatever the stiffness; elsewhere by the length."""
    scene = jc.build_scene({"joint": "ideal", **ROD, "rod.damping": 0.0})
    times = np.array([0.0, 0.03, 0.11])
    names = ("rod_tension", "pin_position", "jaw_position")
    motion = jc.simulate(scene, times, outputs=names)
    pin, end = (np.asarray(motion[name]) for name in names[1:])
    axis = (pin - end) / 0.695
    across = np.stack([axis[:, 1], -axis[:, 0]], 1)
    at_jaw = pin - 0.65 * axis - 0.05 * across
    length = np.linalg.norm(at_jaw - [-0.3, -0.15], axis=1)
    expected = 2e4 + 3e5 * (length - length[0])
    assert np.ptp(expected) > 500
    # Sums of lengths of a metre, times the stiffness.
    np.testing.assert_allclose(motion.rod_tension, expected, rtol=0, atol=1e-8)


def test_a_slack_rod_is_told_and_pulls_no_more():
    """Its spring's work over a turn is zero all the same."""
    slack = {"rod.stiffness": 3e5, "rod.preload": 300.0, "joint": "ideal"}
    scene = jc.build_scene(slack)
    found = jc.statistics(scene, 0, 1)
    assert float(found.rod_tension_least) < -100
    assert "slack" in found.validity.verdict() and not bool(found.validity.inside)
    times = np.linspace(0, 2 * np.pi / 30.0, 129)
    motion = jc.simulate(scene, times, outputs=("rod_tension", "energy"))
    assert float(motion.rod_tension.min()) == 0 < float(motion.rod_tension.max())
    # Integrated to 1e-11 of energies of some 100 J.
    assert float(jnp.abs(motion.energy.imbalance).max()) < 1e-6
    taut = jc.periodic_orbit(jc.build_scene(slack | {"rod.preload": 5e3}))
    assert bool(taut.validity.inside) and float(taut.rod_tension_least) > 0


def test_without_stiffness_and_preload_nothing_is_traced():
    plain = jc.build_scene({})
    assert plain.springs == () and "rod_tension" not in plain.observables
    assert field_operations(jc.build_scene(ROD)) > field_operations(plain)
    for name in ("rod.damping", "rod.x", "rod.jaw_along"):
        with pytest.raises(ValueError, match=f"`{name}` must come with `rod.stiffness`"):
            jc.build_scene({name: 0.1})
    with pytest.raises(ValueError, match="ask for rod_tension only of a scene with a spring"):
        jc.simulate(plain, [0.0, 0.1], outputs=("rod_tension",))


@pytest.mark.slow
def test_it_keeps_the_toggle_in_its_seats_and_its_slope_says_how():
    """At idle B and C open without it; with it they stay closed, more by more preload."""
    idle = {"load_law": "none", "start": "contact", "joint": "ideal"}
    seats = {f"{joint}.clearance": 5e-5 for joint in ("elbow", "pivot")}

    def least(preload):
        described = idle | seats | {"rod.preload": preload, "rod.stiffness": 1e5}
        return jc.periodic_orbit(jc.build_scene(described)).least_penetration

    # The least is one of samples: differences over 100 N see it move along the turn.
    assert float(least(1.5e4)) > 0 and assert_slopes(least, 1.5e4, 50.0, rtol=1e-3) > 0
