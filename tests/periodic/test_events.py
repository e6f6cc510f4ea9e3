"""Events that lie close together, and branches that leave at them, against closed forms."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import mathieu_a, mathieu_b

from jaxcrusher.orbits.forced import least_penetrations
from jaxcrusher.periodic.branch import OUTSIDE, follow
from jaxcrusher.periodic.branch_point import branch_point
from jaxcrusher.periodic.collocation import collocate
from jaxcrusher.periodic.collocation_problem import CollocationProblem
from jaxcrusher.periodic.events import other_branch, sharp_points, special_points
from jaxcrusher.periodic.problem import Stride
from jaxcrusher.periodic.system import System
from tests.pairs import crossed


def mathieu(time, x, rate, args):
    """x'' + (a + b cos t) x + x^3 = 0."""
    a, b = args
    return -(a + b * jnp.cos(time)) * x - x**3


def mathieus(a, b):
    return System(mathieu, jnp.asarray(2 * np.pi), (a, b))


def rest_branch(b, bounds, *, longest):
    """The branch of rest over a."""
    problem = CollocationProblem(family=eqx.Partial(mathieus, b=jnp.asarray(b)))
    stride = Stride(first=longest / 5, longest=longest, shortest=1e-6)
    more = dict(scale=1.0, bounds=bounds, stride=stride, points=80)
    return follow(problem, np.zeros((8, 1)), bounds[0], **more)


@pytest.mark.parametrize(
    ("shift", "tongue"),
    crossed(0.01 * np.arange(5), ((2, "branch point", 0.1), (3, "period doubling", 0.4))),
)
def test_two_events_inside_one_step(shift, tongue):
    """Tongues of Mathieu's equation narrower than a step, wherever the step begins."""
    order, kind, b = tongue
    expected = [edge(order, 2 * b) / 4 for edge in (mathieu_b, mathieu_a)]
    bounds = (expected[0] - 0.31 - shift, expected[1] + 0.31)
    branch = rest_branch(b, bounds, longest=0.05)
    places = branch.parameter
    assert expected[1] - expected[0] < 0.2 * np.diff(places).max()
    assert not ((places > expected[0]) & (places < expected[1])).any()
    special = special_points(branch)
    assert [one.kind for one in special] == [kind, kind]
    # In a narrow tongue a test function is nearly flat: its rounding, 1e-13, over its slope.
    np.testing.assert_allclose([one.parameter for one in special], expected, atol=2e-9)


@pytest.mark.parametrize(("order", "turns", "b"), [(1, 2, 1e-3), (2, 1, 0.02)])
def test_a_branch_that_leaves(order, turns, b):
    """Beside a tongue the cubic stiffness holds a motion A sin(n t / 2): a + 3 A^2 / 4 stays.

    That is the first harmonic's balance. It errs by b and A^2 as shares of itself.
    """
    at, other = (edge(order, 2 * b) / 4 for edge in (mathieu_b, mathieu_a))
    side, step = np.sign(other - at), abs(other - at) / 4
    bounds = sorted((at - side * 10.5 * step, at + side * 2.5 * step))
    special = special_points(rest_branch(b, tuple(bounds), longest=step))
    (birth,) = (one for one in special if abs(one.parameter - at) < step)
    branch = rest_branch(b, tuple(bounds), longest=step)
    problem, u, off = other_branch(branch, birth)
    assert problem.period == turns and len(u) == 8 * turns
    for upwards in (True, False):
        more = dict(scale=1.0, bounds=(at - 1, at + 1), off=off, upwards=upwards, points=8)
        left = follow(problem, u, birth.parameter, **more)
        assert len(left.points) == 8
        for point in left.points[1:]:
            phases = np.pi * order * np.arange(len(u)) / 8
            amplitude = 2 * abs(point.u[:, 0] @ np.exp(1j * phases)) / len(u)
            expected = np.sqrt(4 / 3 * (at - point.value))
            np.testing.assert_allclose(amplitude, expected, rtol=b + expected**2)
            assert point.turns == turns


def dipping(time, x, rate, number):
    """A joint whose depth, at its least, is as deep as a number says: between two nodes."""
    return (1 + number - 0.1 * jnp.cos(time - 0.1)) * jnp.array([1.0, 0.0]) - x


def test_contact_is_lost_between_instants():
    """By Newton's method in time: 1 + p - 0.1 * 2 / 3 cos(t - 0.1) touches 1 at p = 1 / 5 exactly.

    x'' = f - x is resonant, so the stiffness is 3 here: of the harmonic 1 / (3 - 1) is left.
    """
    stiff = lambda t, x, v, p: dipping(t, 3 * x, v, 3 * p + 2)  # noqa: E731
    family = lambda p: System(stiff, jnp.asarray(2 * np.pi), p)  # noqa: E731
    problem = CollocationProblem(family=family, watched=("lost",), watch=least_penetrations)
    rest = np.tile([[1.2, 0.0]], (16, 1))
    branch = follow(problem, rest, 0.3, scale=1.0, bounds=(-1, 1), upwards=False)
    (lost,) = special_points(branch)
    # (1 + 3 p + 2) / 3 - 0.1 / 2 = 1.
    np.testing.assert_allclose(lost.parameter, 0.05, atol=1e-12)
    phases = 2 * np.pi * np.arange(16) / 16
    swings = np.stack([1.5 - 0.2 * np.cos(3 * phases - 0.1), 0 * phases], axis=1)
    np.testing.assert_allclose(least_penetrations(jnp.asarray(swings)), [0.3], atol=1e-14)


def test_the_least_penetration_has_second_derivatives():
    """Of 1.5 - 0.2 cos - p sin, whose least value is 1.5 - sqrt(0.04 + p^2), wherever it is."""
    phases = 2 * np.pi * np.arange(16) / 16

    def least(p):
        place = 1.5 - 0.2 * jnp.cos(phases) - p * jnp.sin(phases)
        return least_penetrations(jnp.stack([place, 0 * place], axis=1))[0]

    size = np.hypot(0.2, 0.1)
    # Rounding.
    np.testing.assert_allclose(jax.grad(least)(0.1), -0.1 / size, rtol=1e-11)
    np.testing.assert_allclose(jax.hessian(least)(0.1), -(0.2**2) / size**3, rtol=1e-11)


def test_the_least_penetration_of_a_pin_at_rest_has_slopes():
    """Moved as a whole it is deeper by the way along its direction, in reverse as forwards."""
    rest = jnp.tile(jnp.array([1.2, -0.9]), (16, 1))
    moved = lambda by: least_penetrations(rest + by[None])[0]  # noqa: E731
    for slopes in (jax.grad(moved), jax.jacfwd(moved)):
        np.testing.assert_allclose(slopes(jnp.zeros(2)), [0.8, -0.6], rtol=1e-12)


def ueda(time, x, rate, force):
    """x'' + 0.1 x' + x^3 = B cos t."""
    return force * jnp.cos(time) - 0.1 * rate - x**3


def uedas(force):
    return System(ueda, jnp.asarray(2 * np.pi), force)


# Where the symmetric orbit's half map has the multiplier -1: by SciPy's DOP853 at 1e-12, the orbit,
# its null vector and B solved for at once.
UEDA_BREAKS = 2.28638170514


@pytest.mark.parametrize(("nodes", "scale"), [(24, 0.1), (48, 0.02), (48, 1.0)])
def test_a_motion_that_loses_its_symmetry(nodes, scale):
    """At the branch point Newton's method along the branch is singular, and leads to nothing."""
    phases = 2 * np.pi * np.arange(nodes)[:, None] / nodes
    guess = 1.9 * np.cos(phases) + 0.3 * np.sin(phases)
    x, root = collocate(uedas(jnp.asarray(2.2)), jnp.asarray(guess))
    assert root.success
    problem = CollocationProblem(family=uedas)
    branch = follow(problem, x, 2.2, scale=scale, bounds=(2.2, 2.32), points=60)
    (birth,) = sharp_points(branch)
    assert birth.kind == "branch point"
    # SciPy's tolerance and rounding leave 1e-11.
    assert abs(birth.parameter - UEDA_BREAKS) < birth.error + 1e-11 < 1e-9
    # The branch itself is symmetric, and to both sides others leave it, each other's images.
    size = np.max(np.abs(birth.point.u))
    half = lambda u: u + np.roll(u, len(u) // 2, axis=0)  # noqa: E731
    np.testing.assert_allclose(half(birth.point.u), 0, atol=1e-9 * size)
    if (nodes, scale) != (48, 1.0):
        return
    problem, u, off = other_branch(branch, birth)
    more = dict(scale=scale, bounds=(2.2, 2.4), off=off, points=4)
    one, other = (
        follow(problem, u, birth.parameter, upwards=upwards, **more).points[-1]
        for upwards in (True, False)
    )
    assert one.value == pytest.approx(other.value) and scale * one.value > UEDA_BREAKS
    np.testing.assert_allclose(one.u, -np.roll(other.u, nodes // 2, axis=0), atol=1e-6)
    assert np.max(np.abs(half(one.u))) > 0.01 and np.max(np.abs(one.multipliers)) < 1


def crossing(time, x, rate, number):
    """Orbits x = 0.3 cos t + p^2, and those moved by p, which cross where p is zero."""
    away = x - 0.3 * jnp.cos(time) - number**2
    return away * (number - away) - 0.3 * jnp.cos(time) - 0.1 * (rate + 0.3 * jnp.sin(time))


@pytest.mark.parametrize("moved", [0.0, 1.0])
def test_two_branches_that_cross(moved):
    problem = CollocationProblem(family=lambda p: System(crossing, jnp.asarray(2 * np.pi), p))
    x = 0.3 * np.cos(2 * np.pi * np.arange(16)[:, None] / 16) + 0.25 - 0.5 * moved
    branch = follow(problem, x, -0.5, scale=1.0, bounds=(-0.6, 0.3), points=60)
    (birth,) = special_points(branch)
    assert birth.kind == "branch point"
    # Rounding, and in a slope what differences of Jacobians leave.
    np.testing.assert_allclose(birth.parameter, 0.0, atol=1e-12)
    way = birth.point.tangent
    np.testing.assert_allclose(way[0] / way[-1], moved, atol=1e-7)
    # The other branch is followed to both sides, with the mean that it has exactly.
    problem, u, off = other_branch(branch, birth)
    for upwards in (True, False):
        left = follow(problem, u, 0.0, scale=1.0, bounds=(-0.6, 0.3), off=off, upwards=upwards)
        assert np.all((left.parameter > 0) == upwards) and left.ended == OUTSIDE
        means = [np.mean(point.u) for point in left.points]
        np.testing.assert_allclose(
            means, left.parameter**2 + (1 - moved) * left.parameter, atol=1e-11
        )
        # Out of bounds there is none of it; on a bound it ends at once.
        side = (-0.6, 0.0) if upwards else (0.0, 0.3)
        none = follow(problem, u, 0.0, scale=1.0, bounds=side, off=off, upwards=upwards)
        assert none.points == [] and none.ended == OUTSIDE
        more = dict(scale=1.0, bounds=(-0.5, 0.3), upwards=False)
        one = follow(branch.problem, x, -0.5, **more)
        assert len(one.points) == 1 and one.ended == OUTSIDE


@pytest.mark.parametrize(
    ("shape", "furthest"),
    [
        # A hyperbola: its two branches cross nowhere, and at rest where it is unfolded.
        (lambda x, p: p**2 - x**2 - 1, 10.0),
        (lambda x, p: p**2 - x**2, 0.1),  # branches that cross further off
        (lambda x, p: p**2 + x**2, 10.0),  # a lone orbit
    ],
)
def test_where_there_is_no_branch_point(shape, furthest):
    family = lambda p: System(lambda time, x, rate, p: shape(x, p) - rate, jnp.asarray(1.0), p)  # noqa: E731
    guess, along = np.append(np.full(4, -0.1), 0.2), np.append(np.ones(4), 0.1)
    problem = CollocationProblem(family=family)
    assert branch_point(problem, (4, 1), 1.0, guess, along, furthest) is None
