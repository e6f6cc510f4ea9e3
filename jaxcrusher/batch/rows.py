"""What a sweep keeps of a design: the variables of its statistics."""

import jax

from jaxcrusher.motion.statistic import STATISTIC, STATISTICS
from jaxcrusher.motion.statistics import Statistics

# Name -> unit and meaning of the variables of a sweep.
VARIABLES = {
    **{name: (STATISTIC[name].unit, STATISTIC[name].meaning) for name in STATISTICS},
    "foundation_rms_error": ("N", "standard error of the RMS"),
    "half_width_ratio": ("1", "Hertz's half-width / bore radius"),
    "impact_speed_ratio": ("1", "fastest approach / elastic limit"),
    "delivered_restitution": ("1", "restitution of the fastest impact"),
    "inside_model": ("1", "narrow clearance, Hertzian contact, elastic impacts"),
    "whirl": ("1", "friction whirl"),
    "success": ("1", "integrated to the end"),
    "reached": ("rad", "shaft angle at the end, or at the failure"),
}
LOGICAL = ("whirl", "success", "inside_model")


def row_of(result: Statistics) -> dict[str, jax.Array]:
    """The `VARIABLES` of one design; an ideal joint is inside the limits of contact."""
    row = {name: result[name] for name in STATISTICS}
    row |= {name: getattr(result, name) for name in ("foundation_rms_error", "whirl", "success")}
    limits = ("half_width_ratio", "impact_speed_ratio", "delivered_restitution")
    row |= {name: getattr(result.validity, name) for name in limits}
    return row | {"inside_model": result.validity.inside, "reached": result.outcome.reached}
