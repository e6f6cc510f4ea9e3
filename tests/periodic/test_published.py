"""Events against what AUTO-07p prints for its own demos.

The numbers are those of `test/hyper.all` in github.com/auto-07p/auto-07p, six digits of each.
"""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxcrusher.periodic.branch import follow
from jaxcrusher.periodic.collocation_problem import CollocationProblem
from jaxcrusher.periodic.events import other_branch, special_points
from jaxcrusher.periodic.problem import Stride
from jaxcrusher.periodic.system import System
from tests.periodic.maps import of_map

# What is left of a difference from the flow after a time of one is exp(-DECAY).
DECAY = 10.0


def neuron(time, state, rate, args):
    """Demo `ffn`, forced FitzHugh-Nagumo equations of first order, as one of second order.

    With x' = g the equation is (x' - g)' = -DECAY (x' - g): it has the same orbits, and beside
    their multipliers exp(-DECAY T) for each unknown.
    """
    a, amplitude = args
    (x, y), (x_rate, y_rate), force = state, rate, amplitude * jnp.cos(10 * time)
    force_rate = -10 * amplitude * jnp.sin(10 * time)
    flow = jnp.stack([3 * (x - x**3 / 3 + y - force), -(x - a + 0.8 * y) / 3])
    bend = [3 * ((1 - x**2) * x_rate + y_rate - force_rate), -(x_rate + 0.8 * y_rate) / 3]
    return jnp.stack(bend) - DECAY * (rate - flow)


PERIOD = np.pi / 5


def over_offset(a):
    return System(neuron, jnp.asarray(PERIOD), (a, 0.1))


def over_amplitude(amplitude):
    return System(neuron, jnp.asarray(PERIOD), (0.0, amplitude))


@pytest.mark.parametrize(
    ("family", "bounds", "scale", "published"),
    [(over_offset, (0.0, 0.5), 0.1, 0.422945), (over_amplitude, (0.1, 5.0), 1.0, 4.52337)],
)
def test_the_torus_of_a_forced_neuron(family, bounds, scale, published):
    stride = Stride(first=0.2, longest=0.8, shortest=1e-6)
    more = dict(scale=scale, bounds=bounds, stride=stride, points=40)
    branch = follow(CollocationProblem(family=family), np.zeros((24, 2)), bounds[0], **more)
    (torus,) = special_points(branch)
    assert torus.kind == "Neimark-Sacker"
    # Half of the last digit that AUTO prints.
    np.testing.assert_allclose(torus.parameter, published, rtol=1.5e-6)
    quick = np.sort(np.abs(torus.point.multipliers))[:2]
    np.testing.assert_allclose(quick, np.exp(-DECAY * PERIOD), rtol=1e-6)


def lorenz(time, values, r):
    """Demo `lor`: the Lorenz equations, with derivatives of the state by others and, last, by r."""
    (x, y, z), slopes = values[:3], values.reshape(3, -1, order="F")
    rates = np.array([[-10, 10, 0], [r - z, -1, -x], [y, x, -8 / 3]]) @ slopes
    rates[:, 0] = 10 * (y - x), r * x - y - x * z, x * y - 8 / 3 * z
    rates[1, 3:] += x if slopes.shape[1] > 3 else 0
    return rates.ravel(order="F")


def passes(time, values, r):
    """The section x = 0; the state is not yet back at the beginning."""
    return values[0] if time > 0.1 else 1.0


passes.terminal, passes.direction = True, 1


def round_once(point, states):
    """The map of (y, z) from a section to the next: the freedom of phase is gone."""
    begun = np.concatenate([[0.0], states[0], [0, 1, 0], [0, 0, 1], np.zeros(3)])
    more = dict(method="DOP853", rtol=1e-8, atol=1e-8, events=passes)
    run = solve_ivp(lorenz, (0, 9), begun, args=(float(point[0]),), **more)
    end = run.y[:, -1].reshape(3, -1, order="F")
    rate = lorenz(0, end[:, 0], float(point[0]))
    slopes = (end - np.outer(rate, end[0] / rate[0]))[1:, 1:]
    return end[None, 1:, 0], slopes[None, :, :2], slopes[None, :, 2:]


def test_the_cascade_of_lorenz():
    """The second doubling is on the branch that leaves at the first."""
    # A state is of order 100, so steps are a hundred times as long as those of clearances.
    stride = Stride(first=1.0, longest=40.0, shortest=1e-3, straight=0.1, located=1e-7)
    more = dict(scale=0.1, stride=stride, points=40)
    sections = of_map(round_once)
    # Where a run comes to at r = 231.
    start = np.array([52.9, 207.6])
    branch = follow(sections, start, 231.0, bounds=(229.0, 232.0), upwards=False, **more)
    found = special_points(branch)
    problem, u, off = other_branch(branch, found[-1])
    begin = problem, u, found[-1].parameter
    found += special_points(follow(*begin, off=off, bounds=(217.8, 230.0), **more))
    assert [one.kind for one in found] == ["period doubling"] * 2
    assert [one.point.turns for one in found] == [1, 2]
    # Half of the last digit that AUTO prints.
    places = [one.parameter for one in found]
    np.testing.assert_allclose(places, [229.407, 218.210], atol=6e-4)
