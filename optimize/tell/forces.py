"""The forces that every design is told by, and how they change from one design to another."""

from collections.abc import Iterable, Mapping

from jaxcrusher.crusher.template import STATISTIC

# What a sentence calls them; tables give the definition. What frame and bearings carry, with weight
# and crushing load, and what shakes the ground.
NAMES = {"foundation_rms": "RMS force on the foundation", "shaking_rms": "RMS shaking force"}
_OTHERS = {
    "foundation_peak": "peak force on the foundation",
    "shaking_peak": "peak shaking force",
    "joint_peak": "peak force in the main bearing",
}
# A force that changes by less than this share of itself neither falls nor rises.
UNCHANGED = 1e-3


def besides(forces: Iterable[str], *told: str) -> dict[str, str]:
    """Return the names and meanings of forces, less the meanings that are `told` already."""
    meanings = {name: STATISTIC[name].meaning for name in forces}
    return {name: meaning for name, meaning in meanings.items() if meaning not in told}


def opposed(before: Mapping[str, float], after: Mapping[str, float], where: str) -> str:
    """Return a sentence that names the force which falls and the one which rises, or nothing.

    `before` and `after` hold the forces in N; `where` names the design that they stood at before.
    """
    change = {name: after[name] / before[name] - 1 for name in before}
    falls, rises = min(change, key=lambda n: change[n]), max(change, key=lambda n: change[n])
    if not change[falls] < -UNCHANGED < UNCHANGED < change[rises]:
        return ""
    return (
        f"Against the {where} the {_named(falls)} falls by {-100 * change[falls]:.3g} %, "
        f"but the {_named(rises)} rises by {100 * change[rises]:.3g} %, from "
        f"{quantity(before[rises], 'N')} to {quantity(after[rises], 'N')}."
    )


def _named(force: str) -> str:
    name = NAMES[force]
    return f"{name}, which the ground feels," if force == "shaking_rms" else name


def name_of(meaning: str) -> str:
    """Return what a sentence calls a quantity of this meaning."""
    known = {STATISTIC[force].meaning: name for force, name in (NAMES | _OTHERS).items()}
    return known.get(meaning, meaning)


def quantity(value: float, unit: str) -> str:
    """Return a number with four digits and its unit, if any: N as kN, J as MJ, m as mm."""
    if unit == "m":
        return f"{1e3 * value:.4g} mm"
    factor, prefix = prefixed(abs(value), unit)
    return f"{value / factor:.4g} {prefix}".removesuffix(" 1")


def prefixed(most: float, unit: str) -> tuple[float, str]:
    """Return a factor and a unit that suit values up to `most`; only N and J/m3 take prefixes."""
    if unit not in ("N", "J/m3") or most < 1e3:
        return 1.0, unit
    # A force of 1200 kN is said so; wear is told in MJ/m3.
    return (1e6, f"M{unit}") if unit != "N" and most >= 1e6 else (1e3, f"k{unit}")
