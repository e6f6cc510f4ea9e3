"""Events over two parameters, against closed forms and published curves."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import mathieu_a, mathieu_b

from jaxcrusher.orbits.forced import least_penetrations
from jaxcrusher.periodic.branch import HAPPENED, OUTSIDE, follow
from jaxcrusher.periodic.collocation import collocate
from jaxcrusher.periodic.collocation_problem import CollocationProblem
from jaxcrusher.periodic.event_curve import curve_of, cusps
from jaxcrusher.periodic.events import special_points, zeros
from jaxcrusher.periodic.problem import Stride
from jaxcrusher.periodic.system import System
from tests.pairs import slow
from tests.periodic.maps import of_map
from tests.periodic.systems import duffing, mathieu

PHASES = 2 * np.pi * np.arange(48)[:, None] / 48


def at_second(first, family, second):
    """A family over its first parameter alone."""
    return family(jnp.stack([first, jnp.asarray(second)]))


def first_event(family, x, second, bounds, **more):
    """The first event of a branch over the first parameter."""
    problem = CollocationProblem(family=eqx.Partial(at_second, family=family, second=second))
    x, root = collocate(problem.family(jnp.asarray(bounds[0])), jnp.asarray(x))
    assert root.success
    branch = follow(problem, x, bounds[0], scale=0.1, bounds=bounds, points=150, **more)
    return special_points(branch)[0]


def followed(curve, special, second, scale, bounds, *, upwards, points):
    """A curve, and both parameters along it."""
    start, more = curve.joined(special.point.u, special.parameter), dict(bounds=bounds)
    more |= dict(scale=scale, upwards=upwards, points=points)
    branch = follow(curve, start, second, **more)
    both = [curve.split(point.u, scale * point.value)[1] for point in branch.points]
    return branch, np.array(both)


@pytest.mark.parametrize("order", [1, *slow(3)])
def test_tongues_of_mathieus_equation(order):
    """Where rest doubles its period, a is a characteristic value over all q = 2 b."""
    family = lambda both: System(mathieu, jnp.asarray(2 * np.pi), both)  # noqa: E731
    begin = order**2 / 4
    stride = Stride(first=0.02, longest=0.1, shortest=1e-6)
    special = first_event(family, np.zeros((8, 1)), 0.4, (begin - 0.3, begin + 0.3), stride=stride)
    assert special.kind == "period doubling"
    base = CollocationProblem(family=family)
    curve = curve_of(base, special.kind, (8, 1), 0.1, (-2.0, 9.0))
    _, both = followed(curve, special, 0.4, 0.1, (0.05, 1.0), upwards=True, points=40)
    assert both[-1, 1] == pytest.approx(1.0, abs=1e-15) and len(both) > 10
    # Of the two edges the lower one; which is sine and which cosine the sign of b says.
    edges = np.array(
        [[edge(order, 2 * b) / 4 for edge in (mathieu_a, mathieu_b)] for b in both[:, 1]]
    )
    # SciPy's values have twelve digits; Magnus' steps leave 1e-10.
    np.testing.assert_allclose(both[:, 0], edges.min(axis=1), rtol=1e-9)


def duffings(both, c):
    return System(duffing, 2 * jnp.pi / both[0], (c, 1.0, both[1], both[0]))


@pytest.mark.slow
def test_folds_of_duffings_equation():
    """Both folds published for f = 0.015 lie on one curve, and meet in a cusp."""
    family = eqx.Partial(duffings, c=0.04)
    stride = Stride(first=0.02, longest=0.3, shortest=1e-6)
    fold = first_event(family, 0.3 * np.cos(PHASES), 0.015, (0.9, 1.2), stride=stride)
    curve = curve_of(CollocationProblem(family=family), "fold", (48, 1), 0.1, (0.5, 2.0))
    branch, both = followed(curve, fold, 0.015, 2e-3, (1e-3, 0.016), upwards=False, points=80)
    assert branch.ended == OUTSIDE
    np.testing.assert_allclose(both[0, 0], 1.0492623992, atol=2e-10)
    # Back at 0.015, on the other side of the cusp.
    ((_, back),) = zeros(branch, lambda point: point.value - 0.015 / 2e-3)
    other = float(curve.split(back.u, 0.015)[1][0])
    np.testing.assert_allclose(other, 1.0439137088, atol=2e-10)
    (cusp,) = cusps(branch)
    np.testing.assert_allclose(cusp.parameter, both[:, 1].min(), rtol=1e-3)
    # There both parameters stand still along the curve; brentq leaves 1e-12 of a step.
    assert abs(cusp.point.tangent[-1]) < 1e-9


def van_der_pol(time, x, rate, args):
    f, w = args
    return f * jnp.cos(w * time) + 0.3 * (1 - x**2) * rate - x


@pytest.mark.slow
def test_where_van_der_pol_is_no_longer_driven():
    """A pair leaves the circle where det M = 1, so where x^2 is 1 in the mean (Liouville)."""
    family = lambda both: System(van_der_pol, 2 * jnp.pi / both[0], (both[1], both[0]))  # noqa: E731
    stride = Stride(first=0.02, longest=0.3, shortest=1e-6)
    # Far off resonance a strong force holds the oscillator.
    x = 0.8 / (1 - 1.6**2) * np.cos(PHASES)
    branch = follow(
        CollocationProblem(family=eqx.Partial(at_second, family=family, second=2.0)),
        collocate(family(jnp.array([1.3, 2.0])), jnp.asarray(5 * x))[0],
        1.3, scale=0.1, bounds=(1.2, 2.5), stride=stride, points=100,
    )  # fmt: skip
    special = special_points(branch)[0]
    assert special.kind == "Neimark-Sacker"
    curve = curve_of(CollocationProblem(family=family), special.kind, (48, 1), 0.1, (1.02, 2.4))
    branch, both = followed(curve, special, 2.0, 0.3, (0.3, 3.0), upwards=False, points=40)
    assert len(both) > 10 and both[:, 1].min() < 1.0
    mean = [np.mean(point.u[:48] ** 2) for point in branch.points]
    np.testing.assert_allclose(mean, 1.0, atol=1e-9)


def swaying(time, x, rate, both):
    """Two pins: one rests, and one that a spring of 3 holds is driven by f cos w t."""
    w, f = both
    pull = jnp.array([1.0, 1.0, 3.0, 3.0]) * (jnp.array([2.0, 0.0, 1.5, 0.0]) - x)
    return pull - 0.2 * rate + jnp.array([0.0, 0.0, f, 0.0]) * jnp.cos(w * time)


@pytest.mark.slow
def test_contact_is_lost_over_two_numbers():
    """A linear motion of amplitude 0.5 just touches: f = sqrt((3 - w^2)^2 + (0.2 w)^2) / 2.

    The curve of the event comes down to the resonance, where f is least, and goes up again.
    """
    family = lambda both: System(swaying, 2 * jnp.pi / both[0], both)  # noqa: E731
    exact = lambda w: np.sqrt((3 - w**2) ** 2 + (0.2 * w) ** 2) / 2  # noqa: E731
    base = CollocationProblem(family=family, watched=("rests", "lost"), watch=least_penetrations)
    lower = replace(base, family=eqx.Partial(at_second, family=family, second=0.3))
    rest = np.tile([[2.0, 0.0, 1.5, 0.0]], (8, 1))
    stride = Stride(first=0.2, longest=0.5, shortest=1e-6)
    branch = follow(lower, rest, 1.5, scale=0.1, bounds=(1.0, 2.0), stride=stride, points=20)
    (lost,) = special_points(branch)
    assert branch.ended == HAPPENED.format("lost") and lost.kind == "lost"
    np.testing.assert_allclose(exact(lost.parameter), 0.3, atol=1e-10)
    curve = curve_of(base, lost.kind, (8, 4), 0.1, (1.0, 2.5))
    branch, found = followed(curve, lost, 0.3, 0.1, (0.1, 0.4), upwards=False, points=40)
    assert branch.ended == OUTSIDE and found[-1, 0] > np.sqrt(3) > found[0, 0]
    # Newton's method leaves 1e-10 of the nodes.
    np.testing.assert_allclose(found[:, 1], exact(found[:, 0]), atol=1e-9)


def ball():
    """A ball on a table that moves by a sine, flying high (Guckenheimer and Holmes 1983, 2.4).

    The map stands in place of the integrated turn: in one slice the ball flies, in one it bounces.
    """

    def bounced(point, states):
        (phase, speed), (landed, falling) = states
        force, kept = np.append(point, 0.5)[:2]
        ends = [phase + speed - 2 * np.pi, speed], [landed, kept * falling - force * np.cos(landed)]
        flies, bounces = [[1, 1], [0, 1]], [[1, 0], [force * np.sin(landed), kept]]
        forcing = np.zeros((2, 2, 2))
        forcing[1, 1] = -np.cos(landed), falling
        return np.array(ends), np.array([flies, bounces]), forcing[:, :, : point.size]

    return of_map(bounced, slices=2)


def test_a_bouncing_ball_doubles_its_period():
    """Once a turn: born at 2 pi (1 - k), doubled at 2 sqrt(pi^2 (1 - k)^2 + (1 + k)^2).

    Their formulas for n = 1, with the restitution k.
    """
    force, problem = 4.0, ball()
    state = np.array([-np.arccos(2 * np.pi * (0.5 - 1) / force), 2 * np.pi])
    start = problem.unknowns_from(state, force), force
    branch = follow(problem, *start, scale=1.0, bounds=(3.0, 5.0), points=40)
    (special,) = special_points(branch)
    assert special.kind == "period doubling"
    exact = lambda kept: 2 * np.sqrt(np.pi**2 * (1 - kept) ** 2 + (1 + kept) ** 2)  # noqa: E731
    # The section points close to 1e-7, and Newton's method squares what is left of that.
    np.testing.assert_allclose(special.parameter, exact(0.5), atol=1e-8)
    curve = curve_of(problem, special.kind, (4,), 1.0, (0.1, 10.0))
    _, both = followed(curve, special, 0.5, 0.1, (0.2, 0.9), upwards=True, points=40)
    assert both[-1, 1] > 0.8
    np.testing.assert_allclose(both[:, 0], exact(both[:, 1]), atol=1e-7)


def henon(point, states):
    (state,), (number, share) = states, point
    ends = np.array([[1 - number * state[0] ** 2 + share * state[1], state[0]]])
    forcing = np.array([[[-(state[0] ** 2), state[1]], [0.0, 0.0]]])
    return ends, np.array([[[-2 * number * state[0], share], [1.0, 0.0]]]), forcing


@pytest.mark.parametrize(
    ("kind", "factor", "place"), [("fold", -1, 2), ("period doubling", 3, 2 / 3)]
)
def test_a_curve_from_where_a_number_is_zero(kind, factor, place):
    """Henon's map folds at -(1 - b)^2 / 4 and doubles at 3 (1 - b)^2 / 4, and b may begin at 0."""
    base = of_map(henon, watches=lambda p, state: p + state, watched=("one", "other"))
    curve = curve_of(base, kind, (2,), 0.1, (-5.0, 5.0))
    begin = curve.joined(np.full(2, place), factor / 4)
    branch = follow(curve, begin, 0.0, scale=0.1, bounds=(-0.1, 0.1), points=30)
    assert branch.ended == OUTSIDE
    first = [float(curve.split(one.u, 0.0)[1][0]) for one in branch.points]
    np.testing.assert_allclose(first, factor / 4 * (1 - branch.parameter) ** 2, atol=1e-12)
    # Of what is watched too.
    by_state, by_number = base.monitored(1, np.ones(2), np.array([1.0, 0.0]), None).slopes
    np.testing.assert_allclose([*by_state, *by_number], [0, 1, 0, 1], atol=1e-9)
