"""The orbits that `periodic_orbit` finds of crushers of other size, load law and contact law."""

import time
from collections import Counter, defaultdict
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

import jaxcrusher as jc
from benchmarks.pages import table
from benchmarks.stability.drawn import Kind, numbers
from jaxcrusher.files.results import results_folder, write_table

# Half as wide again as crushers are built. Each law of the load and of the contact stands in two
# structures or more: a structure takes a minute to compile.
SPREAD = 1.5
KINDS = tuple(
    Kind(f"{contact}, {load}, {slip}", {"contact_law": contact, "load_law": load, "slip": slip})
    for contact, load, slip in (
        ("lankarani_nikravesh", "along_jaw", "centre"),
        ("flores", "normal_to_jaw", "surface"),
        ("gonthier", "along_jaw", "surface"),
        ("hu_guo", "normal_to_jaw", "centre"),
        ("zhiying_qishao", "closing_stroke", "surface"),
        ("flores", "none", "centre"),
    )
)
STABLE, UNSTABLE, NAMED, UNKNOWN = "stable", "unstable", "named", "not known"
# What a failure says where the motion is known.
MOTIONS = ("whirl", "repeats", "chaotic", "does not repeat within")


@dataclass(frozen=True)
class Row:
    """A drawn crusher and the answer to it."""

    kind: str
    number: int
    answer: str
    words: str  # by which way the orbit was found, or what the motion does
    period: int = 0
    rms: float = np.nan
    multiplier: float = np.nan
    seconds: float = np.nan  # of the processor, with what is compiled for it


def answered(kind: Kind, seed: int, i: int) -> Row | None:
    """Ask for the orbit of a drawn crusher; None if its numbers make no crusher."""
    try:
        scene = jc.build_scene(numbers(kind, f"{seed} {kind.name} {i}", SPREAD))
    except ValueError:
        return None
    began = time.process_time()
    orbit = jc.periodic_orbit(scene)
    spent = time.process_time() - began
    if not bool(orbit.success):
        known = any(word in orbit.failure for word in MOTIONS)
        return Row(kind.name, i, NAMED if known else UNKNOWN, orbit.failure, seconds=spent)
    doubted = UNSTABLE if bool(orbit.multipliers_error < 1) else UNKNOWN
    answer = STABLE if bool(orbit.stable) else doubted
    rms, modulus = float(orbit.foundation_rms), float(orbit.largest_multiplier)
    words = orbit.found if answer == STABLE else orbit.instability
    return Row(kind.name, i, answer, words, orbit.period, rms, modulus, spent)


def run(out: Path, count: int, seed: int) -> None:
    """Draw crushers, ask for the orbit of each, and print two tables."""
    jc.set_up()
    folder, rows = results_folder(out), list[Row]()
    for kind in KINDS:
        i, wanted = 0, len(rows) + count // len(KINDS)
        while len(rows) < wanted:
            row = answered(kind, seed, i)
            rows += [] if row is None else [row]
            i += 1
        write_table(folder / "machines.csv", map(asdict, rows))
        print(kind.name, dict(Counter(row.answer for row in rows if row.kind == kind.name)))
    answers = (STABLE, UNSTABLE, NAMED, UNKNOWN)
    counts = Counter((row.kind, row.answer) for row in rows)
    cells = [[kind.name, *(counts[kind.name, one] for one in answers)] for kind in KINDS]
    print(table(["crusher", *answers], cells))
    ways = defaultdict[tuple[str, str], list[float]](list)
    for row in rows:
        ways[row.answer, row.words if row.answer != UNSTABLE else ""].append(row.seconds)
    found = [[*way, len(spent), f"{np.median(spent):.2g}"] for way, spent in ways.items()]
    print(table(["answer", "how", "crushers", "median CPU s"], found))
