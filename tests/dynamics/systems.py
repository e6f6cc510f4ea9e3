"""Maps and flows with published Lyapunov exponents."""

from collections.abc import Callable

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np


def iterate(
    step: Callable, start: list[float], count: int, settle: int = 100
) -> tuple[np.ndarray, np.ndarray]:
    """Return points of a map and its Jacobians there, shapes (count, n) and (count, n, n)."""

    @eqx.filter_jit
    def run(x):
        def one(x, _):
            return step(x), (x, jax.jacfwd(step)(x))

        x, _ = jax.lax.scan(lambda x, _: (step(x), None), x, length=settle)
        return jax.lax.scan(one, x, length=count)[1]

    points, jacobians = run(jnp.asarray(start))
    return np.asarray(points), np.asarray(jacobians)


def flow(field: Callable, interval: float, parameter: float | None = None) -> Callable:
    """Return the map of a flow over `interval`, by Dopri8 at 1e-10."""

    def step(x):
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field),
            diffrax.Dopri8(),
            0.0,
            interval,
            None,
            x,
            parameter,
            stepsize_controller=diffrax.PIDController(rtol=1e-10, atol=1e-10),
            adjoint=diffrax.ForwardMode(),
        )
        return solution.ys[0]

    return step


def lorenz(t, x, rho):
    """Return the rate of Lorenz' equations, with sigma = 10, beta = 8 / 3."""
    return jnp.stack([10 * (x[1] - x[0]), x[0] * (rho - x[2]) - x[1], x[0] * x[1] - 8 / 3 * x[2]])


def henon(x):
    """Map a point by Hénon, with a = 1.4, b = 0.3."""
    return jnp.stack([1 - 1.4 * x[0] ** 2 + x[1], 0.3 * x[0]])


def logistic(r: float) -> Callable:
    """Return the map x -> r x (1 - x)."""
    return lambda x: r * x * (1 - x)
