"""Periodic orbits of drawn linkages, each integrated round its period as free bodies by SciPy."""

from dataclasses import replace
from pathlib import Path

from benchmarks.stability.drawn_orbits import VERDICTS, Row, judged
from benchmarks.stability.drawn_run import run_kinds
from benchmarks.stability.free_orbits import by_free_bodies
from benchmarks.stability.mechanisms import FAMILIES, Drawn, Family, mechanism
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.orbits.result import PeriodicOrbit

SLOW = 0.3  # every other mechanism turns at this share of the drawn speed, to keep contact


def run_linkage_orbits(out: Path, seed: int, count: int) -> None:
    """Judge drawn orbits of linkages, as many of each family; print a table."""

    def drawn(family: Family, i: int) -> Drawn:
        found = mechanism(family, f"{seed} {i}")
        slow = {"speed": SLOW * found.machine.number("speed")} if i % 2 else {}
        return replace(found, machine=found.machine.replace(**slow))

    def row(family: Family, i: int) -> Row:
        def make() -> Scene:
            return drawn(family, i).machine.scene()

        def round_it(orbit: PeriodicOrbit) -> tuple[float, float]:
            return by_free_bodies(orbit, drawn(family, i).peer({}))

        return judged(family.name, i, make, round_it)

    each, file = range(count // len(FAMILIES)), "stability_linkage_orbits.csv"
    run_kinds(out, file, FAMILIES, lambda family: (row(family, i) for i in each), VERDICTS)
