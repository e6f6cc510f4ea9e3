"""The answer of a search in result.json, and at the end of the screen."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from rich.console import Console

from jaxcrusher.orbits.result import PeriodicOrbit
from optimize.answer import Answer, Confirmed
from optimize.search.confirm import long_window
from optimize.search.orbits import KEPT
from optimize.tell import tables
from optimize.tell import words as formatting

# Fields of the answer that result.json states otherwise; maps are separate files.
OTHERWISE = ("problem", "maps", "ends")


def content(answer: Answer) -> dict[str, Any]:
    """Return the answer as nested dicts; unknown numbers are NaN."""
    problem, of = answer.problem, answer.problem.objective
    names = (field.name for field in fields(answer) if field.name not in OTHERWISE)
    return {
        "objective": {"name": of.name, "unit": of.unit, "meaning": of.meaning},
        "box": {
            "bounds": dict(problem.design.bounds),
            "capacity_floor": problem.capacity_floor,
            "derived_speed": problem.speeds,
            "units": dict(problem.units),
            "limits": _plain(problem.limits),
        },
        "fixed": dict(problem.design.fixed),
        "columns": {name: one[:2] for name, one in problem.columns.items()},
        "settle_turns": long_window(problem.effort).settle,
        "compared_with": problem.compared_with,
        "bulk_density": problem.bulk_density,
        "seed": problem.effort.seed,
        "stable_orbits": None if answer.maps is None else answer.maps.stable_orbits,
        **{name: _plain(getattr(answer, name)) for name in names},
        "throughput": answer.throughput,  # t/h
    }


def _plain(value: Any) -> Any:
    if isinstance(value, PeriodicOrbit):
        return _orbit(value)
    if is_dataclass(value):
        found = {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
        # Forces, capacity and stroke of a design stand beside its objective.
        if isinstance(value, Confirmed):
            found |= found.pop("forces") | (found.pop("crushing") or {})
        return found
    if isinstance(value, Mapping):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return value


def _orbit(orbit: PeriodicOrbit) -> dict[str, Any]:
    """Return the numbers of an orbit without its path: RMS and peak of forces, and `KEPT`."""
    forces = dict.fromkeys((orbit.scene.headline, "shaking_rms"))
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


def print_answer(console: Console, answer: Answer) -> None:
    """Print the answer; the other results are in report.html."""

    def tell(line: str) -> None:
        console.print(line, highlight=False, markup=False)

    if not answer.finished:
        tell(f"The search {answer.status}. The same command goes on from there.")
    tell(formatting.answer(answer))
    if answer.designs:
        console.print(tables.answer(answer).printed())
        tell(tables.caution(answer))
    failed = [check for check in answer.checks if not check.passed]
    if count := len(answer.checks):
        tell(f"{count - len(failed)} of {count} checks passed.")
    for check in failed:
        console.print(f"[red]failed[/] {check.name}: {check.detail}")
    if answer.bound is not None:
        tell(answer.bound.statement)
    tell(answer.remark)
