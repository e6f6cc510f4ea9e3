"""Verdicts on motions whose kind is known, and on evidence that does not agree."""

from types import SimpleNamespace

import equinox as eqx
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.plane import Vector, scalar
from jaxcrusher.dynamics import regime as module
from jaxcrusher.mechanism.starts import shifted_start
from jaxcrusher.motion.tangents import SLICES


# With the load on the closing stroke only the pin flies: windows of short periods, and chaos, which
# the gradient report's test looks at.
@pytest.mark.slow
@pytest.mark.optimised
def test_period_one_of_the_closing_stroke():
    scene = jc.paper_scene(35.0, 0.12e-3, load_law="closing_stroke")
    found = jc.regime(scene, 100, 300, tangent_turns=30)
    assert (found.name, found.period) == ("periodic", 1), str(found)
    # The frame's alignment costs about one part in the number of turns, 30.
    assert found.exponents.exponents[0] == pytest.approx(-0.498, abs=0.05)


@pytest.mark.slow
def test_swing_that_decays_has_not_settled():
    # Off its rest in the bore, and without impacts: no two machines swing differently.
    scene = shifted_start(jc.paper_scene(30.0, 0.06e-3, start="contact"), Vector(-0.2, 0.0))
    found = jc.regime(scene, 5, 200, tangent_turns=20, rtol=1e-8)
    assert found.name == "not settled" and found.trend < -0.05, str(found)


@pytest.mark.slow
def test_swing_that_hardly_decays_has_not_settled():
    """In 40 turns it loses a quarter of a per cent, which no indicator tells from a torus."""
    scene = shifted_start(jc.paper_scene(30.0, 0.06e-3, start="contact"), Vector(-0.005, 0.0))
    found = jc.regime(scene, 5, 40, tangent_turns=20)
    assert abs(found.trend) < 0.05
    assert found.name == "not settled" and "a swing dies in 1.43e+04 turns" in str(found), str(
        found
    )
    assert "largest multiplier is 1 - 7e-05" in str(found)


@pytest.mark.usefixtures("unchecked")  # stand-ins for sections
@pytest.mark.parametrize(("growth", "name"), [(0.1, "undecided"), (2.0, "chaotic")])
def test_few_points_have_no_zero_one_test(growth, name):
    """Of twenty points of a torus it is 1, as of chaos; a swing may grow by 0.1 a turn for long."""
    angle = 2.4 * np.arange(20)
    points = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    summary = SimpleNamespace(success=True, whirl=False, state=points[-1])
    record = SimpleNamespace(states=points, statistics=summary)
    grown = np.exp(growth / SLICES + 1e-3 * np.random.default_rng(0).normal(size=20 * SLICES))
    along = SimpleNamespace(jacobians=grown[:, None, None] * np.diag([1.0, 0.5]))
    found = module.judged(record, 1e-10, lambda _: along, lambda: None)
    assert found.name == name and found.zero_one is None
    assert "no 0-1 test of fewer than 200 points" in str(found)


def test_whirl_and_failure_are_named():
    # At 0.06 mm rounding may decide: see docs/attacks.md on the README's example.
    scene = jc.paper_scene(30.0, 0.12e-3, slip="surface")
    found = jc.regime(scene, 10, 20, rtol=1e-8)
    assert found.name == "whirl" and "round its bore" in str(found)
    broken = eqx.tree_at(lambda s: s.linkage.gravity, scene, scalar(np.nan))
    found = jc.regime(broken, 1, 20)
    assert found.name == "failed" and "stopped at 0 rad" in str(found)


def test_a_failure_is_told_by_the_angle_since_the_start(monkeypatch):
    turn, calls = module.poincare_section, []

    def failing(scene, *how, state, **more):
        calls.append(state)
        state = state if len(calls) < 3 else np.nan * state
        return turn(scene, *how, state=state, **more)

    monkeypatch.setattr(module, "poincare_section", failing)
    found = jc.regime(jc.paper_scene(30.0, 0.06e-3, start="contact"), 0, 20)
    assert found.name == "failed" and "stopped at 12.5664 rad" in str(found)


def test_fewer_turns_than_show_a_trend_are_refused_before_any_is_computed(monkeypatch):
    monkeypatch.delattr(module, "poincare_section")
    with pytest.raises(ValueError, match=r"`turns` must be a whole number >= 20, but is 19\.$"):
        jc.regime(jc.paper_scene(30.0, 0.06e-3), 0, 19)
