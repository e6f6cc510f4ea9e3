"""Branches round folds, and what is located on them, against published and exact numbers."""

from dataclasses import replace
from functools import partial

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import mathieu_a, mathieu_b

from jaxcrusher.orbits.forced import least_penetrations
from jaxcrusher.periodic import collocation_problem
from jaxcrusher.periodic.branch import HAPPENED, LOOP, WIGGLES, follow
from jaxcrusher.periodic.collocation import collocate
from jaxcrusher.periodic.collocation_problem import CollocationProblem
from jaxcrusher.periodic.events import sharp_points, sharpened, special_points
from jaxcrusher.periodic.problem import Stride
from jaxcrusher.periodic.system import System
from tests.periodic.maps import of_map
from tests.periodic.systems import duffing, mathieu

PHASES = 2 * np.pi * np.arange(48)[:, None] / 48


def duffing_at(speed, numbers):
    return System(duffing, 2 * jnp.pi / speed, (*numbers, speed))


def followed(family, x, bounds, *, first, longest, points):
    """The branch from the lower bound on, or from the upper one with a negative first step."""
    start = bounds[0] if first > 0 else bounds[1]
    stride = Stride(first=abs(first), longest=longest, shortest=1e-6 * abs(first))
    problem, upwards = CollocationProblem(family=family), first > 0
    more = dict(stride=stride, points=points, upwards=upwards)
    return follow(problem, x, start, scale=0.1, bounds=bounds, **more)


@pytest.mark.parametrize(
    ("numbers", "bounds", "folds", "amplitudes"),
    [
        ((0.04, 1.0, 0.015), (0.9, 1.2), (1.0492623992, 1.0439137088), (0.3471315, 0.2366230)),
        ((0.05, 0.1, 0.18), (0.8, 1.5), (1.2696019555, 1.1157002518), ()),
    ],
)
def test_folds_of_duffings_equation(numbers, bounds, folds, amplitudes):
    """Ten published digits; between them there are three motions for one speed."""
    family = eqx.Partial(duffing_at, numbers=jnp.array(numbers))
    start = jnp.asarray(bounds[0])
    x, _ = collocate(family(start), jnp.asarray(0.3 * np.cos(PHASES)))
    # A guess that is a little off leads to the orbit where the branch is to begin.
    branch = followed(family, 1.001 * x, bounds, first=0.02, longest=0.3, points=150)
    assert branch.parameter[0] == pytest.approx(bounds[0], abs=1e-12)
    assert branch.ended == "The parameter has left its bounds."
    np.testing.assert_allclose(branch.parameter[-1], bounds[1], rtol=1e-15)  # rounding
    # That is the orbit there: at a bound the branch is as exact as elsewhere.
    last = jnp.asarray(branch.points[-1].u)
    np.testing.assert_allclose(family(jnp.asarray(bounds[1])).residual(last), 0.0, atol=1e-9)
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


@pytest.mark.slow  # 27 s of a slow processor
def test_a_fold_that_few_nodes_misplace():
    """More nodes locate it again: published digits, within the error that it says."""
    family = eqx.Partial(duffing_at, numbers=jnp.array((0.05, 0.1, 0.18)))
    x, _ = collocate(family(jnp.asarray(0.8)), jnp.asarray(0.3 * np.cos(PHASES[::6])))
    branch = followed(family, x, (0.8, 1.5), first=0.02, longest=0.3, points=150)
    folds = [one for one in special_points(branch) if one.kind == "fold"]
    assert [one.kind for one in sharp_points(branch)] == ["fold", "fold"]
    # A branch that passes a fold again has it once.
    back = replace(branch, points=branch.points + branch.points[-2::-1])
    assert len(special_points(back)) > len(sharp_points(back)) == 2
    for coarse, at in zip(folds, (1.2696019555, 1.1157002518), strict=True):
        fine = sharpened(branch, coarse)
        # Newton's steps and the secant's leave 1e-11; the published numbers have ten digits.
        assert abs(fine.parameter - at) < fine.error + 2e-10 < 1e-8 < abs(coarse.parameter - at)
        assert fine.kind == "fold" and len(fine.point.u) > len(coarse.point.u)
        np.testing.assert_allclose(np.abs(fine.point.multipliers - 1).min(), 0, atol=1e-6)
        # No multiplier is -1 there.
        other = sharpened(branch, replace(coarse, kind="period doubling"))
        assert other.kind == "unresolved period doubling"


def test_period_doublings_of_mathieus_equation():
    """Rest loses its stability where a characteristic value of an odd order is, q = 2 b."""
    family = lambda a: System(mathieu, jnp.asarray(2 * np.pi), (a, 0.2))  # noqa: E731
    rest, bounds = jnp.zeros((8, 1)), (0.05, 0.6)
    branch = followed(family, rest, bounds, first=0.1, longest=0.5, points=50)
    special = special_points(branch)
    expected = sorted([mathieu_a(1, 0.4) / 4, mathieu_b(1, 0.4) / 4])
    assert [one.kind for one in special] == ["period doubling"] * 2
    # SciPy's values have twelve digits; Magnus' steps leave 1e-10.
    np.testing.assert_allclose([one.parameter for one in special], expected, rtol=1e-9)


def two_masses(time, x, rate, damping):
    return jnp.array(
        [jnp.cos(time) - 2.3 * x[0] - damping * rate[0], 0.1 * x[0] - 3.7 * x[1] - 0.5 * rate[1]]
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


def test_a_pair_that_leaves_beside_others_that_hardly_die():
    """Three more swings that lose 1e-4 a turn: determinants are some 1e-12 all along."""
    squares = jnp.array([1.3, 2.37, 3.61, 4.83]) ** 2

    def swings(time, x, rate, damping):
        return -squares * x - jnp.append(jnp.full(3, 2e-5), damping) * rate

    family = lambda damping: System(swings, jnp.asarray(2 * np.pi), damping)  # noqa: E731
    branch = followed(family, np.zeros((16, 4)), (-0.05, 0.05), first=-0.05, longest=0.5, points=30)
    special = special_points(branch)
    assert [one.kind for one in special] == ["Neimark-Sacker"]
    np.testing.assert_allclose(special[0].parameter, 0.0, atol=1e-10)


@pytest.mark.parametrize("begin", [-0.01, 0.01, 0.05])
def test_a_closed_branch_has_its_events_wherever_it_begins(begin):
    """A circle of points of rest has two folds, one of them beside where the branch begins."""
    circle = lambda time, x, rate, p: x**2 + p**2 - 1 - rate  # noqa: E731
    problem = CollocationProblem(family=lambda p: System(circle, jnp.asarray(1.0), p))
    rest, place = np.full((4, 1), -np.sin(begin)), np.cos(begin)
    more = dict(scale=1.0, bounds=(-2, 2), upwards=begin < 0)
    branch = follow(problem, rest, place, **more)
    assert branch.ended == LOOP
    special = special_points(branch)
    assert [one.kind for one in special] == ["fold"] * 2
    np.testing.assert_allclose(sorted(one.parameter for one in special), [-1, 1], atol=1e-10)


def test_a_closed_branch_has_its_events_once():
    """Its last step leads past where it begins, and past the fold that lies just behind."""

    def circle(point, states):
        (((x,),), (p,)) = states, point
        ends = np.array([[x + 0.3 * (x**2 + p**2 - 1)]])
        return ends, np.array([[[1 + 0.6 * x]]]), np.array([[[0.6 * p]]])

    stride = Stride(first=0.0338, longest=2.0, shortest=1e-6)
    rest, place, more = [np.sin(0.05)], np.cos(0.05), dict(scale=1.0, bounds=(-2, 2), stride=stride)
    branch = follow(of_map(circle), rest, place, **more)
    assert branch.ended == LOOP and branch.points[-1] is branch.points[0]
    parameters = [one.parameter for one in special_points(branch)]
    np.testing.assert_allclose(parameters, [1, -1], atol=1e-10)


def parting(time, x, rate, place):
    """Two joints that rest; the second comes up to its bore's middle as the number grows."""
    return jnp.array([2.0, 0.0, 1.5 - place, 0.0]) - x


def test_contact_is_watched_at_each_joint():
    """The first joint, deep in contact, hides nothing: the second loses it at 0.5 exactly."""
    family = lambda place: System(parting, jnp.asarray(3.0), place)  # noqa: E731
    problem = CollocationProblem(
        family=family, watched=("first", "second"), watch=least_penetrations
    )
    rest = jnp.broadcast_to(jnp.array([2.0, 0.0, 1.5, 0.0]), (8, 4))
    branch = follow(problem, rest, 0.0, scale=1.0, bounds=(-1.0, 2.0))
    assert branch.ended == HAPPENED.format("second")
    (lost,) = special_points(branch)
    assert lost.kind == "second"
    # The root is searched for to 1e-12 of a step.
    np.testing.assert_allclose(lost.parameter, 0.5, atol=1e-11)
    np.testing.assert_allclose(lost.point.monitors, [1.0, 0.0], atol=1e-11)


@pytest.mark.parametrize("turns", [1, 3])
def test_coarser_equations_of_an_odd_half(turns):
    """Half of 386 nodes a turn is no even number, which the equations and the turns ask for."""
    family = lambda a: System(mathieu, jnp.asarray(2 * np.pi), (a, 0.0))  # noqa: E731
    problem, nodes = CollocationProblem(family=family).over(turns, np.ones((386, 1)))
    coarser, nodes = problem.resolved(nodes, False)
    assert len(nodes) == 192 * turns and coarser.turns(nodes, None) == 1
    np.testing.assert_allclose(coarser.linearised(nodes, 0.5).residual, -0.5, atol=1e-9)


def rubbing(time, x, rate, speed):
    """A Jeffcott rotor of critical speed 1 in a ring, whose contact begins within a hundredth."""
    radius = jnp.sqrt(x @ x + 1e-4)
    deep, normal = radius - 1, x / radius
    force = 5 * (deep + jnp.sqrt(deep**2 + 1e-4))
    turned = jnp.array([[0.0, -1.0], [1.0, 0.0]]) @ normal
    unbalance = 0.35 * speed**2 * jnp.array([jnp.cos(speed * time), jnp.sin(speed * time)])
    weight = jnp.array([0.0, -0.2])
    return unbalance - 0.1 * rate - x - force * (normal + 0.05 * turned) + weight


@pytest.fixture(scope="module")
def rotor():
    """What `follow` needs for the rotor by 96 nodes, from 0.9 of the critical speed on."""
    family = lambda speed: System(rubbing, 2 * jnp.pi / speed, speed)  # noqa: E731
    x, root = collocate(family(jnp.asarray(0.9)), jnp.zeros((96, 2)))
    assert root.success
    how = dict(scale=0.1, bounds=(0.9, 1.2))
    return partial(follow, CollocationProblem(family=family), x, 0.9, **how)


# Of the orbit, its null vector and the speed, by SciPy's DOP853 at 1e-11.
RUBBING_FOLDS = 1.0759638801, 1.0075233774


@pytest.mark.optimised
def test_a_branch_that_wiggles_within_its_error_adds_nodes(rotor, monkeypatch):
    """By 96 nodes the branch turns back three times near its first fold; by 192 once."""
    branch = rotor(points=36)
    assert {len(point.u) for point in branch.points} == {192}
    turns = branch.parameter[np.flatnonzero(np.diff(np.sign(np.diff(branch.parameter)))) + 1]
    # At the point nearest to the fold a step moves the parameter by less.
    np.testing.assert_allclose(turns, RUBBING_FOLDS[:1], atol=1e-4)
    monkeypatch.setattr(collocation_problem, "MOST_NODES", 96)
    cut = rotor(points=36)
    assert cut.ended == WIGGLES
    # Where contact begins to bend the branch.
    assert 1.0 < cut.parameter[-1] < RUBBING_FOLDS[0]


@pytest.mark.slow
@pytest.mark.optimised
def test_folds_of_a_rotor_that_rubs(rotor):
    """As SciPy has them, each of them once."""
    found = [special for special in sharp_points(rotor(points=60)) if special.kind == "fold"]
    for special, fold in zip(found, RUBBING_FOLDS, strict=True):
        # 384 nodes leave 1e-7 of the first one, where contact changes fastest.
        assert abs(special.parameter - fold) < min(special.error, 1e-6)
