"""What results say of themselves at a prompt and in a notebook, also where JAX traces them."""

import dataclasses
import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics import integrate
from jaxcrusher.basics.integrate import Outcome
from jaxcrusher.crusher.capacity import CrushingChamber
from jaxcrusher.dynamics.coexisting_orbits import CoexistingOrbits
from jaxcrusher.dynamics.judgement import Slope
from jaxcrusher.dynamics.regime import Regime
from jaxcrusher.dynamics.slopes import GradientReport
from jaxcrusher.files.summary import MOST_LINES, WIDEST, Row, Summarised, Summary, value_text
from jaxcrusher.joint.validity import Validity
from jaxcrusher.motion.section import Section
from jaxcrusher.motion.simulation import Energy, Trajectory
from jaxcrusher.orbits.result import RESULTS, WAYS, built
from jaxcrusher.sheets.feed_response import FeedResponse
from jaxcrusher.sheets.wear import Wear
from tests.told import check_told

SCENE = jc.paper_scene(30.0, 0.06e-3, start="contact")
FEW = ("foundation_rms", "shaking_rms")


@pytest.fixture(scope="module")
def orbit():
    """Of made-up numbers: a pin that presses to the left of its bore, known to a millionth."""
    path = 1.05 * jnp.array([[-1.0, 0.0], [-0.8, 0.6], [-1.0, 0.0], [-0.8, -0.6]])
    values = dict.fromkeys(SCENE.statistics, jnp.asarray(0.05)) | {
        "foundation_rms": jnp.asarray(19102.3456789)
    }
    return built(
        SCENE,
        1,
        path,
        jnp.array([-1.05, 0.0, 0.0, 0.0]),
        values,
        result=RESULTS.successful,
        error=jnp.asarray(1e-6),
        least_penetration=jnp.asarray(0.03),
        multipliers=jnp.array([0.5, 0.5j, -0.5j, 0.0]),
        multipliers_error=1e-5,
        way=WAYS.rest,
    )


@pytest.fixture(scope="module")
def statistics():
    """Of a motion that shows what ideal joints do, but for turns that scatter by 1 %."""
    found = jc.statistics(jc.ideal_scene(30.0), 0, 2, outputs=FEW)
    by_turn = {name: value * jnp.array([0.99, 1.01]) for name, value in found.values.items()}
    return dataclasses.replace(found, by_turn=by_turn)


def test_machines_and_scenes():
    check_told(jc.paper_machine(), "speed", "30 rad/s (286.5 rpm)", "524 kg", "and 13 more")
    check_told(jc.read_machine("examples/pump.toml"), "joints.B.clearance", "0.05 mm")
    check_told(SCENE, "1 with clearance", "clearance 0.06 mm", "30 rad/s", "jaw 524 kg", "clamped")
    check_told(jc.ideal_scene(30.0), "all ideal")
    check_told(CrushingChamber(), "600 mm", "m3/h", pictures=0)
    assert repr(jc.Method()) == "Method()"


def test_statistics(statistics):
    check_told(statistics, "2 turns", "inside the contact model", "RMS of |R_O| + |R_C|")
    error = float(statistics.error("foundation_rms")) / 1e3
    assert 0.1 < error < 1  # which two digits of a kN tell
    assert re.search(rf"foundation_rms +19\.10 ± {error:.2g} kN ", repr(statistics))
    unknown = dataclasses.replace(statistics, validity=Validity(missing=("impact_speed",)))
    first, *_ = repr(unknown).splitlines()
    assert first.endswith(
        "NOT KNOWN to be inside the contact model: not known without impact_speed"
    )
    stopped = Outcome(integrate.RESULTS.max_steps_reached, jnp.asarray(0.5), jnp.asarray(10))
    failed = dataclasses.replace(statistics, outcome=stopped)
    check_told(failed, pictures=0)
    assert repr(failed).startswith("Statistics FAILED: stopped at 0.5 rad of phase: The bound")


def test_motions(statistics):
    times, outcome = jnp.linspace(0, 0.2, 5), statistics.outcome
    energy = Energy(*[times] * 7)
    values = {
        "foundation_force": 1e3 + 1e4 * times,
        "eccentricity": jnp.full((5, 2), 3e-5),
        "penetration_ratio": jnp.full(5, -0.5),
        "energy": energy,
    }
    motion = Trajectory(times, outcome, values, tuple(SCENE.observables.items()))
    words = "5 times from 0 to 0.2 s", "1 to 3 kN, shape (5,)", "|R_O| + |R_C|", "balanced to"
    check_told(motion, *words, pictures=2)
    check_told(energy, "drive_work", "0 to 0.2 J, shape (5,)", pictures=0)
    known = tuple(SCENE.statistics.items())
    section = Section(times[:, None], jnp.zeros((0, 1, 1)), outcome, {"winding": times}, known)
    check_told(section, "5 turns", "shape (5, 1)", "revolutions round the bore", pictures=0)


def test_orbits(orbit):
    check_told(orbit, "stable", "each turn", "inside the contact model", pictures=2)
    assert re.search(r"foundation_rms +19\.1023 ± 1\.9e-05 kN +RMS of", repr(orbit))
    assert re.search(r"largest_multiplier +0\.500000 ± 0\.000010\n", repr(orbit))
    outside = dataclasses.replace(orbit, validity=Validity(clearance_ratio=jnp.asarray(0.5)))
    first, *_ = repr(outside).splitlines()
    assert "repeats each turn, OUTSIDE the contact model: clearance 0.5" in first
    unstable = dataclasses.replace(orbit, multipliers=orbit.multipliers + 1)
    assert repr(unstable).startswith("PeriodicOrbit: UNSTABLE, ")
    assert "Its largest multiplier is 1.5: disturbances grow to one side." in repr(unstable)
    none = dataclasses.replace(orbit, result=RESULTS.contact_lost)
    check_told(none, pictures=0)
    assert repr(none).startswith("PeriodicOrbit FAILED: The motion loses contact")
    known = CoexistingOrbits((orbit,), np.zeros((2, 4)), np.array([0, -1]), {"not settled": 0.5})
    check_told(known, "1 stable orbits, 2 starts", "50%", " N, ", "50% not settled")


def test_a_batch_says_how_many_and_the_range(orbit, statistics, unchecked):
    many = jax.tree.map(lambda leaf: jnp.stack([leaf, 2 * leaf]), statistics.values)
    outcome = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), statistics.outcome)
    both = dataclasses.replace(statistics, values=many, outcome=outcome)
    check_told(both, "a batch of 2: 0 FAILED", "19.1 to 38.2 kN, shape (2,)", pictures=0)
    other = dataclasses.replace(orbit, result=RESULTS.contact_lost)
    orbits = jax.tree.map(lambda *leaves: jnp.stack(leaves), orbit, other)
    check_told(orbits, "a batch of 2: 1 FAILED, 1 stable", "shape (2,)", pictures=0)


def test_verdicts():
    periodic = Regime("periodic", ("it repeats",), 1)
    check_told(periodic, "Regime: period 1", "it repeats", pictures=0)
    assert repr(Regime("failed", ("why",))).startswith("Regime FAILED\n")
    slope = Slope("speed", "implicit", 220.134, 0.012, 0.0, "refused", ("why",), {})
    slopes = {"speed": slope, "clearance": dataclasses.replace(slope, verdict="ok", reasons=())}
    units = {"speed": "N/(rad/s)"}
    report = GradientReport("foundation_rms", periodic, 10, (0.5, 0.1), slopes, units)
    words = "220.134 ± 0.012 N/(rad/s)", "refused, implicit", "speed: why", "period 1"
    check_told(report, *words, pictures=0)
    assert repr(report).startswith("GradientReport of foundation_rms: NOT every slope is ok\n")
    angle, one = jnp.linspace(0, 6, 12), jnp.ones(())
    wear = Wear(angle, 1e-12 * jnp.ones(12), 1e-12 * jnp.ones(12))
    check_told(wear, "bore:", "mm in 1000 h")
    feed = FeedResponse(angle, jnp.ones((12, 2)), 1e3 + angle, 25 * one, 19e3 * one, one, one)
    check_told(feed, "25 N", "19 kN", "1 to 1.006 kN, shape (12,)")
    unknown = FeedResponse(*[jnp.nan * leaf for leaf in jax.tree.leaves(feed)])
    assert repr(unknown).startswith("FeedResponse: FAILED")


def test_what_jax_traces_is_said_in_a_line(orbit, statistics):
    """Nothing is raised by what JAX puts in place of numbers, or by a name that is missing."""
    for told in (SCENE, orbit, statistics, CrushingChamber()):
        line = f"{type(told).__name__}, whose numbers JAX traces or has replaced"
        seen = []
        jax.eval_shape(lambda one: seen.append((repr(one), one._repr_html_())), told)  # noqa: B023
        numbers, others = eqx.partition(told, eqx.is_inexact_array)
        seen += [(repr(one), one._repr_html_()) for one in (others, jax.tree.map(bool, others))]
        assert seen[0][0].startswith(line) and line in seen[0][1]
        assert all(len(text.splitlines()) <= MOST_LINES for text, _ in seen)
        # It is the same PyTree as ever.
        assert eqx.tree_equal(eqx.combine(numbers, others), told)


def test_what_is_long_is_cut():
    class Long(Summarised):
        def _summary(self):
            rows = [
                Row(f"name_{i}", value_text(np.full(3, np.nan), "N"), "word " * 50)
                for i in range(99)
            ]
            return Summary("title " * 30 + "<&>", rows, ("remark " * 400,))

        def _picture(self):
            raise ValueError

    text = repr(Long())
    check_told(Long(), "name_0", "no value, shape (3,), 3 without a value", pictures=0)
    assert len(text.splitlines()) == MOST_LINES
    assert max(map(len, text.splitlines())) <= WIDEST
    assert re.search(r"and \d\d more", text)


@pytest.mark.parametrize("kind", [jc.Scene, CrushingChamber, FeedResponse, Wear])
def test_no_number_is_added(kind):
    assert not {"picture", "summary"} & {one.name for one in dataclasses.fields(kind)}
