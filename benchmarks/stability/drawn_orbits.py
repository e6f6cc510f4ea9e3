"""Periodic orbits of drawn crushers, each integrated round its period by diffrax."""

import time
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

import jaxcrusher as jc
from benchmarks.pages import table
from benchmarks.stability.drawn import KINDS, Kind, numbers
from benchmarks.stability.judgement import AGREES, DISAGREES, OUTSIDE, REFUSED
from jaxcrusher.files.results import results_folder, write_table

FINE = 1e-12
# Of a state, in clearances and m/s, as `periodic_orbit` claims, and of the RMS, as a share of it;
# times what the largest multiplier makes of an error.
ALLOWED = 1e-6
NONE = "no orbit, in words"
VERDICTS = (AGREES, OUTSIDE, NONE, REFUSED, DISAGREES)


@dataclass(frozen=True)
class Row:
    """A drawn crusher, its orbit, and how far the orbit is from closing."""

    kind: str
    number: int
    verdict: str
    remark: str
    seconds: float
    state: float = np.nan  # largest change of a state in one period, in clearances and m/s
    rms: float = np.nan  # relative, of what is integrated against the orbit's
    multiplier: float = np.nan


def solved(kind: Kind, seed: int, i: int) -> Row:
    """Solve for the orbit of a drawn crusher, and integrate it once round."""
    began = time.perf_counter()
    try:
        orbit = jc.periodic_orbit(jc.build_scene(numbers(kind, f"{seed} {kind.name} {i}")))
    except ValueError as error:
        return Row(kind.name, i, REFUSED, str(error), time.perf_counter() - began)
    spent = time.perf_counter() - began
    if not bool(orbit.success):
        words = orbit.failure
        return Row(kind.name, i, NONE if words else DISAGREES, words, spent)
    scene, seen = orbit.scene.steady(), ("foundation_rms",)  # of a rough feed, under its mean
    round_it = jc.poincare_section(
        scene, 0, orbit.period, state=orbit.section, outputs=seen, rtol=FINE
    )
    if not bool(round_it.success):
        return Row(kind.name, i, DISAGREES, round_it.failure, spent)
    before, after = np.asarray(orbit.section), np.asarray(round_it.states[-1])
    state = np.max(np.abs(after - before))
    found = np.sqrt(np.mean(np.asarray(round_it.values["foundation_rms"]) ** 2))
    rms = abs(float(found) / float(orbit.foundation_rms) - 1)
    multiplier = float(orbit.largest_multiplier)
    close = max(float(state), rms) <= ALLOWED * max(1.0, multiplier)
    inside = AGREES if bool(orbit.validity.inside) else OUTSIDE
    verdict = inside if close else DISAGREES
    return Row(kind.name, i, verdict, orbit.found, spent, float(state), rms, multiplier)


def run_orbits(out: Path, seed: int, count: int) -> None:
    """Judge drawn orbits, as many of each kind; write stability_orbits.csv and print a table."""
    folder, rows = results_folder(out), []
    kinds = [kind for kind in KINDS if kind.choices.get("formulation") != "multiplier"]
    for kind in kinds:
        for i in range(count // len(kinds)):
            rows.append(solved(kind, seed, i))
            write_table(folder / "stability_orbits.csv", map(asdict, rows))
        longest = max(row.seconds for row in rows)
        print(f"{kind.name}: the longest yet took {longest:.0f} s", flush=True)
    counts = Counter((row.kind, row.verdict) for row in rows)
    cells = [[kind.name, *(counts[kind.name, v] for v in VERDICTS)] for kind in kinds]
    cells.append(["all", *(sum(row.verdict == v for row in rows) for v in VERDICTS)])
    print(table(["crusher", *VERDICTS], cells))
