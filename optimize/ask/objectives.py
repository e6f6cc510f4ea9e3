"""The objectives of the search by name. Each is a function of a motion's statistics."""

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

# A function of a motion's statistics, its scene, and the chamber of a crusher.
Formula = Callable[[Statistics | PeriodicOrbit, Any, Any], Scalar]


@dataclass(frozen=True)
class Objective:
    """A number to minimise: its unit, its meaning, the statistics it needs, and its formula.

    `formula` takes the statistics of a motion or of an orbit, its scene, and the crusher's chamber,
    which is None for another linkage.
    """

    unit: str
    meaning: str
    outputs: tuple[str, ...]
    formula: Formula
    lowest: float = 0.0  # lower bound of the objective
    name: str = ""  # its name in the options


def plain(name: str, known: Mapping[str, Statistic] = STATISTIC) -> Objective:
    """Return a statistic as an objective, by its name in `known`."""
    statistic = known[name]
    # An RMS or a peak is not negative; a mean may be.
    lowest = 0.0 if statistic.reduction in (PowerMean(2), PEAK) else -math.inf
    return Objective(
        statistic.unit, statistic.meaning, (name,), lambda found, *_: found[name], lowest
    )


def own_objective(text: str) -> Objective:
    """Return the objective with the name `module:NAME`, from a module that Python finds.

    Raises ValueError for a module that cannot be imported, and if NAME is not an `Objective`.
    """
    module, _, name = text.partition(":")
    importlib.invalidate_caches()  # the module may be new
    try:
        found = getattr(importlib.import_module(module), name, None)
    except Exception as error:  # the import of a user's module may raise any error
        why = str(error) if isinstance(error, ImportError) else f"{type(error).__name__}: {error}"
        raise ValueError(f"Argument `objective` must name a module, but {text}: {why}.") from error
    good = isinstance(found, Objective)
    require(good, "objective", "name an optimize.ask.objectives.Objective as module:NAME", text)
    assert isinstance(found, Objective)
    return replace(found, name=text)


def _excess(statistics: Statistics | PeriodicOrbit, scene: jc.Scene, _) -> Scalar:
    """Return the RMS minus the RMS of the same machine with ideal joints, N."""
    return statistics.foundation_rms - jc.periodic_orbit(scene.ideal()).foundation_rms


def _expected(found: Statistics | PeriodicOrbit, scene: jc.Scene, _) -> Scalar:
    """Return the RMS (N) of an orbit that is expected under a rough feed.

    It is NaN for an integrated motion, which has the mean load, and for an orbit that loses contact
    more than once in `TURNS`: its response to the feed is not linear.
    """
    if not isinstance(found, PeriodicOrbit):
        return jnp.full_like(found.foundation_rms, jnp.nan)
    if scene.steady() is scene:  # the scatter is 0
        return found.foundation_rms
    response = jc.feed_response(replace(found, scene=replace(found.scene, pushes=scene.pushes)))
    return nan_unless(response.losses <= 1 / TURNS, response.expected_rms)


def _per_volume(name: str) -> Formula:
    """Return the formula of a power (W) over the crushed volume, in J/m3."""

    def formula(statistics, scene, chamber):
        return per_volume(statistics[name], chamber.capacity(scene.drive.speed))

    return formula


# Objectives of a frame on supports: its force on the ground, and its motion.
OF_SUPPORTS = (
    "transmitted_rms",
    "transmitted_peak",
    "frame_displacement_peak",
    "frame_velocity_rms",
)
# A crusher's objectives by name. `module:NAME` names an `Objective` of your own.
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
