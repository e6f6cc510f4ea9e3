"""The measured decay of free oscillations towards an orbit, beside that by the multiplier."""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import numpy as np
from jaxtyping import Float

from jaxcrusher.batch.engines import run_all, stack
from jaxcrusher.mechanism.state import pins_of
from jaxcrusher.orbits.oscillation import section_of
from jaxcrusher.orbits.transient import section_points
from optimize.answer import Confirmed, Decay, Orbit
from optimize.ask.case import Case
from optimize.search.evaluate import started

# Turns after the long runs, and parts of them over which a swing is averaged.
TURNS, PARTS = 480, 8
# Of that integration. At 1e-7 to 1e-9 the method itself adds an eighth to the decay, at 1e-10 a
# fiftieth (25 rad/s, 0.03 mm). A swing below the second number, in clearances, says nothing: the
# error of the integration keeps one of 700 times the tolerance alive.
RTOL, RESOLVED = 1e-10, 1e-4
# Nor does less than so many times what it leaves of the periodic orbit itself. Errors add in
# squares: a tenth of a swing changes its size by a two-hundredth.
ABOVE = 10
# Share by which the size of a part is off, RMS, where it holds no whole number of swings: 1 % at
# most, at the crusher's angle of some 1.04 rad a turn. Over several parts that can look like decay.
PHASE = 0.01 / np.sqrt(2)
# Standard errors of a measured rate.
ERRORS = 3
# A swing as small as this, in clearances, is told as gone.
GONE = 1e-3


def with_decay(case: Case, designs: Sequence[Confirmed]) -> list[Confirmed]:
    """Return the designs with the decay of the runs that come to their orbits of one turn.

    Which turn of a longer orbit a run comes to is not known.
    """
    dying = [
        (i, start)
        for i, design in enumerate(designs)
        for start, runs in design.transient.items()
        if runs.settles and _orbit(design).solution.period == 1
    ]
    if not dying:
        return list(designs)
    # Each goes on from where its long run ended, and another run starts on the orbit itself.
    cases = [
        (np.asarray(state), started(case.design, designs[i].values, start))
        for i, start in dying
        for state in (designs[i].transient[start].state, _orbit(designs[i]).solution.section)
    ]
    points, success = run_all(eqx.Partial(section_points, turns=TURNS, rtol=RTOL), stack(cases))
    found = list(designs)
    pairs = points.reshape(len(dying), 2, *points.shape[1:]), success.reshape(len(dying), 2)
    for (i, start), states, good in zip(dying, *pairs, strict=True):
        if good.all():
            runs = found[i].transient[start]
            solution = _orbit(found[i]).solution
            apart, left = states[..., pins_of(solution.scene)] - section_of(solution)[0]
            decay = measured(apart, float(_oscillations(left).max()))
            transient = found[i].transient | {start: replace(runs, decay=decay)}
            found[i] = replace(found[i], transient=transient)
    return found


def _orbit(design: Confirmed) -> Orbit:
    assert design.orbit is not None
    return design.orbit


def rate(orbit: Orbit) -> float:
    """Return the share of an oscillation that decays in a turn, by the largest multiplier."""
    return 1 - float(orbit.solution.largest_multiplier) ** (1 / orbit.solution.period)


def resolved(swing: Decay) -> float:
    """Return the least size of a swing, in clearances, that the integration resolves."""
    return max(RESOLVED, ABOVE * swing.floor)


def unmeasurable(swing: Decay, says: float) -> str:
    """Say why a decay cannot be held against the rate that the multiplier `says`, or nothing.

    A swing that the integration's own error keeps alive says nothing of a rate. Nor does a
    measurement that tells that rate from none by less than `ERRORS` standard errors, unless it is
    slower than both by more, as that of a swing that grows.
    """
    if swing.last < resolved(swing):
        return f"a swing of {swing.last:.1g} clearances, of which {resolved(swing):.1g} are needed"
    if ERRORS * swing.error >= says and swing.rate >= says - ERRORS * swing.error:
        return f"a rate of {swing.rate:.2g}, standard error {swing.error:.1g}"
    return ""


def measured(apart: Float[np.ndarray, "turns half"], floor: float) -> Decay:
    """The decay of points that swing about zero, by least squares over the logarithms of its parts.

    A part of many turns averages the swing's phase out to `PHASE`. `floor` is the swing that the
    integration leaves of the periodic orbit itself.
    """
    swings = _oscillations(apart)
    turns = len(apart) / PARTS * np.arange(PARTS)
    turns -= turns.mean()
    logarithms = np.log(np.maximum(swings, 1e-300))
    fall = -(turns @ logarithms) / (turns @ turns)
    left = logarithms - logarithms.mean() + fall * turns
    error = np.sqrt((left @ left / (PARTS - 2) + PHASE**2) / (turns @ turns))
    # The logarithm falls by more in a turn than the share that decays.
    stays = np.exp(-fall)
    rate, error = -np.expm1(-fall), stays * error
    return Decay(float(swings[0]), float(swings[-1]), float(rate), float(error), floor)


def _oscillations(apart: Float[np.ndarray, "turns half"]) -> Float[np.ndarray, " parts"]:
    """The size of a swing about zero in each of its parts, in clearances."""
    parts = apart.reshape(PARTS, -1, apart.shape[1])
    return np.sqrt(np.mean(parts**2, axis=(1, 2)))
