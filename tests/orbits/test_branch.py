"""Branches round folds, and what is located on them, against published and exact numbers."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import mathieu_a, mathieu_b

import jaxcrusher as jc
from jaxcrusher.orbits import orbit_branch
from jaxcrusher.orbits.branch import follow
from jaxcrusher.orbits.collocation import System, collocate
from jaxcrusher.orbits.events import sharp_points, sharpened, special_points
from jaxcrusher.orbits.problem import Collocation, Stride
from jaxcrusher.orbits.result import RESULTS, missing

PHASES = 2 * np.pi * np.arange(48)[:, None] / 48


def duffing(time, x, rate, args):
    c, k, f, w = args
    return f * jnp.cos(w * time) - c * rate - x - k * x**3


def duffing_at(speed, numbers):
    return System(duffing, 2 * jnp.pi / speed, (*numbers, speed))


def followed(family, x, bounds, *, first, longest, points):
    """The branch from the lower bound on, or from the upper one with a negative first step."""
    start = bounds[0] if first > 0 else bounds[1]
    stride = Stride(first=abs(first), longest=longest, shortest=1e-6 * abs(first))
    problem, upwards = Collocation(family=family), first > 0
    more = dict(stride=stride, points=points, upwards=upwards)
    return follow(problem, x, start, scale=0.1, bounds=bounds, **more)


@pytest.mark.parametrize(
    ("numbers", "bounds", "folds", "amplitudes"),
    [
        (
            (0.04, 1.0, 0.015),
            (0.9, 1.2),
            (1.0492623992, 1.0439137088),
            (0.3471315, 0.2366230),
        ),
        ((0.05, 0.1, 0.18), (0.8, 1.5), (1.2696019555, 1.1157002518), ()),
    ],
)
def test_folds_of_duffings_equation(numbers, bounds, folds, amplitudes):
    """Ten published digits; between them there are three motions for one speed."""
    family = eqx.Partial(duffing_at, numbers=jnp.array(numbers))
    start = jnp.asarray(bounds[0])
    x, _ = collocate(family(start), jnp.asarray(0.3 * np.cos(PHASES)))
    branch = followed(family, x, bounds, first=0.02, longest=0.3, points=150)
    assert branch.ended == "The parameter has left its bounds."
    special = special_points(branch)
    assert [one.kind for one in special] == ["fold", "fold"]
    np.testing.assert_allclose([one.parameter for one in special], folds, atol=2e-10)
    first = [2 * abs(np.fft.rfft(one.point.u[:, 0])[1]) / 48 for one in special]
    # Along the branch these change fastest: seven digits are known.
    np.testing.assert_allclose(first[: len(amplitudes)], amplitudes, atol=1e-7)
    # At a fold a multiplier is 1; a double root's half of the digits are left.
    for one in special:
        np.testing.assert_allclose(np.abs(one.point.multipliers - 1).min(), 0, atol=1e-6)
    passes = np.sum(np.diff(np.sign(branch.parameter - np.mean(folds))) != 0)
    assert passes == 3


def test_a_fold_that_few_nodes_misplace():
    """More nodes locate it again: published digits, within the error that it says."""
    family = eqx.Partial(duffing_at, numbers=jnp.array((0.05, 0.1, 0.18)))
    x, _ = collocate(family(jnp.asarray(0.8)), jnp.asarray(0.3 * np.cos(PHASES[::6])))
    branch = followed(family, x, (0.8, 1.5), first=0.02, longest=0.3, points=150)
    folds = [one for one in special_points(branch) if one.kind == "fold"]
    assert [one.kind for one in sharp_points(branch)] == ["fold", "fold"]
    for coarse, at in zip(folds, (1.2696019555, 1.1157002518), strict=True):
        fine = sharpened(branch, coarse)
        # Newton's steps and the secant's leave 1e-11; the published numbers have ten digits.
        assert abs(fine.parameter - at) < fine.error + 2e-10 < 1e-8 < abs(coarse.parameter - at)
        assert fine.kind == "fold" and len(fine.point.u) > len(coarse.point.u)
        np.testing.assert_allclose(np.abs(fine.point.multipliers - 1).min(), 0, atol=1e-6)
        # No multiplier is -1 there.
        other = sharpened(branch, replace(coarse, kind="period doubling"))
        assert other.kind == "unresolved period doubling"


def mathieu(time, x, rate, a):
    return -(a + 0.2 * jnp.cos(time)) * x


def test_period_doublings_of_mathieus_equation():
    """Rest loses its stability where a characteristic value of an odd order is, q = 2 b."""
    family = lambda a: System(mathieu, jnp.asarray(2 * np.pi), a)  # noqa: E731
    rest, bounds = jnp.zeros((8, 1)), (0.05, 0.6)
    branch = followed(family, rest, bounds, first=0.1, longest=0.5, points=50)
    special = special_points(branch)
    expected = sorted([mathieu_a(1, 0.4) / 4, mathieu_b(1, 0.4) / 4])
    assert [one.kind for one in special] == ["period doubling"] * 2
    # SciPy's values have twelve digits; Magnus' steps leave 1e-10.
    np.testing.assert_allclose([one.parameter for one in special], expected, rtol=1e-9)


def two_masses(time, x, rate, damping):
    return jnp.array(
        [
            jnp.cos(time) - 2.3 * x[0] - damping * rate[0],
            0.1 * x[0] - 3.7 * x[1] - 0.5 * rate[1],
        ]
    )


def test_a_pair_that_leaves_the_unit_circle():
    """Damping that passes zero: exactly there, and what leaves is a pair."""
    family = lambda damping: System(two_masses, jnp.asarray(2 * np.pi), damping)  # noqa: E731
    x, _ = collocate(family(jnp.asarray(0.1)), jnp.zeros((16, 2)))
    bounds = (-0.1, 0.1)
    branch = followed(family, x, bounds, first=-0.13, longest=0.5, points=30)
    special = special_points(branch)
    assert [one.kind for one in special] == ["Neimark-Sacker"]
    np.testing.assert_allclose(special[0].parameter, 0.0, atol=1e-10)


def parting(time, x, rate, place):
    """Two joints that rest; the second comes up to its bore's middle as the number grows."""
    return jnp.array([2.0, 0.0, 1.5 - place, 0.0]) - x


def test_contact_is_watched_at_each_joint():
    """The first joint, deep in contact, hides nothing: the second loses it at 0.5 exactly."""
    family = lambda place: System(parting, jnp.asarray(3.0), place)  # noqa: E731
    problem = Collocation(family=family, watched=("first", "second"))
    rest = jnp.broadcast_to(jnp.array([2.0, 0.0, 1.5, 0.0]), (8, 4))
    branch = follow(problem, rest, 0.0, scale=1.0, bounds=(-1.0, 2.0))
    assert branch.ended == "A joint is about to lose contact."
    (lost,) = special_points(branch)
    assert lost.kind == "second"
    # The root is searched for to 1e-12 of a step.
    np.testing.assert_allclose(lost.parameter, 0.5, atol=1e-11)
    np.testing.assert_allclose(lost.point.monitors, [1.0, 0.0], atol=1e-11)


def scene(speed):
    return jc.build_scene({"speed": speed, "clearance": 0.1e-3})


@pytest.mark.slow
def test_a_fold_of_the_crusher():
    """At 0.1 mm the quiet motion ends at 37.3155 rad/s; below, another stable one is as quiet."""
    bounds = (37.1, 37.6)
    found = jc.orbit_branch(scene, 37.25, bounds, scale=1.0, points=60)
    (fold,) = found.events
    assert fold.kind == "fold"
    # 96 nodes a turn say 37.31547; from 192 to 384 it moves by 2e-8.
    np.testing.assert_allclose(fold.parameter, 37.31552, atol=2e-5)
    assert fold.error < 1e-7
    parameter, stable = found.table.parameter.values, found.table.stable.values
    turned = int(np.argmax(parameter))
    assert stable[: turned - 1].all() and not stable[turned + 1 :].any()
    other = jc.orbit_branch(scene, 37.5, bounds, upwards=False, scale=1.0, points=60)
    # Both are stable at one speed, and differ by more than their errors.
    both = []
    for branch, until in ((found, turned), (other, None)):
        near = int(np.argmin(np.abs(branch.table.parameter.values[:until] - 37.25)))
        assert bool(branch.table.stable[near])
        both.append(float(branch.table.foundation_rms[near]))
    assert 80 < both[1] - both[0] < 140
    assert "resolve" in other.ended or "bounds" in other.ended


CLEARANCE = 0.1e-3


def worn(speed):
    return jc.build_scene({"speed": speed, "clearance": CLEARANCE})


@pytest.mark.slow
def test_a_branch_by_shooting_begins_at_one_section_point(monkeypatch):
    """A motion of the crusher that keeps contact, as nodes have it at each speed."""

    def first(scene, value, *_):
        orbit = jc.periodic_orbit(scene(jnp.asarray(value)))
        return orbit_branch.Departure(1, value, np.asarray(orbit.section), None)

    def scene(speed):
        return jc.paper_scene(speed, 6e-5)

    monkeypatch.setattr(orbit_branch, "_first", first)
    found = jc.orbit_branch(scene, 30.0, (29.0, 31.0), points=3)
    assert len(found.orbits) == 3
    for orbit in found.orbits:
        nodes = jc.periodic_orbit(scene(orbit.scene.drive.speed))
        # Shooting closes to 1e-7 clearances.
        np.testing.assert_allclose(orbit.foundation_rms, nodes.foundation_rms, rtol=1e-7)


@pytest.mark.slow
def test_a_global_that_changes_is_seen(monkeypatch):
    """By each call anew: another program for another scene, and the same for the same."""
    seen, traces = [], []

    @eqx.filter_jit
    def clearance(family, value):
        traces.append(CLEARANCE)
        return family(value).args.joint.clearance

    def follow(problem, x, start, **_):
        seen.append(float(clearance(problem.family, jnp.asarray(start))))
        raise StopIteration

    monkeypatch.setattr(orbit_branch, "follow", follow)
    expected = [0.1e-3, 0.06e-3, 0.1e-3]
    for value in expected:
        monkeypatch.setitem(globals(), "CLEARANCE", value)
        with pytest.raises(StopIteration):
            jc.orbit_branch(worn, 30.0, (29.0, 31.0), nodes=96)
    assert seen == expected and traces == expected[:2]


def test_refusals():
    with pytest.raises(ValueError, match="`start` must lie in the bounds"):
        jc.orbit_branch(scene, 30.0, (31.0, 32.0))
    with pytest.raises(ValueError, match="`points` must be a whole number"):
        jc.orbit_branch(scene, 30.0, (29.0, 32.0), points=0)
    lost = missing(jc.paper_scene(30.0, 0.1e-3), 2, RESULTS.not_closed)
    with pytest.raises(ValueError, match="`period` must be the guess's 2, but is 1"):
        jc.orbit_branch(scene, 30.0, (29.0, 32.0), period=1, guess=lost)


@pytest.mark.slow
def test_a_fold_of_the_crusher_by_few_nodes():
    """96 nodes place it 2.1e-4 rad/s below; 192, 384 and 768 agree to 2e-9.

    A motion that begins on so few nodes does not close, and the branch goes on all the same: as one
    that comes from lower speeds.
    """
    at = lambda speed: jc.build_scene({"speed": speed, "clearance": 0.11e-3})  # noqa: E731
    found = jc.orbit_branch(at, 38.01, (37.0, 38.5), scale=1.0, points=7, nodes=96)
    assert found.branches[0].points[0].u.shape == (96, 2)
    (fold,) = found.events
    assert fold.kind == "fold" and fold.error < 1e-8
    np.testing.assert_allclose(fold.parameter, 38.0276250, atol=1e-7)
    orbit = fold.orbit()
    # Steps move the double root by the root of what they leave of the matrix.
    least = np.abs(np.asarray(orbit.multipliers) - 1).min()
    assert 1e-5 < least < orbit.multipliers_error < 1e-3
