"""The answer of a search as result.json holds it."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from jaxcrusher.orbits.result import PeriodicOrbit
from optimize.answer import Answer, Confirmed
from optimize.search.orbits import KEPT


def content(answer: Answer) -> dict[str, Any]:
    """Return the answer as nested dicts, with NaN where there is no number."""
    return _plain(answer) | {"throughput": answer.throughput}  # t/h


def _plain(value: Any) -> Any:
    if isinstance(value, PeriodicOrbit):
        return _orbit(value)
    if is_dataclass(value):
        found = {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
        # The forces of a design, and what it is as a crusher, stand beside its objective.
        if isinstance(value, Confirmed):
            found |= found.pop("forces") | (found.pop("crushing") or {})
        return found
    if isinstance(value, Mapping):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return value


def _orbit(orbit: PeriodicOrbit) -> dict[str, Any]:
    """Return the numbers of an orbit without its path: forces, RMS and peak, and `KEPT` ones."""
    forces = dict.fromkeys((orbit.scene.leading, "shaking_rms"))
    forces |= {name.replace("rms", "peak"): None for name in forces}
    numbers = {name: float(getattr(orbit, name)) for name in (*forces, *KEPT)}
    parts = [[float(m.real), float(m.imag)] for m in orbit.multipliers]
    start = orbit.eccentricity
    return {
        "failure": orbit.failure,
        "period": orbit.period,
        **numbers,
        "multipliers": parts,
        "section": [] if start is None else start[0],  # the pins at shaft angle zero, clearances
        "state": orbit.section,
        "validity": _plain(orbit.validity),
    }
