"""What a sweep keeps of a design: the variables of its statistics."""

from collections.abc import Iterable

import jax

from jaxcrusher.crusher.joints import JOINTS, before
from jaxcrusher.motion.statistic import Chosen, always_with, chosen
from jaxcrusher.motion.statistics import Statistics

_LIMITS = {
    "half_width_ratio": ("1", "Hertz's half-width / bore radius"),
    "impact_speed_ratio": ("1", "fastest approach / elastic limit"),
    "delivered_restitution": ("1", "restitution of the fastest impact"),
}
# Name -> unit and meaning of the variables of a sweep besides statistics.
VARIABLES = {
    "foundation_rms_error": ("N", "standard error of the RMS"),
    **_LIMITS,
    "inside_model": ("1", "narrow clearance, Hertzian contact, elastic impacts"),
    "whirl": ("1", "friction whirl"),
    "success": ("1", "integrated to the end"),
    "reached": ("rad", "shaft angle at the end, or at the failure"),
}
LOGICAL = ("whirl", "success", "inside_model")


def variables_of(joints: Iterable[str], statistics: Chosen) -> dict[str, tuple[str, str]]:
    """Statistics and `VARIABLES`, where `joints` are loose besides the main one."""
    found = {name: (one.unit, one.meaning) for name, one in statistics} | VARIABLES
    for joint in joints:
        found |= {
            before(joint) + name: (unit, f"{meaning}, {joint}")
            for name, (unit, meaning) in _LIMITS.items()
        }
    return found


def meanings() -> dict[str, tuple[str, str]]:
    """Name -> unit and meaning of the variables of any sweep."""
    return variables_of(JOINTS[1:], chosen(always_with(JOINTS)))


def row_of(result: Statistics, statistics: Iterable[str]) -> dict[str, jax.Array]:
    """The variables of one design; an ideal joint is inside the limits of contact."""
    limits = {"main": result.validity, **result.validity.others}
    row = {name: result[name] for name in statistics}
    row |= {name: getattr(result, name) for name in ("foundation_rms_error", "whirl", "success")}
    row |= {
        before(joint) + name: getattr(one, name)
        for joint, one in limits.items()
        for name in _LIMITS
    }
    return row | {"inside_model": result.validity.inside, "reached": result.outcome.reached}
