"""Slopes that may be believed, slopes that must be refused."""

import diffrax
import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.crusher.template import STATISTIC
from jaxcrusher.dynamics import slopes
from jaxcrusher.dynamics.judgement import judge
from jaxcrusher.dynamics.slopes import fit_slopes, gradient_report
from jaxcrusher.motion import method
from jaxcrusher.motion.section import Slices
from jaxcrusher.motion.tangents import SLICES
from tests.dynamics.systems import lorenz


def test_fit_of_lorenz():
    """d<z>/drho of the chaotic Lorenz system is about 1.0; its tangent is astronomic."""

    @eqx.filter_jit
    def mean_z(case):
        rho = case["point"][0]

        def field(t, y, args):
            late, half = t > 10, (t > 10) & (t < 60)
            means = jnp.stack([jnp.where(late, y[2], 0.0), jnp.where(half, y[2], 0.0)])
            return jnp.concatenate([lorenz(t, y[:3], rho), means])

        start = jnp.array([1.0, 1.0, 20.0, 0.0, 0.0]).at[:2].add(case["shift"])
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field),
            diffrax.Tsit5(),
            0.0,
            110.0,
            0.01,
            start,
            stepsize_controller=diffrax.PIDController(rtol=1e-6, atol=1e-6),
            max_steps=100_000,
        )
        return solution.ys[0, 3:] / jnp.array([100.0, 50.0])

    fit = fit_slopes(mean_z, np.array([28.0]), np.array([2.0]), 32, 0, shift=0.5)
    assert fit.slopes[0] == pytest.approx(1.0, rel=0.05)
    assert fit.errors[0] < 0.05
    # No pair says much more than its 32nd part, and half the window says the same.
    assert fit.shares[0] < 0.1 and abs(fit.drifts[0]) < 4 * fit.drift_errors[0]
    assert 0 < fit.drift_errors[0] < 0.05


def in_contact(**numbers):
    return jc.build_scene({"start": "contact", **numbers})


def test_quiet_motion_is_believed():
    """Also by a parameter whose value is 0, which no share of the value can change."""
    point = {"speed": 26.3, "clearance": 0.044e-3, "counterweight.mass": 0.0}
    report = gradient_report(in_contact, "foundation_rms", point, settle_turns=2, turns=6)
    assert report.usable, str(report)
    assert report.regime.period == 1 and "exponent x horizon" in str(report)
    for name, slope in report.slopes.items():
        assert slope.estimator == "implicit" and "against orbits" in str(report)
        # Differences of orbits, curved by a third of a per mille.
        assert slope.value == pytest.approx(slope.estimates["orbits"][0], rel=1e-3), name
        # Of the counterweight both may agree to the last bit.
        assert 0 <= slope.standard_error < 1e-4 * abs(slope.value)
    # By collocation, to the digits given. Here the swing keeps 0.9998 of itself a turn, and what
    # runs of 100 turns say by clearance is up to 12 % off.
    assert report.slopes["speed"].value == pytest.approx(147.9733, rel=1e-5)
    assert report.slopes["clearance"].value == pytest.approx(25_525, rel=5e-5)


CLEARANCE = 0.06e-3


def worn(speed):
    return in_contact(speed=speed, clearance=CLEARANCE)


@pytest.mark.slow
def test_a_global_that_changes_is_seen(monkeypatch):
    """By each call anew; at 0.03 mm the slope was that at 0.06 mm."""
    for clearance in (0.06e-3, 0.03e-3):
        monkeypatch.setitem(globals(), "CLEARANCE", clearance)
        slope = gradient_report(worn, "foundation_rms", {"speed": 30.0}).slopes["speed"]
        ends = [jc.periodic_orbit(worn(30.0 + step)).foundation_rms for step in (0.01, -0.01)]
        # The second derivative is some 20 N s2/rad2, the third ten times less.
        assert slope.value == pytest.approx(float(ends[0] - ends[1]) / 0.02, rel=1e-5)


@pytest.mark.slow
@pytest.mark.optimised
def test_chaos_is_refused(monkeypatch):
    # A thorough search for an orbit ends as a quick one does, with programs for more nodes.
    quick = lambda scene, **how: jc.periodic_orbit(scene, **(how | {"effort": "quick"}))  # noqa: E731
    monkeypatch.setattr("jaxcrusher.orbits.slopes.periodic_orbit", quick)
    report = gradient_report(
        lambda **numbers: jc.build_scene({"load_law": "closing_stroke", **numbers}),
        "foundation_rms",
        {"speed": 30.0, "clearance": 0.06e-3, "load": 8.8e3},
        settle_turns=20,
        turns=5,
        # Raised to six, twice the parameters.
        pairs=4,
    )
    slope = report.slopes["speed"]
    assert report.regime.name == "chaotic" and not report.usable, str(report)
    # 6.3 to 7.3 a turn in four runs of other lengths and tolerances, errors 0.3 to 0.9.
    assert report.regime.exponents.exponents[0] == pytest.approx(6.8, abs=2.5)
    assert slope.verdict == "refused" and slope.reasons
    assert report.growth[0] > 100
    # What a plain derivative would have handed out.
    tangent = slope.estimates["tangent"][0]
    assert not abs(tangent) < 1e6


@pytest.mark.slow
def test_tangents_that_fail_say_why(monkeypatch):
    """A turn takes 560 steps alone, and 1280 with its tangents."""
    monkeypatch.setattr(method, "MOST_STEPS", 900)
    monkeypatch.setattr(slopes, "REGIME_TURNS", 20)
    # No orbit closes in so few steps either; all tries together take a minute to say so.
    monkeypatch.setattr(slopes, "orbit_beside", lambda *_: None)
    report = gradient_report(
        lambda speed: jc.paper_scene(speed, 0.06e-3, start="contact"),
        "foundation_rms",
        {"speed": 30.0},
        settle_turns=0,
        turns=1,
    )
    assert report.regime.name == "failed" and bool(report.regime.statistics.success)
    assert "the tangents are not finite; stopped at" in str(report)
    assert "jc.Method(max_steps=...)" in str(report)
    slope = report.slopes["speed"]
    assert slope.verdict == "refused" and np.isnan(slope.value)


@pytest.mark.slow
def test_whirl_is_refused_without_a_number():
    """The motions of all speeds near it whirl: at half the clearance rounding decides."""
    report = gradient_report(
        lambda speed: jc.paper_scene(speed, 0.12e-3, slip="surface"),
        "foundation_rms",
        {"speed": 30.0},
        settle_turns=10,
        turns=5,
    )
    slope = report.slopes["speed"]
    assert slope.verdict == "refused" and np.isnan(slope.value) and "whirl" in str(report)


FIT = {"fit": (10.0, 0.5), "fit at half the radius": (10.2, 0.9)}


@pytest.mark.parametrize(
    "estimates, growth, chaotic, verdict",
    [
        (FIT, 100.0, True, "ok"),
        (FIT | {"fit": (10.0, 4.0)}, 100.0, True, "undecided"),
        (FIT | {"fit": (10.0, 6.0)}, 100.0, True, "refused"),
        (FIT | {"fit at half the radius": (20.0, 1.0)}, 100.0, True, "refused"),
        (FIT | {"tangent": (10.1, 0.0)}, 0.0, False, "ok"),
        (FIT | {"tangent": (10.1, 4.0)}, 0.0, False, "undecided"),
        (FIT | {"tangent": (10.1, 6.0)}, 0.0, False, "refused"),
        (FIT | {"tangent": (10.1, 0.0)}, 5.0, False, "refused"),
        (FIT | {"tangent": (30.0, 0.0)}, 0.0, False, "refused"),
        (FIT | {"tangent": (np.nan, 0.0)}, 0.0, False, "refused"),
        (FIT | {"tangent": (0.0, 0.0)}, 0.0, False, "refused"),
    ],
)
def test_verdicts(estimates, growth, chaotic, verdict):
    """A slope that is precise and wrong (the tangent of 30 ± 0) is caught by the fit."""
    slope = judge("speed", estimates, chaotic, 0.3, growth=growth)
    assert slope.verdict == verdict
    assert bool(slope.reasons) == (verdict != "ok")


# What a fit finds beside a slope of 10.
BESIDE = {
    "precise": (10.5, 0.5),
    "wide": (9.0, 20.0),
    "far and wide": (60.0, 20.0),
    "far": (15.0, 0.5),
    "none": (np.nan, np.inf),
}


@pytest.mark.parametrize(
    "fit, half, verdict",
    [
        ("precise", "precise", "ok"),
        # One is enough, if the other has nothing to say.
        ("precise", "wide", "ok"),
        ("wide", "precise", "ok"),
        ("precise", "none", "ok"),
        # A fit that agrees with everything confirms nothing.
        ("wide", "wide", "undecided"),
        ("none", "none", "undecided"),
        ("wide", "none", "undecided"),
        # None may disagree, whichever agrees: what is 2.5 of its errors away refutes too.
        ("precise", "far", "refused"),
        ("far", "precise", "refused"),
        ("wide", "far", "refused"),
        ("precise", "far and wide", "refused"),
    ],
)
def test_only_evidence_that_could_refute_confirms(fit, half, verdict):
    estimates = {"tangent": (10.0, 0.1), "fit": BESIDE[fit]}
    estimates["fit at half the radius"] = BESIDE[half]
    slope = judge("speed", estimates, False, 0.3, growth=0.0)
    assert slope.verdict == verdict, slope
    assert (verdict == "undecided") == any("cannot tell it from zero" in w for w in slope.reasons)
    orbit = {"implicit": (10.0, 0.1), "orbits": BESIDE[fit]}
    alone = judge("speed", orbit, False, 0.3, growth=0.0, multipliers=np.array([0.5], complex))
    expected = {"precise": "ok", "far": "doubtful", "far and wide": "doubtful"}
    assert alone.verdict == expected.get(fit, "undecided"), alone


def test_a_wrong_slope_that_wide_fits_agreed_with():
    """At 40 rad/s and 0.12 mm, centred; orbits of up to 3 turns there: -6e6, -1.1e8 and -3.6e8."""
    estimates = {
        "tangent": (-9.93e7, 2e7),
        "fit": (-1.2e8, 1.9e8),
        "fit at half the radius": (1.5e9, 5e8),
    }
    freedom = {"tangent": 3.0, "fit": 4.0, "fit at half the radius": 4.0}
    slope = judge("clearance", estimates, False, 1.2e-6, growth=0.0, freedom=freedom)
    assert slope.verdict == "undecided"
    # Known by infinitely many runs the errors would be errors: 3.2 of them are no accident.
    known = judge("clearance", estimates, False, 1.2e-6, growth=0.0)
    assert known.verdict == "refused" and "1.5e+09 ± 5e+08 disagree" in known.reasons[-1]


@pytest.mark.slow
@pytest.mark.parametrize("pairs", [6, 32])
def test_verdicts_err_as_often_as_they_may(pairs):
    """Of right slopes one in twenty is refused, and of wrong ones one in twenty agreed with."""
    rng, draws, freedom = np.random.default_rng(0), 500, pairs - 2

    def share(verdict, true, spreads):
        """Of tangents of 1 beside fits of the true slope, with such errors, that are judged so."""
        found = 0
        for _ in range(draws):
            estimates = {"tangent": (1.0, 0.0)}
            for name, spread in zip(FIT, spreads, strict=True):
                error = spread * np.sqrt(rng.chisquare(freedom) / freedom)
                estimates[name] = rng.normal(true, spread), error
            degrees = dict.fromkeys(FIT, freedom)
            judged = judge("speed", estimates, False, 0.3, growth=0.0, freedom=degrees)
            found += judged.verdict == verdict
        return found / draws

    # Three standard deviations of a share of 0.05 among 500.
    most = 0.05 + 3 * np.sqrt(0.05 * 0.95 / draws)
    for spreads in ((0.05, 0.1), (0.25, 0.5), (3.0, 6.0)):
        assert share("refused", 1.0, spreads) < most
        assert share("ok", 0.0, spreads) < most
        assert share("ok", 2.0, spreads) < most
    # Precise fits do confirm.
    assert share("ok", 1.0, (0.05, 0.1)) > 0.9


def test_halves_that_are_alike_by_chance_do_not_make_a_tangent_precise():
    """In a beat of a swing with the shaft the two halves of a window were equal to 0.5 %."""
    quarters = np.repeat([1.0, 3.0, 3.0, 1.0], 8)[:, None]
    nothing = np.zeros((32, 4, 4)), np.zeros((32, 4, 1))
    means = (np.ones(32),), (np.zeros((32, 4)),), (quarters,)
    along = Slices(*nothing, *means)
    slope, error = slopes._tangent(along, STATISTIC["foundation_mean"])
    # The standard error of four numbers about their mean.
    np.testing.assert_allclose([slope[0], error[0]], [2.0, 1 / np.sqrt(3)], rtol=1e-12)


@pytest.mark.parametrize("turns", [1, 3, 13, 50])
def test_windows_of_any_number_of_turns_have_a_tangent(turns):
    """Quarters of them are of whole turns, or of slices where turns are fewer than quarters."""
    count = turns * SLICES
    nothing = np.zeros((count, 4, 4)), np.zeros((count, 4, 1))
    means = (np.ones(count),), (np.zeros((count, 4)),), (np.ones((count, 1)),)
    along = Slices(*nothing, *means)
    slope, error = slopes._tangent(along, STATISTIC["foundation_mean"])
    np.testing.assert_allclose([slope[0], error[0]], [1.0, 0.0], atol=1e-12)


def test_the_slope_of_a_transient_is_doubtful():
    """Whatever agrees on it: at 30 rad/s it was 150.7 of a centred start, settled 220.13."""
    why = slopes.UNSETTLED["not settled"]
    for estimates, chaotic in ((FIT | {"tangent": (10.1, 0.0)}, False), (FIT, True)):
        slope = judge("speed", estimates, chaotic, 0.3, growth=0.0, unsettled=why)
        assert slope.verdict == "doubtful" and "has not settled" in slope.reasons[-1]
    orbit = {"orbits": (10.0, 0.0), "implicit": (10.0, 0.0)}
    numbers = np.array([0.5, 0.9], complex)
    slope = judge("speed", orbit, False, 0.3, growth=0.0, multipliers=numbers, unsettled=why)
    assert slope.verdict == "ok"


@pytest.mark.parametrize(
    "value, multipliers, verdict, reason",
    [
        (10.1, (0.9998j, -0.9998j), "ok", ""),
        (30.0, (0.9998j, -0.9998j), "doubtful", "orbits beside it 10"),
        (np.nan, (0.9998j, -0.9998j), "refused", "not finite"),
        (10.1, (1.0001j, -1.0001j), "refused", "largest multiplier 1.0001"),
        (10.1, (0.5, 0.9995), "refused", "within 0.0005 of 1"),
        (10.1, (0.5, 0.99), "ok", ""),
        # Not known, so not believed.
        (10.1, np.nan, "refused", "multiplier nan"),
    ],
)
def test_verdicts_on_an_orbit(value, multipliers, verdict, reason):
    """However long the motion takes to settle, and whatever a tangent has grown by."""
    slope = judge(
        "speed",
        {"orbits": (10.0, 0.0), "implicit": (value, 0.0)},
        False,
        0.3,
        growth=9.0,
        multipliers=np.asarray(multipliers, complex),
    )
    assert slope.verdict == verdict
    assert reason in " ".join(slope.reasons) and bool(reason) == bool(slope.reasons)


def test_what_is_hardly_beyond_a_limit_is_told_in_enough_digits():
    fits = {"fit": (10.0, 0.5), "fit at half the radius": (10.2, 0.9)}
    grown = judge("speed", fits | {"tangent": (10.1, 0.0)}, False, 0.3, growth=3.00001)
    assert grown.reasons == ("the tangent grows by exp(3.00001) > exp(3)",)
    # Twice the normal distribution's quantile of 97.5 % of a standard error, 1.95996.
    vague = judge("speed", {"tangent": (1.9599, 1.0)}, False, 0.3, growth=0.0)
    assert vague.reasons[0] == "slope over its error 1.9599 < 1.96"


@pytest.mark.parametrize(
    "accident, reason",
    [
        ({"share": 0.25, "drift": (0.0, 0.1)}, "one pair"),
        ({"share": 0.1, "drift": (3.0, 1.0)}, "doubling the window"),
        ({"share": 0.1, "drift": (2.0, 1.0)}, ""),
    ],
)
def test_a_fit_that_rests_on_an_accident_is_refused(accident, reason):
    slope = judge("speed", FIT, True, 0.3, growth=100.0, **accident)
    assert slope.verdict == ("refused" if reason else "ok")
    assert not reason or slope.reasons[0].startswith(reason)


@pytest.mark.parametrize("n", [1, 3, 16])
def test_fit_by_many_parameters(n):
    """A linear function is met to rounding, by the fewest pairs allowed."""
    slopes = np.linspace(1, 3, n) ** 3

    @eqx.filter_jit
    def value(case):
        return jnp.full(2, jnp.asarray(slopes) @ case["point"])

    point, radius = np.linspace(2, 5, n), np.linspace(0.1, 0.3, n)
    fit = fit_slopes(value, point, radius, 2 * n, 0)
    np.testing.assert_allclose(fit.slopes, slopes, rtol=1e-9)
    assert np.all(fit.errors < 1e-9)
    with pytest.raises(ValueError, match=r"^Argument `pairs` must be at least twice the param"):
        fit_slopes(value, point, radius, 2 * n - 1, 0)


def test_errors_of_a_fit_by_many_parameters():
    """Slopes of noise are zero within their errors, which no parameter shares with another."""

    @eqx.filter_jit
    def value(case):
        return jnp.full(2, jnp.sin(1e6 * case["point"].sum()))

    fit = fit_slopes(value, np.ones(9), np.full(9, 0.1), 32, 0)
    # Of nine squares with a mean of 1 one set in a thousand means more than 3.
    assert 0.2 < np.mean((fit.slopes / fit.errors) ** 2) < 3
    # Parameters that go together have errors of three times the others'.
    assert fit.errors.max() < 2 * fit.errors.min()


def test_one_pair_that_says_most_is_seen():
    """A step at the edge of a periodic window, met by one pair of sixteen."""
    # The offsets that the fit draws; the jump lies between its largest two.
    offsets = np.sort(np.random.default_rng(0).uniform(0.3, 1.0, (16, 1))[:, 0])
    jump = offsets[-2:].mean()

    def value(case):
        x = case["point"][0]
        return jnp.full(2, 1e-3 * x + jnp.where(x > jump, 1.0, 0.0))

    fit = fit_slopes(eqx.filter_jit(value), np.array([0.0]), np.array([1.0]), 16, 0)
    assert fit.shares[0] > 0.2


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"radius": -0.01}, "`radius` must be "),  # of which standard errors would be negative
        ({"radius": 0.0}, "`radius` must be "),
        ({"radius": np.nan}, "`radius` must be "),
        ({"turns": 0}, "`turns` must be "),
        ({"settle_turns": -1}, "`settle_turns` must be "),
        ({"pairs": 0}, "`pairs` must be "),
        ({"seed": -1}, "`seed` must be "),
        ({"rtol": -1e-9}, "`rtol` must be "),
        ({"metric": "noise"}, "`metric` must be one of 'foundation_rms'"),
        ({"parameters": {"offset": 0}}, "`offset` must have a scale"),
    ],
)
def test_what_is_out_of_range_or_unknown_is_refused_at_once(asked, words):
    def never(stage):
        raise AssertionError(stage)

    def scene(speed=27.0, offset=0.0):
        return jc.paper_scene(speed + offset, 0.05e-3)

    given = {"metric": "foundation_rms", "parameters": {"speed": 27.0}, "progress": never}
    with pytest.raises(ValueError, match=f"^Argument {words}"):
        gradient_report(scene, **given | asked)
