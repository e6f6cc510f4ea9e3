"""What a sweep keeps of a design: the variables of its statistics."""

from collections.abc import Iterable

import jax

from jaxcrusher.crusher.joints import JOINTS, before
from jaxcrusher.motion.statistic import ALWAYS, STATISTIC, STATISTICS
from jaxcrusher.motion.statistics import Statistics

_LIMITS = {
    "half_width_ratio": ("1", "Hertz's half-width / bore radius"),
    "impact_speed_ratio": ("1", "fastest approach / elastic limit"),
    "delivered_restitution": ("1", "restitution of the fastest impact"),
}
# Name -> unit and meaning of the variables of a sweep.
VARIABLES = {
    **{name: (STATISTIC[name].unit, STATISTIC[name].meaning) for name in STATISTICS},
    "foundation_rms_error": ("N", "standard error of the RMS"),
    **_LIMITS,
    "inside_model": ("1", "narrow clearance, Hertzian contact, elastic impacts"),
    "whirl": ("1", "friction whirl"),
    "success": ("1", "integrated to the end"),
    "reached": ("rad", "shaft angle at the end, or at the failure"),
}
LOGICAL = ("whirl", "success", "inside_model")


def variables_of(joints: Iterable[str]) -> dict[str, tuple[str, str]]:
    """`VARIABLES`, and those of `joints` that are loose besides the main one."""
    found = dict(VARIABLES)
    for joint in joints:
        found |= {name: (STATISTIC[name].unit, STATISTIC[name].meaning) for name in ALWAYS[joint]}
        found |= {
            before(joint) + name: (unit, f"{meaning}, {joint}")
            for name, (unit, meaning) in _LIMITS.items()
        }
    return found


# Those of any sweep.
MEANINGS = variables_of(JOINTS[1:])


def row_of(result: Statistics) -> dict[str, jax.Array]:
    """The variables of one design; an ideal joint is inside the limits of contact."""
    limits = {"main": result.validity, **result.validity.others}
    row = {name: result[name] for joint in limits for name in ALWAYS[joint]}
    row |= {name: result[name] for name in STATISTICS}
    row |= {name: getattr(result, name) for name in ("foundation_rms_error", "whirl", "success")}
    row |= {
        before(joint) + name: getattr(one, name)
        for joint, one in limits.items()
        for name in _LIMITS
    }
    return row | {"inside_model": result.validity.inside, "reached": result.outcome.reached}
