"""The table of statistics: one entry makes a statistic wherever statistics are known."""

import math
import tomllib
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.integrate import RESULTS, Outcome
from jaxcrusher.crusher.template import STATISTIC
from jaxcrusher.mechanism.quantities import OF_SUPPORTS
from jaxcrusher.mechanism.reductions import (
    AbstractFollowed,
    AbstractMean,
    PowerMean,
    RisesAboveZero,
    Sampled,
    Statistic,
    of_slices,
)
from jaxcrusher.motion.flow import Flow
from jaxcrusher.motion.method import resolve
from jaxcrusher.motion.section import advance
from jaxcrusher.motion.settling import error, standard_error
from jaxcrusher.motion.statistics import Statistics, limits_of, of_whirl
from jaxcrusher.motion.tangents import SLICES, combine, tangents
from jaxcrusher.motion.turns import Turns, curve_of
from jaxcrusher.periodic.trigonometric import resample
from tests.pairs import slow


def eccentricity(s, scene):
    """The length of e in clearances; one of an ideal joint."""
    if scene.joints["main"] is None:
        return jnp.ones_like(scene.drive.speed)
    e = s.motion.eccentricities["main"]
    return jnp.hypot(e.x, e.y) / scene.joints.at("main").clearance


OWN = {
    "rms_eccentricity": Statistic("1", "RMS of |e| / clearance", eccentricity, PowerMean(2)),
    "least_eccentricity": Statistic(
        "1", "least |e| / clearance", eccentricity, Sampled(jnp.min, jnp.min)
    ),
}


def contact(speed=30.0, clearance=0.06e-3):
    return jc.paper_scene(speed, clearance, start="contact")


def with_own(speed=30.0, own=OWN):
    return contact(speed).with_statistics(own)


@pytest.mark.usefixtures("unchecked")  # statistics of a batch
def test_errors_are_those_of_each_motion_of_a_batch():
    by_turn = jnp.asarray(np.random.default_rng(2).uniform(1.0, 2.0, (3, 20)))
    values = {"foundation_rms": jnp.sqrt(jnp.mean(by_turn**2, axis=1))}
    known = tuple(contact().statistics.items())
    swing = jnp.array([0.0, 0.1, 0.2])
    found = Statistics(20, None, values, {"foundation_rms": by_turn}, jnp.zeros(4), known=known)
    found = replace(found, swing=swing)
    how = STATISTIC["foundation_rms"]
    for i in range(3):
        one = error(how, by_turn[i], swing[i])
        assert float(found.foundation_rms_error[i]) == pytest.approx(float(one), rel=1e-12)
        one = standard_error(how, by_turn[i])
        assert float(found.standard_error("foundation_rms")[i]) == pytest.approx(float(one))


@pytest.mark.usefixtures("unchecked")  # statistics without an end
@pytest.mark.parametrize(
    ("winding", "touching", "whirls"), [(-70.7, 1, True), (70.9, 1, True), (70.9, 0.9, False)]
)
def test_a_pin_whirls_either_way_round(winding, touching, whirls):
    """The crank of a pump of 3000 rpm whirls as a pin at -70.7, and round the rod's pin at 70.9."""
    seen = {"winding": jnp.array(winding), "contact_fraction": jnp.array(touching)}
    ended = Outcome(RESULTS.successful, jnp.asarray(1.0), jnp.asarray(1))
    for at in ("", "shaft_bearing_"):
        # Beside a pin that does not whirl.
        quiet = {"elbow_winding": jnp.array(1.0), "elbow_contact_fraction": jnp.array(1.0)}
        of_one = quiet | {f"{at}{name}": value for name, value in seen.items()}
        assert bool(Statistics(3, ended, of_one, {}, jnp.zeros(4)).whirl) == whirls


def test_the_largest_excursion_is_from_the_mean_place_in_both_directions():
    """On an ellipse of 3 and 1 mm about another place than the drawn one, and on it upright."""
    angle = np.linspace(0, 2 * np.pi, 1024, endpoint=False)
    lying = np.stack([3 * np.cos(angle) + 7, np.sin(angle) - 5], axis=1)
    for samples in (lying, lying[:, ::-1]):
        found = OF_SUPPORTS["frame_displacement_peak"].reduction.of_samples(jnp.asarray(samples))
        assert float(found) == pytest.approx(3.0, rel=1e-5)  # of 1024 samples


def test_a_whirl_is_told_by_each_loose_joint():
    path = Path(__file__).parents[2] / "examples" / "pump.toml"
    text = path.read_text().replace('kind = "linkage"', "")
    for name, at in (("A", "B_"), ("B", "main_")):  # ideal, and loose
        scene = jc.linkage(**tomllib.loads(text.replace(f"[joints.{name}]", "[joints.main]")))
        assert of_whirl(scene) == ("shaking_rms", f"{at}contact_fraction", f"{at}winding")
    loose = jc.build_scene({"clearance": 6e-5, "shaft_bearing.clearance": 6e-5})
    assert of_whirl(loose)[2::2] == ("winding", "shaft_bearing_winding")
    # A crusher's main joint has them although it is ideal.
    ideal = jc.build_scene({"joint": "ideal"})
    assert of_whirl(ideal) == ("foundation_rms", "contact_fraction", "winding")
    assert not bool(jc.statistics(ideal, 0, 1, outputs=of_whirl(ideal)).whirl)


EXAMPLES = Path(__file__).parents[2] / "examples"
# A scene with impacts, the joint that they are at, its force in instants, and how long it is looked
# at (s): while motions of other tolerances are still the same.
IMPACTS = [
    (lambda: jc.read_scene(EXAMPLES / "four_bar.toml"), "B_", "B_force_peak", "B_reaction", 0.2),
    (
        lambda: jc.read_scene(EXAMPLES / "slider_crank.toml"),
        "B_",
        "B_force_peak",
        "B_reaction",
        0.01,
    ),
    (lambda: jc.paper_scene(10.0, 0.06e-3), "", "joint_peak", "joint_force", 0.02),
    (lambda: jc.paper_scene(25.0, 0.03e-3), "", "joint_peak", "joint_force", 0.02),
    (lambda: jc.paper_scene(30.0, 0.06e-3, slip="surface"), "", "joint_peak", "joint_force", 0.02),
    (
        lambda: jc.build_scene({"elbow.clearance": 5e-5, "pivot.clearance": 5e-5}),
        "pivot_",
        "pivot_joint_peak",
        "toggle_reaction",
        0.02,
    ),
]


@pytest.mark.parametrize(
    ("make", "at", "peak", "force", "time"), IMPACTS[:3:2] + slow(*IMPACTS[1:2], *IMPACTS[3:])
)
def test_impacts_are_those_of_a_fine_grid(make, at, peak, force, time):
    scene = make()
    names = (peak, f"{at}penetration_ratio", f"{at}impact_speed", f"{at}contact_fraction")
    span = time * float(scene.drive.speed)
    counted = (("impacts", replace(scene.statistics[names[-1]], reduction=RisesAboveZero())),)
    outputs = (*scene.entries(names), *counted)
    _, found, outcome = advance(Flow(scene), span, resolve(scene, 1e-9), outputs)
    assert bool(outcome.success)
    seen = jc.simulate(
        scene,
        np.linspace(0, time, 100_001),
        outputs=(force, f"{at}penetration_ratio", f"{at}penetration_rate"),
    )
    depth = np.asarray(seen[f"{at}penetration_ratio"])
    touches = (depth[:-1] <= 0) & (depth[1:] > 0)
    # They are counted by the turn.
    assert np.sum(touches) > 0
    assert float(found["impacts"]) * span / (2 * np.pi) == pytest.approx(np.sum(touches))
    expected = {
        peak: np.linalg.norm(seen[force], axis=1).max(),
        names[1]: depth.max(),
        names[2]: seen[f"{at}penetration_rate"].max(),
        names[3]: np.mean(depth > 0),
    }
    for name, value in expected.items():
        # Parabolas through the ends of steps are 1e-4 off at this tolerance, and the grid as much.
        assert float(found[name]) == pytest.approx(float(value), rel=1e-3), name


@pytest.mark.slow
def test_a_statistic_of_one_s_own():
    """In statistics, sections whole and in slices, and tangents."""
    scene, own, turns = with_own(), tuple(OWN), 2
    found = jc.statistics(scene, 1, turns, outputs=own)
    times = 2 * np.pi / 30 * np.linspace(1, 1 + turns, turns * 1024 + 1)
    seen = np.linalg.norm(jc.simulate(scene, times, outputs=("eccentricity",)).eccentricity, axis=1)
    seen /= 0.06e-3
    # The trapezium rule of 1024 points a turn of a 130 Hz swing, and steps of 1e-9.
    rms = np.sqrt(np.trapezoid(seen**2) / (seen.size - 1))
    assert float(found.rms_eccentricity) == pytest.approx(rms, rel=1e-6)
    # The same instants but the first.
    assert float(found.least_eccentricity) == pytest.approx(seen[1:].min(), rel=1e-6)
    np.testing.assert_allclose(
        np.sqrt(np.mean(found.by_turn["rms_eccentricity"] ** 2)), found.rms_eccentricity, rtol=1e-12
    )

    # Turns begin anew in a section, and slices in a turn; quiet motion keeps the tolerance.
    whole = jc.poincare_section(scene, 1, turns, outputs=own)
    sliced = jc.poincare_section(scene, 1, turns, outputs=own, slices=4)
    for section in (whole, sliced):
        for name in own:
            np.testing.assert_allclose(section[name], found.by_turn[name], rtol=1e-6)
            assert float(section.statistics[name]) == pytest.approx(float(found[name]), rel=1e-6)
    assert whole.slices == 0 and sliced.slices == 4
    assert whole.jacobians.shape == (0, 4, 4) and sliced.jacobians.shape == (turns * 4, 4, 4)

    # The tangents' slices are those of the turn.
    along = tangents(
        lambda point: with_own(point[0]), jnp.array([30.0]), own[0], whole.states[0], 1, 1e-9
    )
    assert along.values[0].shape == (SLICES,) and along.failure == ""
    assert np.isfinite(combine(OWN[own[0]], along.values, along.by_parameter)).all()
    turn = float(of_slices(OWN[own[0]].reduction, along.values, 1))
    assert turn == pytest.approx(float(found.by_turn[own[0]][1]), rel=1e-6)

    with pytest.raises(
        ValueError, match=r"^Argument `outputs` must be a known name, .*'rms_eccentricity'"
    ):
        jc.statistics(scene, 0, 1, outputs=("rms_eccentricty",))


@pytest.mark.slow
def test_one_s_own_is_known_wherever_statistics_are():
    """In orbits, maps, reports and sweeps, which compute all or what needs not be asked for."""
    scene, own = with_own(), tuple(OWN)
    name = own[0]
    assert {*own} < {*scene.statistics} & {*scene.usual_statistics}
    orbit = jc.periodic_orbit(scene, nodes=96)
    seen = jnp.linalg.norm(resample(orbit.eccentricity, 1024), axis=1)
    # The same trigonometric polynomial, summed to rounding.
    np.testing.assert_allclose(orbit[name], jnp.sqrt(jnp.mean(seen**2)), rtol=1e-12)
    np.testing.assert_allclose(orbit[own[1]], jnp.min(seen), rtol=1e-6)

    grid = {"speed": [30.0]}
    found = jc.orbit_map(with_own, grid, metric=name, nodes=96)
    # XLA rounds a program of many cells otherwise than that of one.
    np.testing.assert_allclose(found[name], orbit[name], rtol=1e-9)
    report = jc.gradient_report(with_own, name, {"speed": 30.0})
    # Differences of orbits agree, which are made of the numbers above.
    assert report.usable and "orbits" in report.slopes["speed"].estimates, str(report)

    swept = jc.sweep(with_own, grid, 1, 2)
    one = jc.statistics(scene, 1, 2, outputs=own)
    for name in own:
        # A quiet motion, both at 1e-9 a step.
        np.testing.assert_allclose(swept[name], one[name], rtol=1e-6)
        assert swept[name].attrs == {"units": "1", "long_name": OWN[name].meaning}


@pytest.mark.slow
def test_programs_are_of_functions_and_not_of_their_names():
    name, last = OWN
    state, how = jnp.array([1.0, 0.0, 0.0, 0.0]), dict(method=jc.Method(max_steps=200_000))
    reduction, point = OWN[name].reduction, jnp.array([30.0])

    def computed(own):
        def made(speed):
            return with_own(speed, own)

        scene, along = made(30.0), tangents(lambda at: made(at[0]), point, name, state, 1, 1e-6)
        return [
            float(jc.statistics(scene, 0, 1, outputs=(name,), rtol=1e-6, **how)[name]),
            float(jc.poincare_section(scene, 0, 1, outputs=(name,), rtol=1e-6, **how)[name][0]),
            float(of_slices(reduction, along.values, 1)),
            float(jc.periodic_orbit(scene, nodes=96)[name]),
            float(jc.periodic_orbit(scene.ideal())[last]),
            float(jc.sweep(made, {"speed": [30.0]}, 0, 1, rtol=1e-6)[name][0]),
        ]

    def twice(how):
        return replace(how, quantity=lambda s, scene: 2 * how.quantity(s, scene))

    # Twice a double is exact, and so is all that follows.
    changed = {name: twice(how) for name, how in OWN.items()}
    np.testing.assert_allclose(computed(changed), 2 * np.array(computed(OWN)), rtol=1e-12)


def test_one_s_own_of_a_linkage_and_names_that_are_refused():
    pump = jc.read_scene("examples/pump.toml")
    drawn = {"twice": replace(pump.statistics["shaking_rms"], meaning="once more")}
    scene = pump.with_statistics(drawn)
    found = jc.statistics(scene, 0, 1)
    assert float(found.twice) == float(found.shaking_rms) and found.units()["twice"] == "N"
    assert "twice" not in pump.statistics and "twice" in scene.ideal().statistics
    with pytest.raises(ValueError, match=r"^Argument `own` must have names as Python's, but is"):
        pump.with_statistics({"a b": OWN["rms_eccentricity"]})
    for one in (pump, contact()):
        with pytest.raises(ValueError, match=r"^Argument `own` must have names of their own, but"):
            one.with_statistics({"shaking_rms": OWN["rms_eccentricity"]})


def test_every_statistic_has_a_unit_and_a_meaning():
    scene = jc.build_scene({})
    assert jc.STATISTICS == scene.usual_statistics
    assert jc.STATISTICS == tuple(scene.statistics)[: len(jc.STATISTICS)]
    for name, statistic in STATISTIC.items():
        units = {"N", "N m", "N/m", "Pa", "W", "m", "m/s", "rad/s", "h", "1"}
        assert statistic.unit in units, name
        assert len(statistic.meaning) > 8, name


def test_turns_reduce_as_the_motion_does():
    """The statistic of a motion, from those of its pieces, is that of the whole."""
    q = np.array([3.0, 4.0, 12.0, 5.0])
    for name, expected in (
        ("foundation_rms", math.sqrt(np.mean(q**2))),
        ("foundation_mean", 6.0),
        ("foundation_peak", 12.0),
        ("contact_fraction", 6.0),
        ("foundation_smooth_peak", np.mean(q**16) ** (1 / 16)),
    ):
        found = STATISTIC[name].reduction.of_pieces(jnp.asarray(q))
        assert float(found) == pytest.approx(expected, rel=1e-12), name


def test_slices_reduce_as_their_turns_do():
    """Also what is about the mean of a turn, which is not that of its slices."""
    angles = 2 * np.pi * np.arange(1, 2 * 1024 + 1) / 1024
    for name, statistic in STATISTIC.items():
        how, q = statistic.reduction, jnp.asarray(3 + np.cos(angles) + 0.1 * angles)
        if isinstance(how, AbstractFollowed):
            continue  # a slice keeps its number: see tests/mechanism/test_reductions.py
        if name == "frame_displacement_peak":
            q = jnp.stack([q, np.sin(angles)], axis=1)
        if isinstance(how, AbstractMean):
            turns = [
                how.of_means(*map(jnp.mean, how.integrands(half))) for half in (q[:1024], q[1024:])
            ]
            kept = tuple(jnp.mean(one.reshape(16, 128), axis=1) for one in how.integrands(q))
        else:
            turns = [how.of_samples(half) for half in (q[:1024], q[1024:])]
            kept = q.reshape(16, 128, *q.shape[1:])
        found, expected = of_slices(how, kept, 2), how.of_pieces(jnp.stack(turns))
        assert float(found) == pytest.approx(float(expected), rel=1e-12), name


def test_a_failure_is_no_number_in_any_statistic():
    """Also where it is a share of the time, or a number that is followed."""
    method = jc.Method(max_steps=300)
    section = jc.poincare_section(contact(), 0, 2, outputs=jc.STATISTICS, method=method)
    assert not section.success and "jc.Method(max_steps=" in section.failure
    for name in jc.STATISTICS:
        assert np.isnan(section[name]).all(), name
    assert np.isnan(section.state).all()


def test_wear_needs_friction():
    smooth = jc.paper_scene(30.0, 0.06e-3, friction=0)
    for run in (jc.statistics, jc.poincare_section):
        with pytest.raises(
            ValueError,
            match=r"^Argument `outputs` must ask for sliding_power only of a scene with friction",
        ):
            run(smooth, 0, 1, outputs=("sliding_power",))


@pytest.mark.parametrize(
    ("values", "missing"),
    [
        ({}, {"penetration_ratio", "impact_speed"}),
        ({"elbow.clearance": 2e-5}, {"elbow_penetration_ratio", "elbow_impact_speed"}),
        ({"rod.stiffness": 2e5, "rod.preload": 1e4}, {"rod_tension_least"}),
        ({"contact_law": "rollers"}, {"roller_pressure", "static_load_ratio"}),
    ],
)
def test_a_limit_that_was_not_asked_for_is_not_kept(values, missing):
    """Of every part that has limits, and by all statistics that are asked for it is known."""
    scene = jc.build_scene(values)
    known = dict.fromkeys(scene.usual_statistics, jnp.zeros(()))
    assert limits_of(scene, known).missing == ()
    some = limits_of(scene, {name: known[name] for name in known if name not in missing})
    assert set(some.missing) == missing and not bool(some.inside)
    assert some.remarks() == [f"not known without {name}" for name in some.missing]
    assert some.verdict().startswith("NOT KNOWN to be inside the contact model: ")


@pytest.mark.usefixtures("unchecked")  # what stands for a scene is none
def test_curves_of_turns_know_harmonics_rms_and_peaks():
    """Of two pieces of two turns: A cos(1.5 theta + 0.4) about 3, A of 5 and of 7."""
    angles, sizes = 2 * np.pi * np.arange(2048) / 1024, np.array([[5.0], [7.0]])
    swing = sizes * np.cos(1.5 * angles + 0.4)
    scene = SimpleNamespace(observables={n: SimpleNamespace(unit="N") for n in ("size", "force")})
    seen = {"size": 3 + swing, "force": np.stack([swing - 2, 0 * swing], axis=-1)}
    curves = Turns(scene, 2, seen).curves()
    assert [*curves] == ["size", "force_x", "force_y"] and curves["size"].unit == "N"
    # Rounding of sums of 2048 numbers.
    close = partial(np.testing.assert_allclose, rtol=1e-13, atol=1e-13)
    expected = np.zeros((2, 9), complex)
    expected[:, 0], expected[:, 3] = 3, sizes[:, 0] * np.exp(0.4j)
    close(curves["size"].amplitudes(8), expected)
    close(curves["size"].moving.rms, sizes[:, 0] / np.sqrt(2))
    close(curves["size"].rms, np.sqrt(9 + sizes[:, 0] ** 2 / 2))
    close(curves["force_x"].peak, np.abs(swing - 2).max(axis=1))
    slope = jax.grad(lambda x: curve_of("N", x * jnp.ones((1, 4))).moving.rms[0])
    assert float(slope(2.0)) == 0 and not np.any(curves["force_y"].rms)
