"""Slopes that may be believed, slopes that must be refused."""

import diffrax
import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.gradient import fit_slopes, gradient_report, judge
from jaxcrusher.orbit import periodic_orbit, periodic_slopes
from jaxcrusher.plane import Vector
from jaxcrusher.starts import Given


def test_fit_of_lorenz():
    """d<z>/drho of the chaotic Lorenz system is about 1.0; its tangent is astronomic."""

    @eqx.filter_jit
    def mean_z(case):
        rho = case["point"][0]

        def field(t, y, args):
            x = y[:3]
            rate = [10 * (x[1] - x[0]), x[0] * (rho - x[2]) - x[1], x[0] * x[1] - 8 / 3 * x[2]]
            return jnp.stack([*rate, jnp.where(t > 10, x[2], 0.0)])

        start = jnp.array([1.0, 1.0, 20.0, 0.0]).at[:2].add(case["shift"])
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field), diffrax.Tsit5(), 0.0, 110.0, 0.01, start,
            stepsize_controller=diffrax.PIDController(rtol=1e-6, atol=1e-6), max_steps=100_000,
        )  # fmt: skip
        return solution.ys[0, 3] / 100

    slopes, errors = fit_slopes(mean_z, np.array([28.0]), np.array([2.0]), 32, 0, shift=0.5)
    assert slopes[0] == pytest.approx(1.0, rel=0.05)
    assert errors[0] < 0.05


def closing(point):
    return jc.paper_scene(point[0], point[1], load="closing_stroke")


def quiet(point):
    return jc.paper_scene(point[0], point[1], start="contact")


@pytest.mark.parametrize(
    "build, point, settle", [(closing, [35.0, 0.12e-3], 100), (quiet, [30.0, 0.06e-3], 1)]
)
def test_slopes_along_a_periodic_orbit(build, point, settle):
    """The implicit formula against differences of orbits, in both parameters."""
    point = jnp.array(point)
    guess = jc.poincare_section(build(point), settle, 1).states[-1]

    def rms(point):
        orbit = periodic_orbit(build(point), guess, 1)
        assert orbit is not None
        start = Given(Vector(orbit[0], orbit[1]), Vector(orbit[2], orbit[3]))
        placed = eqx.tree_at(lambda s: s.start, build(point), start)
        result = jc.statistics(placed, 0, 1, outputs=("foundation_rms",), rtol=1e-11)
        return float(result.foundation_rms)

    orbit = periodic_orbit(build(point), guess, 1)
    slopes = periodic_slopes(build, point, "foundation_rms", orbit, 1)
    for i, step in enumerate((1e-2, 1e-6 if build is quiet else 1e-8)):
        shift = step * jnp.eye(2)[i]
        difference = (rms(point + shift) - rms(point - shift)) / (2 * step)
        # What was promised; measured: 1e-4, but 6e-3 by speed with the closing stroke, where a
        # step of 0.01 rad/s is already curved.
        assert slopes[i] == pytest.approx(difference, rel=1e-2 if build is closing else 5e-3)


def test_quiet_motion_is_believed():
    report = gradient_report(
        lambda speed, clearance: jc.paper_scene(speed, clearance, start="contact"),
        "foundation_rms", {"speed": 30.0, "clearance": 0.06e-3}, settle_turns=2, turns=6,
    )  # fmt: skip
    assert report.usable, str(report)
    speed, clearance = report.slopes["speed"], report.slopes["clearance"]
    # Differences over 15 turns, 2-8 um apart, gave 220.13 and 51 218 to 51 238.
    assert speed.value == pytest.approx(220.13, rel=1e-3)
    assert clearance.value == pytest.approx(51_228, rel=5e-3)


def test_chaos_is_refused():
    report = gradient_report(
        lambda speed: jc.paper_scene(speed, 0.06e-3, load="closing_stroke"),
        "foundation_rms", {"speed": 30.0}, settle_turns=20, turns=5, pairs=4,
    )  # fmt: skip
    slope = report.slopes["speed"]
    assert report.regime.name == "chaotic" and not report.usable, str(report)
    assert slope.verdict == "refused" and slope.reasons
    # What a plain derivative would have handed out.
    tangent = slope.estimates["tangent"][0]
    assert not abs(tangent) < 1e6


def test_whirl_is_refused_without_a_number():
    report = gradient_report(
        lambda speed: jc.paper_scene(speed, 0.06e-3, slip="surface"),
        "foundation_rms", {"speed": 30.0}, settle_turns=10, turns=5,
    )  # fmt: skip
    slope = report.slopes["speed"]
    assert slope.verdict == "refused" and np.isnan(slope.value) and "whirl" in str(report)


FIT = {"fit": (10.0, 0.5), "fit at half the radius": (10.2, 0.9)}


@pytest.mark.parametrize(
    "estimates, growth, chaotic, verdict",
    [
        (FIT, 100.0, True, "ok"),
        (FIT | {"fit": (10.0, 4.0)}, 100.0, True, "refused"),
        (FIT | {"fit at half the radius": (20.0, 1.0)}, 100.0, True, "refused"),
        (FIT | {"tangent": (10.1, 0.0)}, 0.0, False, "ok"),
        (FIT | {"tangent": (10.1, 0.0)}, 5.0, False, "refused"),
        (FIT | {"tangent": (30.0, 0.0)}, 0.0, False, "refused"),
        (FIT | {"tangent": (np.nan, 0.0)}, 0.0, False, "refused"),
        (FIT | {"implicit": (30.0, 0.0)}, 0.0, False, "doubtful"),
        (FIT | {"implicit": (10.1, 0.0)}, 0.0, False, "ok"),
    ],
)
def test_verdicts(estimates, growth, chaotic, verdict):
    """A slope that is precise and wrong (the tangent of 30 ± 0) is caught by the fit."""
    slope = judge("speed", estimates, growth, chaotic, 0.3)
    assert slope.verdict == verdict
    assert bool(slope.reasons) == (verdict != "ok")


def test_unknown_metric():
    with pytest.raises(ValueError, match=r"^Argument `metric` must be one of 'foundation_rms'"):
        gradient_report(lambda speed: jc.ideal_scene(speed), "noise", {"speed": 30.0})
