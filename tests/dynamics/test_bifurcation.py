"""Diagrams on a range with one orbit, a state that is handed on, values that are no points."""

from pathlib import Path

import diffrax
import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.integrate import RESULTS, Outcome
from jaxcrusher.crusher.template import STATISTIC
from jaxcrusher.dynamics.bifurcation import _row, bifurcation
from jaxcrusher.motion.flow import initial_state
from jaxcrusher.motion.section import Section

# With the closing stroke's load one orbit of period 1, with an exponent of -0.5 a turn: 30 turns
# leave exp(-15) of a start. (At 35.1 rad/s the period has doubled.)
SPEEDS = [34.9, 34.95, 35.0]
COUNTS = {"settle_turns": 30, "turns": 20}
EXAMPLES = Path(__file__).parents[2] / "examples"
KEYS = ["e_x", "e_y", "rate_x", "rate_y"]


def scene(speed):
    return jc.paper_scene(speed, 0.12e-3, load_law="closing_stroke")


def broken(speed):
    gravity = jnp.array(jnp.nan if speed == 34.95 else 9.81)
    return eqx.tree_at(lambda s: s.linkage.gravity, scene(speed), gravity)


def points(diagram, speed):
    return np.stack([diagram[key].sel(value=speed).to_numpy() for key in KEYS], axis=-1)


# Sections of cold starts come from a batch, in NumPy's arrays.
@pytest.mark.slow
@pytest.mark.usefixtures("unchecked")
def test_directions_agree_on_a_quiet_range_and_hand_the_state_on():
    up, down, cold = (
        bifurcation(scene, "speed", SPEEDS, direction=one, **COUNTS)
        for one in ("up", "down", "cold")
    )
    assert up.sizes == {"value": 3, "turn": 20} and up.value.units == "rad/s"
    for one in (up, down, cold):
        assert one.success.all() and (one.period == 1).all() and not one.whirl.any()
        for speed in SPEEDS:
            # The tolerance is 1e-9, and some thousand steps lie in an orbit's memory.
            apart = points(one, speed)[-1] - points(cold, speed)[-1]
            assert np.abs(apart).max() < 1e-5
    state = jnp.asarray(points(up, 34.9)[-1])
    outputs = ("foundation_rms", "contact_fraction", "winding")
    further = jc.poincare_section(scene(34.95), 30, 20, state=state, outputs=outputs)
    np.testing.assert_array_equal(points(up, 34.95), further.states)
    assert np.abs(points(up, 34.95)[0] - points(cold, 34.95)[0]).max() > 1e-9

    # A failure is no point, and the next value starts afresh.
    found = bifurcation(broken, "speed", SPEEDS, **COUNTS)
    assert list(found.success.values) == [True, False, True]
    assert np.isnan(points(found, 34.95)).all() and not found.settled.sel(value=34.95)
    start = initial_state(scene(35.0))
    fresh = jc.poincare_section(scene(35.0), 30, 20, state=start, outputs=outputs)
    np.testing.assert_array_equal(points(found, 35.0), fresh.states)


def test_a_whirl_is_no_point():
    turns = jnp.ones(20)
    outcome = Outcome(RESULTS.promote(diffrax.RESULTS.successful), jnp.zeros(()), jnp.array(0))

    def found(winding):
        values = {"foundation_rms": turns, "contact_fraction": turns, "winding": winding * turns}
        known = tuple(STATISTIC.items())
        return Section(jnp.zeros((20, 4)), jnp.zeros((0, 4, 4)), outcome, values, known)

    row = _row(found(-100), "foundation_rms", [0, 1, 2, 3], 1e-9)
    assert row["whirl"] and np.isnan(row["e_x"]).all() and np.isnan(row["foundation_rms"]).all()
    assert not _row(found(1), "foundation_rms", [0, 1, 2, 3], 1e-9)["whirl"]


def test_bad_arguments():
    with pytest.raises(ValueError, match=r"^Argument `values` must have shape \(n,\), n > 0, and"):
        bifurcation(scene, "speed", [35.0, 34.0], settle_turns=1, turns=20)
    with pytest.raises(ValueError, match=r"^Argument `turns` must be a whole number >= 20"):
        bifurcation(scene, "speed", [35.0], settle_turns=1, turns=5)
    with pytest.raises(ValueError, match=r"^Argument `machine` must have clearance, and the ecc"):
        bifurcation(jc.ideal_scene, "speed", [35.0], settle_turns=1, turns=20)


def test_a_diagram_of_a_linkage_has_its_leading_statistic():
    """What shakes the ground, of the turns of its section."""
    machine = jc.read_machine(EXAMPLES / "slider_crank.toml")
    found = bifurcation(machine, "speed", [200.0, 210.0], settle_turns=1, turns=20)
    assert found.success.all() and "foundation_rms" not in found
    assert found.value.units == "rad/s"
    assert found.shaking_rms.units == "N" and found.shaking_rms.dims == ("value", "turn")
    outputs = ("shaking_rms", "B_contact_fraction", "B_winding")
    first = machine.scene(speed=200.0)
    state = initial_state(first)
    first = jc.poincare_section(first, 1, 20, state=state, outputs=outputs)
    np.testing.assert_array_equal(found.shaking_rms.sel(value=200.0), first["shaking_rms"])
    np.testing.assert_array_equal(points(found, 200.0), first.states[:, :4])
