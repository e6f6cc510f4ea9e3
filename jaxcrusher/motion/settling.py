"""How far statistics of some turns may be from those of the motion that they settle on.

A standard error assumes a stationary motion. The swing of a pin that does not leave its bore decays
over thousands of turns: each turn is like the one before, and all of them are off.
"""

import math
from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Scalar

from jaxcrusher.mechanism.reductions import Chosen, Largest, Least, Sampled, Statistic
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.state import pins_of

# Batches of turns of which the scatter is taken.
BATCHES = 10
# A trend of the batches is no accident at this rank correlation with time, which one set of 2000
# without a trend comes to; a smaller change, as a share, is none.
TREND_RANK, TREND_SHARE = 0.9, 1e-3
# Units of what is judged by its trend. Shares of the time, and speeds of pins that hardly move, may
# have one of no importance.
JUDGED = ("N", "N m", "W", "m", "Pa")
# A pin that swings by less, in clearances, has settled: a mean is off by its square.
STILL = 0.01
# Turns between section points that repeat, and how much narrower than about one mean they must be
# about these means; as many points each.
PERIODS, NARROWER, ENOUGH = (2, 3, 4), 0.05, 4


def _is_extreme(how: Statistic) -> bool:
    return isinstance(how.reduction, Largest | Least | Sampled)


def _of_batches(how: Statistic, by_turn: Float[Array, " turns"], count: int) -> Float[Array, " n"]:
    length = len(by_turn) // count
    return jax.vmap(how.reduction.of_pieces)(by_turn[: count * length].reshape(count, length))


def standard_error(how: Statistic, by_turn: Float[Array, " turns"]) -> Scalar:
    """Return the statistical error, from the scatter of up to ten batches of turns.

    For a mean it is the standard error, for a peak the standard deviation of the batches' peaks. It
    is right for turns that are independent from batch to batch, and infinite for one turn.
    """
    turns = len(by_turn)
    count = min(BATCHES, turns)
    if count == 1:
        return by_turn[0] + jnp.inf
    scatter = jnp.std(_of_batches(how, by_turn, count), ddof=1)
    # Turns that fill no batch are in a mean too.
    return scatter if _is_extreme(how) else scatter * math.sqrt(turns // count / turns)


def error(how: Statistic, by_turn: Float[Array, " turns"], swing: Scalar) -> Scalar:
    """Return the standard error of a statistic, with what has not settled.

    That is the difference of the last quarter of the turns from all, and the effect of a pin's
    `swing`. The force in a joint turns with its pin by an angle of the size of the swing in
    clearances. This angle is zero in the mean: a mean changes by the swing's square and an extreme
    by the swing, as a share. For twelve crushers from the centred start the RMS of |R_O| + |R_C|
    was off by 0.4 to 1 of this share, and the peak by 0.5 to 1.4; a force that is small beside the
    joint force is off by more.
    """
    last = by_turn[-max(1, len(by_turn) // 4) :]
    value = how.reduction.of_pieces(by_turn)
    drift = value - how.reduction.of_pieces(last)
    swung = value * (swing if _is_extreme(how) else swing**2)
    return jnp.sqrt(standard_error(how, by_turn) ** 2 + drift**2 + swung**2)


def has_trend(how: Statistic, by_turn: Float[Array, " turns"]) -> Bool[Array, ""]:
    """Tell whether a statistic grows or falls over the turns; fewer than ten tell nothing."""
    if len(by_turn) < BATCHES or how.unit not in JUDGED:
        return jnp.asarray(False)
    batches = _of_batches(how, by_turn, BATCHES)
    ranks = jnp.sum(batches[:, None] > batches[None], axis=1)
    change = jnp.abs(batches[-1] - batches[0])
    large = change > TREND_SHARE * jnp.max(jnp.abs(batches))
    return large & (jnp.abs(jnp.corrcoef(jnp.arange(BATCHES), ranks)[0, 1]) > TREND_RANK)


@eqx.filter_jit
def is_settled(
    statistics: Chosen, by_turn: Mapping[str, Float[Array, " turns"]], swing: Scalar
) -> Bool[Array, ""]:
    """Tell whether no pin swings and no statistic has a trend; one turn does not tell it."""
    trends = [has_trend(one, by_turn[name]) for name, one in statistics if name in by_turn]
    return (swing <= STILL) & ~jnp.any(jnp.array([False, *trends]))


def swing_of(states: Float[Array, "turns dims"], scene: Scene) -> Scalar:
    """Return the RMS swing of a pin in its bore, in clearances: the largest of the loose joints.

    It is about the mean section point, or the means of every second, third or fourth one. It is
    zero where a pin is off a dry bore, since an impacting pin does not swing and may be stationary,
    and for a scene not written by eccentricity. It is infinite for one turn.
    """
    pins = states[:, pins_of(scene)].reshape(len(states), -1, 2)
    if pins.size == 0:
        return jnp.zeros(())
    if len(pins) == 1:
        return jnp.asarray(jnp.inf)

    def spread(period: int) -> Float[Array, " joints"]:
        whole = pins[len(pins) % period :].reshape(-1, period, *pins.shape[1:])
        return jnp.sqrt(
            jnp.mean(jnp.sum((whole - whole.mean(0, keepdims=True)) ** 2, axis=3), axis=(0, 1))
        )

    found = spread(1)
    for period in PERIODS:
        if len(pins) >= ENOUGH * period:
            other = spread(period)
            found = jnp.where(other < NARROWER * found, other, found)
    touches = jnp.all(jnp.sum(pins[:, list(scene.dry)] ** 2, axis=2) > 1)
    return jnp.max(jnp.where(touches, found, 0.0))
