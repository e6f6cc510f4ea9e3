"""The crusher's statistics: a new one takes an entry here and nothing else."""

import functools
import operator
from collections.abc import Container
from types import MappingProxyType

from jaxcrusher.crusher.machine import JOINTS, LETTERS
from jaxcrusher.crusher.observables import (
    OBSERVABLES,
    fatigue,
    foundation_force,
    rod_margin,
    roller_pressure,
    static_load,
    stiffness_now,
)
from jaxcrusher.mechanism.linkage_statistics import (
    OF_MACHINE,
    OF_SHAFT,
    OF_SUPPORTS,
    always_at,
    further_at,
)
from jaxcrusher.mechanism.named import before
from jaxcrusher.mechanism.reductions import LARGEST, LEAST, PEAK, Lasting, PowerMean, Statistic

# Of each joint, what is computed without being asked, and what when asked.
_BY_JOINT = {
    joint: (always_at(joint, place, OBSERVABLES), further_at(joint, place))
    for joint, place in LETTERS.items()
}
_BY_DEFAULT = {
    "foundation_rms": Statistic("N", "RMS of |R_O| + |R_C|", foundation_force, PowerMean(2)),
    "foundation_mean": Statistic("N", "mean of |R_O| + |R_C|", foundation_force, PowerMean()),
    "foundation_peak": Statistic("N", "peak of |R_O| + |R_C|", foundation_force, PEAK),
    "shaking_rms": OF_MACHINE["shaking_rms"],
    **_BY_JOINT["main"][0],
}
_FURTHER = {
    # Within 20 % of a peak that lasts 5 % of a turn, and differentiable where the instant of the
    # peak jumps.
    "foundation_smooth_peak": Statistic(
        "N", "(mean of (|R_O| + |R_C|)^16)^(1/16)", foundation_force, PowerMean(16)
    ),
    "shaking_peak": OF_MACHINE["shaking_peak"],
    "shaking_moment_rms": OF_MACHINE["shaking_moment_rms"],
    **_BY_JOINT["main"][1],
    "drive_power": OF_MACHINE["drive_power"],
}
# Of a tension rod, when asked.
_OF_ROD = {
    "rod_tension_least": Statistic(
        "N", "least tension of the rod; where it is negative the rod is slack", rod_margin, LEAST
    ),
}
# Of a main bearing with clearance, and of rollers there, when asked.
_OF_MAIN = {
    "bearing_stiffness": Statistic("N/m", "mean of dF/de at A", stiffness_now, PowerMean()),
}
_OF_ROLLERS = {
    "roller_pressure": Statistic(
        "Pa", "largest pressure between a roller and the inner ring", roller_pressure, LARGEST
    ),
    "static_load_ratio": Statistic(
        "1", "largest load of a bearing at A over its static rating", static_load, LARGEST
    ),
    "bearing_life": Statistic("h", "L10 of a bearing at A by ISO 281", fatigue, Lasting()),
}
_FURTHER |= OF_SUPPORTS | _OF_ROD | OF_SHAFT | _OF_MAIN | _OF_ROLLERS
_OF_OTHERS = [of_joint for joint in JOINTS[1:] for of_joint in _BY_JOINT[joint]]

# Name -> unit, meaning, quantity and reduction of what `statistics` computes when asked, the first
# of them without being asked. Those of another joint have its name before theirs.
STATISTIC = MappingProxyType(functools.reduce(operator.or_, _OF_OTHERS, _BY_DEFAULT | _FURTHER))
# What `statistics` computes without being asked, with the same of other loose joints.
STATISTICS = tuple(_BY_DEFAULT)
# What it computes when asked, with the same of other joints.
FURTHER_STATISTICS = tuple(_FURTHER)

# Joint -> what `statistics` computes of it without being asked.
ALWAYS = {joint: tuple(always) for joint, (always, _) in _BY_JOINT.items()}


# Part of a scene -> the statistics that only a scene with it has.
_OF_PARTS = {
    "supports": OF_SUPPORTS,
    "rod": _OF_ROD,
    "shaft": OF_SHAFT,
    "loose main": _OF_MAIN,
    "rollers": _OF_ROLLERS,
    **{joint: {**always, **further} for joint, (always, further) in _BY_JOINT.items()},
    **{f"friction of {joint}": (f"{before(joint)}sliding_power",) for joint in JOINTS},
}
# What is computed only when asked: nothing of a rod, of a free shaft and of rollers.
_ASKED = {*_FURTHER, *(name for _, further in _BY_JOINT.values() for name in further)}
_ASKED -= {*_OF_ROD, *OF_SHAFT, *_OF_ROLLERS}


def statistics_with(parts: Container[str]) -> tuple[str, ...]:
    """Return the names of all that a scene has which has these parts."""
    left_out = {name for part, names in _OF_PARTS.items() if part not in parts for name in names}
    return tuple(name for name in STATISTIC if name not in left_out)


def usual_with(parts: Container[str]) -> tuple[str, ...]:
    """Return the names of what is computed of it without being asked for."""
    return tuple(name for name in statistics_with(parts) if name not in _ASKED)
