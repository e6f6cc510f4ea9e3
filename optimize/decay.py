"""How the swing of a motion dies towards the settled one, beside what the multiplier says."""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import numpy as np
from jaxtyping import Float

from jaxcrusher.batch.engines import run_all, stack
from jaxcrusher.dynamics.swing import places, section_points
from optimize.answer import Confirmed, Decay, Settled
from optimize.evaluate import Case, started

# Turns after the long runs, and parts of them over which a swing is averaged.
TURNS, PARTS = 480, 8
# Of that integration, whose error keeps a swing of 700 times the tolerance alive (measured at
# 25 rad/s and 0.03 mm, for 1e-7 to 1e-9); less than ten times that, in clearances, says nothing.
RTOL, RESOLVED = 1e-8, 1e-4
# A swing as small as this, in clearances, is told as gone.
GONE = 1e-3


def with_decay(case: Case, designs: Sequence[Confirmed]) -> list[Confirmed]:
    """The designs, with the decay of the runs that come to their settled motion."""
    dying = [
        (i, start)
        for i, design in enumerate(designs)
        for start, runs in design.transient.items()
        if runs.settles
    ]
    if not dying:
        return list(designs)
    cases = [
        (
            np.asarray(designs[i].transient[start].state),
            started({**case.design.fixed, **designs[i].values}, start),
        )
        for i, start in dying
    ]
    points, success = run_all(eqx.Partial(section_points, turns=TURNS, rtol=RTOL), stack(cases))
    found = list(designs)
    for (i, start), states, good in zip(dying, points, success, strict=True):
        settled = found[i].settled
        assert settled is not None
        if good:
            runs = found[i].transient[start]
            decay = measured(places(states) - np.asarray(settled.section))
            transient = found[i].transient | {start: replace(runs, decay=decay)}
            found[i] = replace(found[i], transient=transient)
    return found


def rate(orbit: Settled) -> float:
    """The share by which the largest multiplier lets a swing fall in a turn."""
    return 1 - orbit.largest_multiplier


def measured(apart: Float[np.ndarray, "turns half"]) -> Decay:
    """The decay of points that swing about zero, by least squares over the logarithms of its parts.

    A part of many turns averages the swing's phase out.
    """
    parts = apart.reshape(PARTS, -1, apart.shape[1])
    swings = np.sqrt(np.mean(parts**2, axis=(1, 2)))
    turns = len(apart) / PARTS * np.arange(PARTS)
    turns -= turns.mean()
    logarithms = np.log(np.maximum(swings, 1e-300))
    fall = -(turns @ logarithms) / (turns @ turns)
    left = logarithms - logarithms.mean() + fall * turns
    error = np.sqrt(left @ left / (PARTS - 2) / (turns @ turns))
    return Decay(float(swings[0]), float(swings[-1]), float(fall), float(error))
