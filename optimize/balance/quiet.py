"""What the design study judges by: the quiet RMS of the foundation force, and its robust form."""

import time
from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, Scalar
from scipy.stats import qmc

import jaxcrusher as jc
from jaxcrusher.batch.engines import in_turn, map_all
from optimize.balance.compare import Answer, Smooth
from optimize.design import Design

# A gradient's tangents share the error control and sharpen the motion: at 1e-6 its value is as
# good (3e-3 N in 2e4) as that of a run for the value alone at 1e-8.
VALUE_RTOL, GRADIENT_RTOL = 1e-8, 1e-6

Conditions = Mapping[str, Any]  # names of `jaxcrusher.PARAMETERS` to what the machine meets


def quiet_rms(
    unit: Float[Array, " n"], conditions: Conditions, design: Design, turns: int, rtol: float
) -> tuple[Scalar, Int[Array, ""]]:
    """RMS of |R_O| + |R_C|, N, over `turns` turns from the start in contact; the steps taken."""
    scene = design.scene(unit, conditions)
    result = jc.statistics(scene, 0, turns, outputs=("foundation_rms",), rtol=rtol)
    return result.foundation_rms, result.outcome.steps


def quiet_slope(
    unit: Float[Array, " n"], conditions: Conditions, design: Design, turns: int
) -> tuple[tuple[Scalar, Int[Array, ""]], Float[Array, " n"]]:
    """`quiet_rms`, and its derivative by the unit box's coordinates."""
    function = jax.value_and_grad(quiet_rms, has_aux=True)
    return function(unit, conditions, design, turns, GRADIENT_RTOL)


def quiet_objective(
    design: Design, conditions: Conditions, turns: int, reference: np.ndarray
) -> tuple[Smooth, float]:
    """`quiet_rms` over that of the `reference` point, compiled, with its costs measured.

    Returns it and the reference's RMS, N. Raises RuntimeError if that is no number.
    """
    value = jax.jit(lambda unit: quiet_rms(unit, conditions, design, turns, VALUE_RTOL))
    both = jax.jit(lambda unit: quiet_slope(unit, conditions, design, turns))
    scale = float(value(jnp.asarray(reference))[0])
    if not np.isfinite(scale):
        raise RuntimeError("the motion of the paper's machine failed: nothing to compare with")

    def gradient(point: np.ndarray) -> Answer:
        (rms, steps), slope = both(jnp.asarray(point))
        return Answer(float(rms) / scale, int(steps), np.asarray(slope) / scale)

    def plain(point: np.ndarray) -> Answer:
        rms, steps = value(jnp.asarray(point))
        return Answer(float(rms) / scale, int(steps))

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
    unit: np.ndarray, conditions: Mapping[str, np.ndarray], design: Design, turns: int
) -> tuple[np.ndarray, np.ndarray]:
    """`quiet_rms` (samples,) and its gradient (samples, n) under each of the conditions."""
    count = len(next(iter(conditions.values())))
    stacked = {"unit": np.tile(unit, (count, 1)), "conditions": dict(conditions)}
    function = eqx.Partial(_sample, design=design, turns=turns)
    (values, _), slopes = map_all(function, jax.tree.map(jnp.asarray, stacked), count, in_turn)
    return values, slopes


def _sample(point: dict[str, Any], design: Design, turns: int):
    return quiet_slope(point["unit"], point["conditions"], design, turns)


def mean_and_spread(
    values: np.ndarray, slopes: np.ndarray, sigmas: float
) -> tuple[float, np.ndarray]:
    """Mean + `sigmas` standard deviations of (samples,) values, and its gradient (n,)."""
    apart, spread = values - values.mean(), values.std()
    slope = slopes.mean(axis=0)
    if spread > 0:
        slope = slope + sigmas * (apart @ slopes) / (len(values) * spread)
    return float(values.mean() + sigmas * spread), slope
