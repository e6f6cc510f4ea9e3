"""Periodic orbits of drawn crushers, each integrated round its period by diffrax.

Those whose laws `crusher_bodies` has are integrated by SciPy besides, as free bodies.
And how long an answer takes, of these and of the examples.
"""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

import jaxcrusher as jc
from benchmarks.pages import table
from benchmarks.peers.crusher_bodies import crusher
from benchmarks.stability.drawn import KINDS, Kind, numbers
from benchmarks.stability.drawn_run import run_kinds
from benchmarks.stability.free_orbits import by_free_bodies
from benchmarks.stability.judgement import AGREES, DISAGREES, OUTSIDE, REFUSED
from jaxcrusher.files.results import results_folder, write_table
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.scenes.parameters import complete
from jaxcrusher.scenes.reader import read_machine

FINE = 1e-12
# Kinds whose laws free bodies have too.
FREE = ("A", "A, B, C", "B, C")
# Of a state, in clearances and m/s, as `periodic_orbit` claims, and of the RMS, as a share of it;
# times what the largest multiplier makes of an error.
ALLOWED = 1e-6
NONE, OPEN = "no orbit, in words", "SciPy takes too long"
VERDICTS = (AGREES, OUTSIDE, NONE, REFUSED, OPEN, DISAGREES)


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


def judged(
    name: str,
    i: int,
    make: Callable[[], Scene],
    round_it: Callable[[PeriodicOrbit], tuple[float, float]],
) -> Row:
    """Solve for the orbit of a drawn machine, and integrate it once round."""
    began = time.perf_counter()
    try:
        orbit = jc.periodic_orbit(make())
    except ValueError as error:
        return Row(name, i, REFUSED, str(error), time.perf_counter() - began)
    spent = time.perf_counter() - began
    if not bool(orbit.success):
        words = orbit.failure
        return Row(name, i, NONE if words else DISAGREES, words, spent)
    try:
        state, rms = round_it(orbit)
    except TimeoutError as error:
        return Row(name, i, OPEN, str(error), spent)
    except RuntimeError as error:
        return Row(name, i, DISAGREES, str(error), spent)
    multiplier = float(orbit.largest_multiplier)
    close = max(state, rms) <= ALLOWED * max(1.0, multiplier)
    inside = AGREES if bool(orbit.validity.inside) else OUTSIDE
    verdict = inside if close else DISAGREES
    return Row(name, i, verdict, orbit.found, spent, state, rms, multiplier)


def by_diffrax(orbit: PeriodicOrbit) -> tuple[float, float]:
    """Return by how much a crusher's state and RMS differ after one period."""
    scene, seen = orbit.scene.steady(), ("foundation_rms",)  # of a rough feed, under its mean
    after = jc.poincare_section(
        scene, 0, orbit.period, state=orbit.section, outputs=seen, rtol=FINE
    )
    if not bool(after.success):
        raise RuntimeError(after.failure)
    state = np.max(np.abs(np.asarray(after.states[-1]) - np.asarray(orbit.section)))
    rms = np.sqrt(np.mean(np.asarray(after.values["foundation_rms"]) ** 2))
    return float(state), abs(float(rms) / float(orbit.foundation_rms) - 1)


def run_orbits(out: Path, seed: int, count: int) -> None:
    """Judge drawn orbits of crushers, as many of each kind; write stability_orbits.csv."""
    kinds = [kind for kind in KINDS if kind.choices.get("formulation") != "multiplier"]

    def row(kind: Kind, i: int) -> Row:
        values = numbers(kind, f"{seed} {kind.name} {i}")

        def round_it(orbit: PeriodicOrbit) -> tuple[float, float]:
            state, rms = by_diffrax(orbit)
            if kind.name not in FREE:
                return state, rms
            theirs = by_free_bodies(orbit, crusher(complete(values)))
            return max(state, theirs[0]), max(rms, theirs[1])

        return judged(kind.name, i, lambda: jc.build_scene(values), round_it)

    each = range(count // len(kinds))
    run_kinds(
        out, "stability_orbits.csv", kinds, lambda kind: (row(kind, i) for i in each), VERDICTS
    )


@dataclass(frozen=True)
class Answer:
    """What `periodic_orbit` answers of a machine with the usual effort, and its time."""

    machine: str
    answer: str
    first_cpu_s: float  # with what is compiled for it, which a machine before may have been
    again_cpu_s: float
    again_s: float


def answered(machine: str, make: Callable[[], Scene]) -> Answer:
    """Ask for an orbit twice: the second time nothing is compiled."""
    spent, words = [], ""
    for _ in range(2):
        cpu, began = time.process_time(), time.perf_counter()
        try:
            orbit = jc.periodic_orbit(make())
        except ValueError as error:
            words = f"refused: {error}"
        else:
            known = "stable" if bool(orbit.stable) else "unstable"
            kind = "not known to be stable" if bool(orbit.undecided) else known
            found = f"{kind}, period {orbit.period}: {orbit.found}"
            words = found if bool(orbit.success) else orbit.failure
        spent.append((time.process_time() - cpu, time.perf_counter() - began))
    return Answer(machine, words, spent[0][0], *spent[1])


def run_answers(out: Path, seed: int, count: int) -> None:
    """Time answers of examples and of as many drawn crushers; write stability_answers.csv."""
    folder, rows = results_folder(out), []
    kinds = [kind for kind in KINDS if kind.choices.get("formulation") != "multiplier"]
    makes: dict[str, Callable[[], Scene]] = {
        path.stem: read_machine(path).scene for path in sorted(Path("examples").glob("*.toml"))
    }
    makes["pe900x1200 without load"] = read_machine(
        Path("examples/pe900x1200.toml"), [("load", "0 N")]
    ).scene
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
