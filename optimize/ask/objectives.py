"""The objectives of the search by name: each is a function of a motion's statistics."""

import importlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import jax.numpy as jnp
from jaxtyping import Scalar

import jaxcrusher as jc
from jaxcrusher.basics.checks import nan_unless, require
from jaxcrusher.crusher.capacity import PER_VOLUME, per_volume
from jaxcrusher.crusher.template import STATISTIC
from jaxcrusher.mechanism.reductions import PEAK, PowerMean, Statistic
from jaxcrusher.motion.statistics import Statistics
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.sheets.feed_response import TURNS

# Of a motion's statistics, its scene, and the chamber of a crusher.
Formula = Callable[[Statistics | PeriodicOrbit, Any, Any], Scalar]


@dataclass(frozen=True)
class Objective:
    """A number to minimise: unit, meaning, the statistics it needs, and how it follows from them.

    `formula` takes the statistics of a motion or of an orbit, its scene and the crusher's chamber,
    which is None of another linkage.
    """

    unit: str
    meaning: str
    outputs: tuple[str, ...]
    formula: Formula
    lowest: float = 0.0  # it cannot be less
    name: str = ""  # as options name it


def plain(name: str, known: Mapping[str, Statistic] = STATISTIC) -> Objective:
    """Return the objective that is a statistic as it is, one of those that are `known`."""
    statistic = known[name]
    # Of a size; a mean may be of what has a sign.
    lowest = 0.0 if statistic.reduction in (PowerMean(2), PEAK) else -math.inf
    return Objective(
        statistic.unit, statistic.meaning, (name,), lambda found, *_: found[name], lowest
    )


def own_objective(text: str) -> Objective:
    """Return the objective that `module:NAME` names, of a module that Python finds.

    Raises ValueError for a module that cannot be imported, and for what is no `Objective` there.
    """
    module, _, name = text.partition(":")
    importlib.invalidate_caches()  # it may have been written a moment ago
    try:
        found = getattr(importlib.import_module(module), name, None)
    except Exception as error:  # the module is the user's, and may do anything while it is imported
        why = str(error) if isinstance(error, ImportError) else f"{type(error).__name__}: {error}"
        raise ValueError(f"Argument `objective` must name a module, but {text}: {why}.") from error
    good = isinstance(found, Objective)
    require(good, "objective", "name an optimize.ask.objectives.Objective as module:NAME", text)
    assert isinstance(found, Objective)
    return replace(found, name=text)


def _excess(statistics: Statistics | PeriodicOrbit, scene: jc.Scene, _) -> Scalar:
    """The RMS less that of the same machine with an ideal joint."""
    return statistics.foundation_rms - jc.periodic_orbit(scene.ideal()).foundation_rms


def _expected(found: Statistics | PeriodicOrbit, scene: jc.Scene, _) -> Scalar:
    """The RMS that a rough feed makes of an orbit.

    NaN of a motion that is integrated, which is one under the mean load, and of an orbit that loses
    contact more than once in `TURNS`: the response to the feed is then not linear.
    """
    if not isinstance(found, PeriodicOrbit):
        return jnp.full_like(found.foundation_rms, jnp.nan)
    if scene.steady() is scene:  # a free scatter at its bound 0
        return found.foundation_rms
    response = jc.feed_response(replace(found, scene=replace(found.scene, pushes=scene.pushes)))
    return nan_unless(response.losses <= 1 / TURNS, response.expected_rms)


def _per_volume(name: str) -> Formula:
    """A power (W) for each volume crushed, in J/m3."""

    def formula(statistics, scene, chamber):
        return per_volume(statistics[name], chamber.capacity(scene.drive.speed))

    return formula


# Objectives of a frame on supports: what it passes to the ground, and how it moves.
OF_SUPPORTS = (
    "transmitted_rms",
    "transmitted_peak",
    "frame_displacement_peak",
    "frame_velocity_rms",
)
# A crusher's objectives by name. One of your own is an `Objective` that `module:NAME` names.
OBJECTIVES = {
    "rms": plain("foundation_rms"),
    "peak": plain("foundation_peak"),
    "smooth_peak": plain("foundation_smooth_peak"),
    "mean": plain("foundation_mean"),
    "shaking_rms": plain("shaking_rms"),
    "shaking_peak": plain("shaking_peak"),
    "shaking_moment_rms": plain("shaking_moment_rms"),
    **{name: plain(name) for name in OF_SUPPORTS},
    "expected_rms": Objective(
        "N", "RMS of |R_O| + |R_C| expected under the rough feed", ("foundation_rms",), _expected
    ),
    "excess": Objective(
        "N", "RMS less that of the ideal joint", ("foundation_rms",), _excess, -math.inf
    ),
    "joint_peak": plain("joint_peak"),
    **{
        name: Objective("J/m3", meaning, (power,), _per_volume(power))
        for name, (power, meaning) in PER_VOLUME.items()
    },
}
