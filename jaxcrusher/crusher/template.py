"""What results of a crusher are called, and what is asked of it besides what any linkage has."""

from collections.abc import Mapping
from types import MappingProxyType

from jaxcrusher.crusher.machine import JOINTS, LETTERS
from jaxcrusher.crusher.observables import (
    bearing_reaction,
    crushing_load,
    elbow_position,
    elbow_reaction,
    elbow_velocity,
    foundation_force,
    jaw_mass_centre,
    joint_force,
    load_position,
    net_foundation_force,
    pin_position,
    rod_margin,
    rod_tension,
    toggle_reaction,
)
from jaxcrusher.crusher.outline import outline
from jaxcrusher.joint.validity import Tautness
from jaxcrusher.mechanism.observables import force_at
from jaxcrusher.mechanism.quantities import (
    Limits,
    Observables,
    Parts,
    Statistics,
    Template,
    Title,
    observables_of,
    statistics_of,
    usual_of,
)
from jaxcrusher.mechanism.reductions import LEAST, PEAK, PowerMean, Statistic
from jaxcrusher.mechanism.snapshot import Observable, OfPart

# The main joint, A, is what results of a crusher are of where they name no joint.
_TITLES = {
    joint: Title(f"{joint}_", letter, f"{joint.replace('_', ' ')} {letter}")
    for joint, letter in LETTERS.items()
} | {"main": Title("", "A", "main bearing A")}
_SEEN = {
    "foundation_force": Observable(foundation_force, "N", "|R_O| + |R_C|"),
    "net_foundation_force": Observable(net_foundation_force, "N", "|R_O + R_C|"),
    "joint_force": Observable(joint_force, "N", "force on the jaw at A"),
    "bearing_reaction": Observable(bearing_reaction, "N", "reaction R_O"),
    "elbow_reaction": Observable(elbow_reaction, "N", "reaction R_B"),
    "toggle_reaction": Observable(toggle_reaction, "N", "reaction R_C"),
    "crushing_load": Observable(crushing_load, "N", "crushing load on the jaw"),
    "load_position": Observable(load_position, "m", "where the load acts on the jaw"),
    "pin_position": Observable(pin_position, "m", "centre A of the pin"),
    "jaw_position": Observable(elbow_position, "m", "lower end B"),
    "jaw_mass_centre": Observable(jaw_mass_centre, "m", "mass centre S2 of the jaw"),
    "jaw_velocity": Observable(elbow_velocity, "m/s", "velocity of B"),
}
_USUAL = {
    "foundation_rms": Statistic("N", "RMS of |R_O| + |R_C|", foundation_force, PowerMean(2)),
    "foundation_mean": Statistic("N", "mean of |R_O| + |R_C|", foundation_force, PowerMean()),
    "foundation_peak": Statistic("N", "peak of |R_O| + |R_C|", foundation_force, PEAK),
}
_ROD_LEAST = Statistic(
    "N", "least tension of the rod; where it is negative the rod is slack", rod_margin, LEAST
)
_FURTHER = {
    # Within 20 % of a peak that lasts 5 % of a turn, and differentiable where the instant of the
    # peak jumps.
    "foundation_smooth_peak": Statistic(
        "N", "(mean of (|R_O| + |R_C|)^16)^(1/16)", foundation_force, PowerMean(16)
    ),
}


def _observables(parts: Parts) -> Observables:
    tension = Observable(rod_tension, "N", "tension of the rod")
    return _SEEN | ({"rod_tension": tension} if parts.springs else {})


def _statistics(parts: Parts) -> tuple[Statistics, Statistics]:
    peaks = {}
    for joint in dict.fromkeys(("main", *parts.loose)):
        title, force = _TITLES[joint], OfPart(force_at, joint)
        meaning = f"largest force at {title.title}"
        peaks[f"{title.prefix}joint_peak"] = Statistic("N", meaning, force, PEAK)
    rod = {"rod_tension_least": _ROD_LEAST} if parts.springs else {}
    return _USUAL | rod, _FURTHER | peaks


def _limits(parts: Parts) -> Limits:
    return {"rod": (Tautness, ("rod_tension_least",))} if parts.springs else {}


CRUSHER = Template(
    joints=tuple(_TITLES.items()),
    crank=Title("shaft_", "shaft", "shaft"),
    springs="rod_",
    origin="C",
    leading="foundation_rms",
    observables=_observables,
    statistics=_statistics,
    limits=_limits,
    outline=outline,
)
# A crusher all of whose joints are loose and rub, on supports, with a rod; the last has rollers.
_EVERY = Parts(JOINTS, JOINTS, JOINTS, ("main",), supports=True, springs=True, rests=True)
# Name -> what it is of a crusher, for where no scene is at hand: a scene has those of its parts.
OBSERVABLES: Mapping[str, Observable] = MappingProxyType(observables_of(CRUSHER, _EVERY))
STATISTIC: Mapping[str, Statistic] = MappingProxyType(statistics_of(CRUSHER, _EVERY))
# What `statistics` computes of the paper's crusher without being asked, by joint that is loose.
STATISTICS = tuple(usual_of(CRUSHER, Parts(JOINTS, ("main",))))
ALWAYS = tuple(usual_of(CRUSHER, Parts(JOINTS, JOINTS)))
