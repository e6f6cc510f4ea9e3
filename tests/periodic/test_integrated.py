"""Shooting with the integrator's own motions, against collocation and Liouville's formula."""

import jax.numpy as jnp
import numpy as np

from jaxcrusher.periodic.branch import HAPPENED, follow
from jaxcrusher.periodic.collocation_problem import CollocationProblem
from jaxcrusher.periodic.events import special_points
from jaxcrusher.periodic.integrated import IntegratedSystem
from jaxcrusher.periodic.shooting_problem import ShootingProblem
from jaxcrusher.periodic.system import System


def duffing(time, x, rate, speed):
    return 0.3 * jnp.cos(speed * time) - 0.2 * rate - x - x**3


def over_speed(p):
    speed = p.reshape(())
    return System(duffing, 2 * jnp.pi / speed, speed)


def test_the_fold_is_that_of_collocation():
    nodes = CollocationProblem(family=over_speed)
    start, more = 1.0, dict(scale=0.1, bounds=(0.5, 2.0), points=60)
    branch = follow(nodes, np.zeros((48, 1)), start, **more | {"points": 200})
    by_nodes = [one for one in special_points(branch) if one.kind == "fold"]
    states = ShootingProblem(flow=IntegratedSystem(over_speed))
    first = branch.points[0]
    rate = np.asarray(over_speed(jnp.asarray(start)).motion(jnp.asarray(first.u))[1])
    begin = states.unknowns_from(np.concatenate([first.u[0], rate[0]]), start)
    shot = follow(states, begin, start, **more)
    by_states = [one for one in special_points(shot) if one.kind == "fold"]
    assert len(by_nodes) == len(by_states) == 2
    for one, other in zip(by_nodes, by_states, strict=True):
        # Shooting closes to 1e-7, and a fold is known to the square of what that leaves.
        np.testing.assert_allclose(other.parameter, one.parameter, rtol=1e-8)


def bilinear(time, x, rate, args):
    """A spring that is twice as stiff on one side: its force has a bend."""
    speed, damping = args
    return jnp.cos(speed * time) - damping * rate - jnp.where(x > 0, 2.0, 1.0) * x


def test_an_orbit_of_a_bent_spring():
    """The determinant of the monodromy matrix is exp(-damping T), however the spring bends."""
    damping = 0.2

    def family(p):
        return System(bilinear, 2 * jnp.pi / p[0], (p[0], damping))

    lowest = lambda x: jnp.min(x, axis=0) + 1.5  # noqa: E731
    problem = ShootingProblem(
        flow=IntegratedSystem(family, lowest), period=1, watched=("too far down",)
    )
    begin = problem.unknowns_from(np.zeros(2), 1.6)
    branch = follow(problem, begin, 1.6, scale=0.1, bounds=(1.3, 2.0), upwards=False, points=30)
    for point in branch.points:
        period = 2 * np.pi / (branch.scale * point.value)
        # The tolerance of the integrations is 1e-10, and a bend costs some digits of it.
        np.testing.assert_allclose(
            np.linalg.det(point.monodromy), np.exp(-damping * period), rtol=1e-7
        )
    (special,) = [one for one in special_points(branch) if one.kind == "too far down"]
    deepest = special.point.monitors[0]
    # The place is located to 1e-7 of a step.
    np.testing.assert_allclose(deepest, 0.0, atol=1e-6)
    assert branch.ended != HAPPENED.format("too far down")  # shooting goes on past events
