"""Periodic orbits of drawn crushers, each integrated round its period by diffrax.

And how long an answer takes, of these and of the examples.
"""

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

import jaxcrusher as jc
from benchmarks.pages import table
from benchmarks.stability.drawn import KINDS, Kind, numbers
from benchmarks.stability.judgement import AGREES, DISAGREES, OUTSIDE, REFUSED
from jaxcrusher.files.results import results_folder, write_table
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.scenes.described import described

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


@dataclass(frozen=True)
class Answer:
    """What `periodic_orbit` answers of a machine with the usual effort, and its time."""

    machine: str
    answer: str
    first_cpu_s: float  # with what is compiled for it, which a machine before may have been
    again_cpu_s: float
    again_s: float


def answered(machine: str, make: Callable[[], AbstractScene]) -> Answer:
    """Ask for an orbit twice: the second time nothing is compiled."""
    spent, words = [], ""
    for _ in range(2):
        scene, cpu, began = make(), time.process_time(), time.perf_counter()
        try:
            orbit = jc.periodic_orbit(scene)
        except ValueError as error:
            words = f"refused: {error}"
        else:
            kind = "stable" if bool(orbit.stable) else "unstable"
            found = f"{kind}, period {orbit.period}: {orbit.found}"
            words = found if bool(orbit.success) else orbit.failure
        spent.append((time.process_time() - cpu, time.perf_counter() - began))
    return Answer(machine, words, spent[0][0], *spent[1])


def run_answers(out: Path, seed: int, count: int) -> None:
    """Time answers of examples and of as many drawn crushers; write stability_answers.csv."""
    folder, rows = results_folder(out), []
    kinds = [kind for kind in KINDS if kind.choices.get("formulation") != "multiplier"]
    makes: dict[str, Callable[[], AbstractScene]] = {
        path.stem: lambda path=path: described(path).scene
        for path in sorted(Path("examples").glob("*.toml"))
    }
    makes["pe900x1200 without load"] = lambda: (
        described(Path("examples/pe900x1200.toml"), [("load", "0 N")]).scene
    )
    for kind in kinds:
        for i in range(count // len(kinds)):
            key = f"{seed} {kind.name} {i}"
            makes[f"{kind.name}: {i}"] = lambda kind=kind, key=key: jc.build_scene(
                numbers(kind, key)
            )
    for machine, make in makes.items():
        rows.append(answered(machine, make))
        write_table(folder / "stability_answers.csv", map(asdict, rows))
    cells = [
        (
            row.machine,
            row.answer.partition(". ")[0],
            f"{row.first_cpu_s:.1f}",
            f"{row.again_cpu_s:.2f}",
        )
        for row in rows
    ]
    print(table(["machine", "answer", "first, CPU s", "again, CPU s"], cells))
