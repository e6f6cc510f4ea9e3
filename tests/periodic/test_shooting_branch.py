"""Branches of section points, of maps whose bifurcations are known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxcrusher.periodic.branch import OUTSIDE, SHORTER, follow
from jaxcrusher.periodic.branch_point import branch_point
from jaxcrusher.periodic.event_curve import curve_of
from jaxcrusher.periodic.events import origin, other_branch, sharpened, special_points
from jaxcrusher.periodic.problem import Stride
from tests.differences import differences
from tests.periodic.maps import of_map


def henon(state, number):
    """Henon's map with b = 0.3: folds and doubles where is known."""
    return np.array([1 - number * state[0] ** 2 + 0.3 * state[1], state[0]])


def delayed_logistic(state, number):
    """Its fixed point 1 - 1 / r loses a pair at r = 2 (Maynard Smith 1968)."""
    return np.array([number * state[0] * (1 - state[1]), state[0], 0.3 * state[2] + state[0]])


def of_function(of, period=1):
    """The problem of a map whose derivatives are differences."""

    def leads(point, states):
        (state,), number = states, float(point[0])
        jacobian = differences(lambda state: of(state, number), state, 1e-6)
        forcing = differences(lambda number: of(state, number), number, 1e-6)
        return of(state, number)[None], jacobian[None], forcing[None, :, None]

    return of_map(leads, period=period)


def followed(problem, state, start, bounds, *, upwards, points, scale=1.0):
    """The branch, and its special points."""
    more = dict(upwards=upwards, points=points)
    unknowns = problem.unknowns_from(state, start)
    branch = follow(problem, unknowns, start, scale=scale, bounds=bounds, **more)
    return branch, special_points(branch)


def test_slopes_of_the_matrix_of_three_slices():
    """Against central differences of the product, whose order and places they must know."""
    problem = of_function(henon, 3)
    u, number = np.array([0.9, 0.3, -0.4, 0.8, 0.2, -0.6]), np.asarray(0.7)

    def of(matrix):
        return matrix[0, 1] + 2 * matrix[1, 0]  # changes if the product is turned round

    def at(u, number):
        return float(of(problem.linearised(u, number).seen.matrix))

    found = problem.vanishing(of, u, number, problem.linearised(u, number).seen)
    assert found.value == pytest.approx(at(u, number), rel=1e-12)
    # Of a polynomial, whose third order a step of 1e-3 makes 1e-6. The map's own differences leave
    # 1e-10, which a step of 1e-6 makes 1e-4.
    expected = differences(lambda both: at(both[:6], both[6]), [*u, number], 1e-3)
    np.testing.assert_allclose(np.concatenate(found.slopes), expected, atol=2e-3)


def test_folds_and_doublings_of_henons_map():
    """The fold at -(1 - b)^2 / 4, the doubling at 3 (1 - b)^2 / 4."""
    sections = of_function(henon, 1)
    # From the stable point at a = 0, down and round the fold.
    stable = np.full(2, 1 / 0.7)
    low, (fold,) = followed(sections, stable, 0.0, (-1.0, 0.3), upwards=False, points=25)
    assert fold.kind == "fold"
    assert low.points[-1].tangent[-1] > 0 > low.points[0].tangent[-1]
    # Past the fold the upper bound ends it: the unstable rest there is the other root.
    begin = np.full(2, np.roots([-0.06, 0.7, -1])[1])
    back, _ = followed(sections, begin, -0.06, (-1.0, -0.05), upwards=False, points=99)
    assert back.ended == OUTSIDE
    other = np.roots([-0.05, 0.7, -1])[0]
    np.testing.assert_allclose(back.points[-1].place, [other, other, -0.05], atol=1e-9)
    # Differences of 1e-6 leave 1e-9 of the derivatives.
    np.testing.assert_allclose(fold.parameter, -0.1225, atol=1e-8)
    _, (doubling,) = followed(sections, stable, 0.0, (-0.1, 0.5), upwards=True, points=200)
    assert doubling.kind == "period doubling"
    np.testing.assert_allclose(doubling.parameter, 0.3675, atol=1e-8)


def test_where_both_rests_of_the_logistic_map_cross():
    """These are 0 and 1 - 1 / r: they cross at r = 1."""
    rests = of_function(lambda state, number: number * state * (1 - state))
    guess, onward = np.array([0.02, 0.97]), np.array([1.0, 1.1])
    found = branch_point(rests, (1,), 1.0, guess, onward, furthest=0.1)
    # The map's own differences leave 1e-10 of its derivatives, and 1e-5 of what these bend.
    np.testing.assert_allclose(found.place, [0.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(found.tangent, np.sqrt([0.5, 0.5]), atol=1e-4)
    np.testing.assert_allclose(found.crossing[0] / found.crossing[1], 0.0, atol=1e-4)


@pytest.mark.parametrize("first", [0.25, 0.24])
def test_a_point_of_the_branch_that_is_an_event(first):
    """The rest of the logistic map has the multiplier r: it doubles at -1, where a step may end."""
    rest = of_function(lambda state, number: number * state * (1 - state))
    stride = Stride(first=first, longest=first, shortest=1e-4)
    more = dict(scale=1.0, bounds=(-1.6, 0.5), stride=stride)
    branch = follow(rest, np.zeros(1), -1.5, **more)
    assert (np.abs(branch.parameter + 1).min() < 1e-12) == (first == 0.25)
    (doubling,) = special_points(branch)
    assert doubling.kind == "period doubling"
    np.testing.assert_allclose(doubling.parameter, -1.0, atol=1e-8)


def cycle(number):
    """Of two turns of Henon's map."""
    state = np.zeros(2)
    for _ in range(1000):
        state = henon(state, number)
    return state


def test_a_branch_of_two_turns_from_birth_to_doubling():
    """It turns back in what it came from; and it doubles at (1 - b)^2 + (1 + b)^2 / 4."""
    sections = of_function(henon, 2)
    branch, (birth,) = followed(sections, cycle(0.6), 0.6, (0.1, 0.7), upwards=False, points=200)
    assert {point.turns for point in branch.points} == {2}
    assert birth.kind == "period doubling" and birth.point.turns == 1
    np.testing.assert_allclose(birth.parameter, 0.3675, atol=1e-8)
    branch, (last,) = followed(sections, cycle(0.8), 0.8, (0.1, 0.95), upwards=True, points=200)
    assert branch.ended == OUTSIDE
    assert last.kind == "period doubling" and last.point.turns == 2
    np.testing.assert_allclose(last.parameter, 0.9125, atol=1e-8)


def test_the_branch_that_leaves_at_a_doubling():
    """Its two places are the roots of a^2 x^2 - a (1 - b) x + (1 - b)^2 - a, at each a beyond."""
    branch, (doubling,) = followed(
        of_function(henon, 1), np.full(2, 1 / 0.7), 0.0, (-0.1, 0.5), upwards=True, points=200
    )
    problem, u, off = other_branch(branch, doubling)
    assert problem.period == 2
    places = []
    for upwards in (True, False):
        start = problem, u, doubling.parameter
        left = follow(*start, scale=1.0, bounds=(0.0, 0.6), off=off, upwards=upwards, points=9)
        assert {point.turns for point in left.points} == {2}
        for point in left.points:
            roots = np.roots([point.value**2, -0.7 * point.value, 0.49 - point.value])
            # The section closes to 1e-7, and Newton's method squares what is left of that.
            np.testing.assert_allclose(np.sort(point.u[:2]), np.sort(roots), atol=1e-9)
        places.append(left.points[0].u[:2])
    # To one side the first of the two turns is the upper one, to the other the lower.
    assert (np.diff(places[0]) * np.diff(places[1])).item() < 0


def test_a_step_past_the_birth_of_a_branch():
    """What repeats after one turn is no point of a branch of two; where it was left is located."""
    # So small that a step passes where the two turns come together.
    sections = of_function(lambda state, number: 1e-2 * henon(1e2 * state, number), 2)
    state = 1e-2 * cycle(0.4)
    branch, special = followed(sections, state, 0.4, (0.0, 0.95), upwards=False, points=200)
    assert branch.ended == SHORTER
    assert {point.turns for point in branch.points} == {2} and branch.parent.turns == 1
    assert special == []
    birth = origin(branch, branch.parent)
    assert birth.point.turns == 1
    np.testing.assert_allclose(birth.parameter, 0.3675, atol=1e-8)


@pytest.mark.parametrize("raised", [None, ValueError("Argument `x` must be right.")])
def test_a_change_that_is_seen_but_not_located(raised):
    """No orbit about the doubling: that is said; an error of the map is not taken for that."""

    followed = []

    def broken(state, number):
        if not followed or abs(number - 0.3675) > 5e-3:
            return henon(state, number)
        if raised is not None:
            raise raised
        return np.full(2, np.nan)

    start, stride = np.full(2, 1 / 0.7), Stride(first=0.05, longest=0.05, shortest=1e-3)
    branch = follow(
        of_function(broken, 1), start, 0.3, scale=1.0, bounds=(0.2, 0.42), stride=stride
    )
    followed.append(branch)
    if raised is not None:
        with pytest.raises(ValueError, match="must be right"):
            special_points(branch)
    else:
        (one,) = special_points(branch)
        assert one.kind == "period doubling" and np.isnan(one.parameter) and one.point is None
        assert sharpened(branch, one) is one


def test_a_pair_that_leaves_the_unit_circle():
    sections = of_function(delayed_logistic, 1)
    start = np.full(3, 0.4), 1 / 0.6
    _, (special,) = followed(sections, *start, (1.5, 2.3), upwards=True, points=200)
    assert special.kind == "Neimark-Sacker"
    np.testing.assert_allclose(special.parameter, 2.0, atol=1e-8)
    moduli = np.sort(np.abs(special.point.multipliers))
    np.testing.assert_allclose(moduli, [0.3, 1, 1], atol=1e-8)


FREE = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-1, 1, -0.03, 0.03], [1, -2, 0.03, -0.06]])
HELD = FREE - np.array([[0, 0, 0, 0], [0, 0, 0, 0], [100, 0, 0, 0], [0, 0, 0, 0]])


def stopped(phase, values, speed, gap):
    """NLvib's example 03, two masses and a stop, with its tangents: rates by the phase of the load.

    Columns of `values`: the state, its derivatives by the first, by the speed and, if wanted, by
    the gap.
    """
    columns = values.reshape(-1, 4).T
    held = columns[0, 0] > gap
    rates = (HELD if held else FREE) @ columns
    rates[3, 0] += 0.1 * np.cos(phase)
    if held:
        rates[2, 0] += 100 * gap
        rates[2, 6:] += 100
    rates[:, 5] -= rates[:, 0] / speed
    return rates.T.ravel() / speed


# Seven digits are published.
WELL = dict(method="DOP853", rtol=1e-9, atol=1e-9)


def speed_and_gap(point):
    return float(point[0]), float(point[1]) if point.size > 1 else 1.0


def one_turn(point, states):
    begun = np.concatenate([states[0], np.eye(4).ravel(), np.zeros(4 * point.size)])
    run = solve_ivp(stopped, (0, 2 * np.pi), begun, args=speed_and_gap(point), **WELL)
    after, by_state, by_point = np.split(run.y[:, -1].reshape(-1, 4).T, [1, 5], axis=1)
    return after.T, by_state[None], by_point[None]


def reach(numbers, state):
    """How far the first mass comes beyond the gap, in a turn."""
    speed, gap = numbers

    def rates(phase, state):
        held = state[0] > gap
        pushed = np.array([0, 0, 100 * gap if held else 0, 0.1 * np.cos(phase)])
        return ((HELD if held else FREE) @ state + pushed) / speed

    turning = lambda phase, state: state[2]  # noqa: E731
    # A step that holds the touch would leave 5e-5 of the way between its ends.
    more = dict(events=turning, max_step=0.2)
    run = solve_ivp(rates, (0, 2 * np.pi), state, **more, **WELL)
    return np.array([run.y_events[0][:, 0].max() - gap])


@pytest.mark.slow
def test_two_masses_and_a_stop():
    """The points published for NLvib's example 03. Its stiffness jumps: nodes do not reach them."""
    sections = of_map(one_turn, watches=reach)
    near, more = np.array([0.961, 0.658, 0.317, 0.086]), dict(scale=0.05)
    quiet, found = followed(sections, near, 0.635, (0.61, 0.7), upwards=False, points=9, **more)
    moduli = np.sort(np.abs(quiet.points[0].multipliers))
    np.testing.assert_allclose(moduli, [0.72329, 0.72329, 0.88575, 0.88575], atol=6e-6)
    near = np.array([0.567, 0.633, 0.646, 0.822])
    _, louder = followed(sections, near, 0.731819, (0.73, 0.76), upwards=True, points=22, **more)
    found = sorted(found + louder, key=lambda one: one.parameter)
    kinds = ["Neimark-Sacker", "period doubling", "period doubling", "fold"]
    assert [one.kind for one in found] == kinds
    speeds = [one.parameter for one in found]
    np.testing.assert_allclose(speeds, [0.6186069, 0.7387830, 0.7555862, 0.7556274], atol=6e-8)
    contact_ends(replace(sections, watched=("contact ends",)), quiet)


def contact_ends(sections, branch):
    """Where the first mass just reaches the stop, its motion is linear: known for each gap.

    Near there a multiplier changes as the root of the depth, so that no step of a branch is short
    enough. The curve of the event needs only an orbit near it.
    """
    last = branch.points[-1]
    assert reach((branch.parameter[-1], 1.0), last.u) > 0
    curve = curve_of(sections, "contact ends", (4,), 0.05, (0.5, 0.62))
    found = []
    for upwards in (True, False):
        start = curve.joined(last.u, branch.parameter[-1]), 1.0
        more = dict(stride=Stride(first=0.1, longest=0.2, shortest=1e-6), points=3)
        way = follow(curve, *start, scale=1.0, bounds=(0.5, 2.0), upwards=upwards, **more)
        found += [curve.split(point.u, point.value)[1] for point in way.points]
    speeds, gaps = np.array(found).T
    assert len(gaps) == 6 and gaps.min() < 0.9 and gaps.max() > 1.05
    np.testing.assert_allclose(speeds[0], 0.5819, atol=5e-6)  # as published
    stiffness, damping = -FREE[2:, :2], -FREE[2:, 2:]
    for speed, gap in zip(speeds, gaps, strict=True):
        dynamic = stiffness - speed**2 * np.eye(2) + 1j * speed * damping
        # The section closes to 1e-7, and Newton's method squares what is left of that.
        np.testing.assert_allclose(abs(np.linalg.solve(dynamic, [0, 0.1])[0]), gap, rtol=1e-7)
