"""The objectives of the design study: RMS of the foundation force on the orbit, and robust."""

import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, Scalar
from scipy.stats import qmc

import jaxcrusher as jc
from jaxcrusher.batch.engines import run_all, without_lanes
from optimize.balance.compare import Answer, Smooth
from optimize.design import Design

# Nodes a turn: the steady-state RMS of the designs is right to 1e-9 (`PeriodicOrbit.error`).
NODES = 96

Conditions = Mapping[str, Any]  # names of `jaxcrusher.PARAMETERS` to what the machine meets


class Beside(NamedTuple):
    """The RMS of the shaking force on a periodic orbit, N, and Newton's steps."""

    shaking_rms: Scalar
    steps: Int[Array, ""]  # of Newton's method


def orbit_rms(
    unit: Float[Array, " n"], conditions: Conditions, design: Design
) -> tuple[Scalar, Beside]:
    """Return the RMS of |R_O| + |R_C| of the periodic orbit, N, and what else is known of it."""
    orbit = jc.periodic_orbit(design.scene(unit, conditions), nodes=NODES)
    return orbit.foundation_rms, Beside(orbit.shaking_rms, orbit.steps)


def orbit_slope(
    unit: Float[Array, " n"], conditions: Conditions, design: Design
) -> tuple[tuple[Scalar, Beside], Float[Array, " n"]]:
    """`orbit_rms`, and its derivative by the unit box's coordinates."""
    return jax.value_and_grad(orbit_rms, has_aux=True)(unit, conditions, design)


def orbit_objective(
    design: Design, conditions: Conditions, reference: np.ndarray
) -> tuple[Smooth, float]:
    """`orbit_rms` over that of the `reference` point, compiled, with its costs measured.

    Returns it and the reference's RMS, N. Raises RuntimeError if that is no number.
    """
    value = jax.jit(lambda unit: orbit_rms(unit, conditions, design))
    both = jax.jit(lambda unit: orbit_slope(unit, conditions, design))
    scale = float(value(jnp.asarray(reference))[0])
    if not np.isfinite(scale):
        raise RuntimeError(
            "the machine to begin with has no periodic orbit: nothing to compare with"
        )

    def gradient(point: np.ndarray) -> Answer:
        (rms, beside), slope = both(jnp.asarray(point))
        return Answer(float(rms) / scale, int(beside.steps), np.asarray(slope) / scale)

    def plain(point: np.ndarray) -> Answer:
        rms, beside = value(jnp.asarray(point))
        return Answer(float(rms) / scale, int(beside.steps))

    smooth = Smooth(plain, gradient, _seconds(plain, reference), _seconds(gradient, reference))
    return smooth, scale


def _seconds(function: Callable, point: np.ndarray) -> float:
    """CPU time of a call: the least of a few, after one that compiles."""
    function(point)
    spent = []
    for _ in range(10):
        began = time.process_time()
        function(point)
        spent.append(time.process_time() - began)
    return min(spent)


def tolerances(
    middle: Mapping[str, float], widths: Mapping[str, float], count: int, seed: int
) -> dict[str, np.ndarray]:
    """`count` conditions, uniform within +-`widths` (relative), the same for every design.

    Scrambled Sobol points: their mean is far better than that of as many random ones.
    """
    engine = qmc.Sobol(len(middle), rng=seed)
    points = engine.random_base2(int(np.ceil(np.log2(count))))[:count]
    return {
        name: value * (1 + widths[name] * (2 * points[:, i] - 1))
        for i, (name, value) in enumerate(middle.items())
    }


def sampled(
    unit: np.ndarray, conditions: Mapping[str, np.ndarray], design: Design
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the RMS of both forces under each of the conditions, and the gradient of the first.

    `orbit_rms` (samples,), its gradient (samples, n), and the shaking force's RMS (samples,).
    """
    count = len(next(iter(conditions.values())))
    stacked = {"unit": np.tile(unit, (count, 1)), "conditions": dict(conditions)}
    function = eqx.Partial(_sample, design=design)
    (values, beside), slopes = run_all(
        function, jax.tree.map(jnp.asarray, stacked), count, without_lanes()
    )
    return values, slopes, beside.shaking_rms


def _sample(point: dict[str, Any], design: Design):
    return orbit_slope(point["unit"], point["conditions"], design)


def mean_and_spread(
    values: np.ndarray, slopes: np.ndarray, sigmas: float
) -> tuple[float, np.ndarray]:
    """Mean + `sigmas` standard deviations of (samples,) values, and its gradient (n,)."""
    apart, spread = values - values.mean(), values.std()
    slope = slopes.mean(axis=0)
    if spread > 0:
        slope = slope + sigmas * (apart @ slopes) / (len(values) * spread)
    return float(values.mean() + sigmas * spread), slope
