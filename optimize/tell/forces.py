"""The forces that every design is told by, and how they change from one design to another."""

from collections.abc import Iterable, Mapping

from jaxcrusher.crusher.template import CALLED, STATISTIC
from jaxcrusher.files.text import quantity

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
    name = CALLED[force]
    return f"{name}, which the ground feels," if force == "shaking_rms" else name


def name_of(meaning: str) -> str:
    """Return what a sentence calls a quantity of this meaning."""
    known = {STATISTIC[force].meaning: name for force, name in CALLED.items()}
    return known.get(meaning, meaning)
