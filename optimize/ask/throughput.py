"""Capacity in t/h: the volume crushed in an hour times the bulk density of the crushed rock."""

from jaxcrusher.basics.checks import require
from jaxcrusher.scenes.units import quantity_in


def read_bulk_density(written: str | None) -> float | None:
    """Return a bulk density in kg/m3, None where none is written.

    Raises ValueError for a text that is no positive density.
    """
    if written is None:
        return None
    density = quantity_in("kg/m3", "bulk_density", written)
    require(density > 0, "bulk_density", "be > 0", written)
    return density


def throughput(capacity: float, bulk_density: float) -> float:
    """Return the capacity in t/h of one in m3/h, at a bulk density in kg/m3."""
    return 1e-3 * bulk_density * capacity
