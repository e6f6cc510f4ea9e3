"""Fronts, floors and multipliers on functions whose answers are known by hand."""

from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from optimize.ask.options import Options
from optimize.ask.problem import DesignProblem
from optimize.ask.resolve import resolve
from optimize.search import active, orbits
from optimize.search.active import active_constraints
from optimize.search.descents import above, descend
from optimize.search.front import front, nondominated
from optimize.tell.checks import _slopes, _stationary
from tests.differences import differences

UPPER = np.ones(2)


def bowl(*centre: float, weights=(1.0, 1.0)):
    """w . (x - centre)^2 with its gradient."""

    def function(x):
        apart = x - np.array(centre)
        return float(np.dot(weights, apart**2)), 2 * np.asarray(weights) * apart

    return function


def down(function, start, *spares):
    """The end of a descent."""
    return descend(function, start, UPPER, 60, spares).path[-1]


def test_a_front_joins_two_minima():
    """Between two round bowls it is the straight line: at every point the slopes are opposite."""
    points = front(bowl(0.2, 0.3), bowl(0.8, 0.6), np.array([0.2, 0.3]), np.ones(2), down)
    assert len(points) == 9
    # SLSQP ends where a step gains 1e-14: half of that in the point.
    np.testing.assert_allclose(points[:, 1], 0.3 + (points[:, 0] - 0.2) / 2, atol=1e-6)
    bounded = [bowl(0.8, 0.6)(point)[0] for point in points]
    np.testing.assert_allclose(bounded, np.linspace(bounded[0], 0, 9), atol=1e-5)


def test_a_point_that_another_one_beats_is_none_of_a_front():
    """Where each descent may take two steps only, some of nine points are beaten in both."""

    def valley(x):
        off = x[1] - x[0] ** 2
        slope = [2 * (x[0] - 0.2) - 400 * x[0] * off, 200 * off]
        return float((x[0] - 0.2) ** 2 + 100 * off**2), np.array(slope)

    def short(function, start, *spares):
        return descend(function, start, UPPER, 2, spares).path[-1]

    other = bowl(0.9, 0.1)
    points = front(valley, other, np.array([0.2, 0.041]), np.array([0.8, 0.2]), short)
    costs = np.array([[valley(point)[0], other(point)[0]] for point in points])
    assert nondominated(costs).all() and 1 < len(points) < 9


def test_the_end_of_a_front_is_least_in_what_the_other_does_not_depend_on():
    other = bowl(0.8, 0.0, weights=(1.0, 0.0))
    points = front(bowl(0.2, 0.3), other, np.array([0.2, 0.3]), np.array([0.8, 0.9]), down)
    np.testing.assert_allclose(points[-1], [0.8, 0.3], atol=1e-3)
    np.testing.assert_allclose(points[:, 1], 0.3, atol=1e-6)


def test_a_descent_stops_at_its_floor():
    """x + y >= 1 holds the bowl about (0.2, 0.4) at (0.4, 0.6), with a multiplier of 0.4."""
    floor = above(lambda x: (float(x.sum()), np.ones(2)), 1.0)
    found = descend(bowl(0.2, 0.4), np.array([0.9, 0.9]), UPPER, 60, (floor,))
    np.testing.assert_allclose(found.path[-1], [0.4, 0.6], atol=1e-7)
    np.testing.assert_allclose(found.gradient, 0.4, atol=1e-6)


def a_problem(floor: float, slope: tuple[float, float]) -> DesignProblem:
    """Two numbers in boxes 2 and 5 wide, and links that decide the capacity."""
    names, bounds = ("a", "b"), {"a": (0.0, 2.0), "b": (0.0, 5.0)}
    design = SimpleNamespace(
        names=names, bounds=bounds, unit=lambda values: np.array([values["a"] / 2, values["b"] / 5])
    )
    known = dict(design=design, upper=np.ones(2), links_free=True, capacity_floor=floor, limits=())
    return SimpleNamespace(**known, slope=np.array(slope))


@pytest.fixture
def _by_hand(monkeypatch):
    """A capacity with the slopes that a problem gives, in place of solved orbits."""

    def told(problem, unit):
        return {"capacity": (8.0, problem.slope * (2.0, 5.0))}

    monkeypatch.setattr(active, "values_and_slopes", told)


def an_optimum(a: float, b: float, slopes: dict[str, float], capacity: float) -> Any:
    orbit = SimpleNamespace(slopes=slopes)
    return SimpleNamespace(
        values={"a": a, "b": b}, orbit=orbit, crushing=SimpleNamespace(capacity=capacity)
    )


@pytest.mark.usefixtures("_by_hand")
def test_the_floor_of_the_capacity_takes_its_part_of_the_slopes():
    """Slopes of 6 and 3 along a capacity that rises by 2 and 1: held by 3 a unit of it."""
    best = an_optimum(1.0, 2.0, {"a": 6.0, "b": 3.0}, 8.0)
    limits, left = active_constraints(a_problem(8.0, (2.0, 1.0)), best)
    (one,) = limits
    # But for rounding.
    assert one.parameter == "capacity" and one.multiplier == pytest.approx(3.0, rel=1e-14)
    assert left == pytest.approx({"a": 0.0, "b": 0.0}, abs=1e-14)
    # Above its floor the capacity holds nothing.
    limits, left = active_constraints(a_problem(7.0, (2.0, 1.0)), best)
    assert not limits and left == {"a": 6.0, "b": 3.0}
    # Nor can it hold what falls with it.
    limits, left = active_constraints(a_problem(8.0, (-2.0, -1.0)), best)
    assert limits[0].multiplier == 0 and left == {"a": 6.0, "b": 3.0}


@pytest.mark.usefixtures("_by_hand")
def test_what_has_no_slopes_is_held_by_nothing_that_is_known():
    """SciPy refuses to balance what is no number, of the objective or of the capacity."""
    for slope, of_capacity in ((np.nan, 1.0), (3.0, np.nan)):
        best = an_optimum(1.0, 2.0, {"a": 6.0, "b": slope}, 8.0)
        limits, left = active_constraints(a_problem(8.0, (2.0, of_capacity)), best)
        assert not limits and np.isnan([left["a"], left["b"]]).all()


@pytest.mark.usefixtures("_by_hand")
def test_a_limit_and_the_floor_hold_together():
    """With b at its lowest value only a tells the floor's multiplier."""
    best = an_optimum(1.0, 0.0, {"a": 6.0, "b": 5.0}, 8.0)
    limits, left = active_constraints(a_problem(8.0, (2.0, 1.0)), best)
    assert [(one.parameter, one.multiplier) for one in limits] == [("capacity", 3.0), ("b", 2.0)]
    assert left == {"a": 0.0}


def of_one_number(slope, apart) -> tuple[Any, Any]:
    """An optimum with a slope, and its problem."""
    orbit = SimpleNamespace(slopes={"a": slope}, slopes_apart={"a": apart})
    best = SimpleNamespace(settles=True, orbit=orbit, objective=1e4)
    return best, SimpleNamespace(design=SimpleNamespace(bounds={"a": (0.0, 1.0)}))


@pytest.mark.parametrize("apart, good", [(1e-4, True), (1e-1, False)])
def test_slopes_that_vanish_are_judged_by_the_objective(apart, good):
    """0.1 N over a box of 1 wide is 1e-5 of the objective, and far more than the slope."""
    best, problem = of_one_number(1e-9, apart)
    (check,) = _slopes(best, problem)
    assert check.passed == good
    best.settles = False  # to no orbit that a check could be of
    assert _slopes(best, problem) == ()


def test_slopes_that_nobody_knows_are_told_in_words():
    best, problem = of_one_number(np.nan, np.nan)
    answer = SimpleNamespace(problem=problem, free_slopes={"a": np.nan}, active=())
    for found in (*_slopes(best, problem), _stationary(answer, best)):
        assert not found.passed and "slopes are not known" in found.detail


def test_volume_is_that_of_the_links_of_each_design():
    """A power of 1 W over what the chamber of a design crushes, not over the paper's."""
    stroke = ("shaft.eccentricity", "8", "16 mm")
    options = Options(objective="wear", design=(("speed", "25", "40 rad/s"), stroke))
    problem = resolve(options)
    unit = np.array([0.3, 0.9])
    described = problem.design.description(unit)
    found, chamber = {"sliding_power": 1.0}, problem.chamber_of(described)
    value = problem.objective.formula(found, problem.design.scene(unit), chamber)
    assert float(value) == pytest.approx(3600 / float(problem.capacity(unit)), rel=1e-14)
    assert float(problem.capacity(unit)) < 0.99 * float(problem.chamber.capacity(29.5))

    def capacity(unit):  # no orbit is looked at for it
        scene = problem.design.scene(unit)
        return orbits._number(None, scene, unit, None, problem, "capacity")

    slopes = jax.grad(capacity)(jnp.asarray(unit))
    # The truncation of differences is 1e-8 of a third derivative of the size of the first.
    np.testing.assert_allclose(slopes, differences(problem.capacity, unit, 1e-4), rtol=1e-6)
