"""Motions of drawn crushers by lanes beside diffrax at a thousandth of the tolerance."""

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import jaxcrusher as jc
from benchmarks.pages import table
from benchmarks.stability.drawn import KINDS, Kind, numbers
from benchmarks.stability.judgement import AGREES, DISAGREES, PREDICTABLE, PROMISED, REFUSED
from benchmarks.stability.peer import changes
from jaxcrusher.basics.plane import Vector
from jaxcrusher.batch.engines import stack
from jaxcrusher.files.results import results_folder, write_table
from jaxcrusher.mechanism.starts import Given
from jaxcrusher.motion.simulation import Trajectory

INSTANTS = 401  # compared
ANGLES = np.linspace(0, 0.25 * 2 * np.pi, INSTANTS)
RTOL, FINE = 1e-9, 1e-12
MOST_STEPS, MOST_FINE = 200_000, 2_000_000
# Starts are moved by this share of a clearance to see how errors grow: by what a step of ours is
# allowed, times a few thousand steps, as in `benchmarks.stability.judgement`.
OFFSET = 3e-6
# Where what a start is moved by dies away, a motion may still enlarge what each later step adds.
# Diffrax at our tolerance adds as much as ours; two such errors are rarely further apart than this.
FELLOWS = 10.0
UNKNOWN, SMOOTHED = "no reference", "agrees if narrow and fine"


@dataclass(frozen=True)
class Row:
    """A drawn motion and its verdict."""

    kind: str
    number: int
    verdict: str
    error: float = (
        np.nan
    )  # a share of the largest value, where it is largest beside what is allowed
    over_allowed: float = np.nan
    span: float = np.nan  # compared, a share of the whole
    contacts: float = np.nan
    programs: float = (
        np.nan
    )  # of lanes from diffrax at the same fine tolerance, where it is largest
    remark: str = ""


def motion(scene: jc.Scene, rtol: float, most: int) -> Trajectory:
    """Return a quarter of a turn."""
    times, method = jnp.asarray(ANGLES) / scene.drive.speed, jc.Method(max_steps=most)
    return jc.simulate(scene, times, outputs=_compared(scene), rtol=rtol, method=method)


def _compared(scene: jc.Scene) -> tuple[str, ...]:
    joints = [scene.prefix(name) for name, _ in scene.joints.items()]
    seen = [f"{joint}{name}" for joint in joints for name in ("eccentricity", "normal_force")]
    return ("foundation_force", *seen)


@eqx.filter_jit
def _moved(scene: jc.Scene, offset: Vector) -> jc.Scene:
    """Move every pin by a share of its clearance: what grows fastest soon hides the rest."""
    assert scene.start is not None
    e, rates = scene.start.eccentricities(scene)
    moved = scene.joints.map(lambda joint, at: at / joint.clearance + offset, e)
    return eqx.tree_at(lambda s: s.start, scene, Given(moved, rates))


def _each(motions: Trajectory, count: int) -> list[Trajectory]:
    return [jax.tree.map(lambda leaf, i=i: np.asarray(leaf[i]), motions) for i in range(count)]


def compared(kind: Kind, seed: int, count: int) -> Iterator[Row]:
    """Yield the verdict on each drawn crusher of a kind."""
    scenes: dict[int, jc.Scene] = {}
    for i in range(count):
        try:
            scenes[i] = jc.build_scene(numbers(kind, f"{seed} {kind.name} {i}"))
        except ValueError as error:
            yield Row(kind.name, i, REFUSED, remark=str(error))
    # By the start of one class, so that one program serves them all.
    still = Vector(jnp.zeros(()), jnp.zeros(()))
    of_start: dict[object, list[int]] = {}
    for i, scene in scenes.items():
        of_start.setdefault(jax.tree.structure(scene), []).append(i)
    for places in of_start.values():
        group = stack([scenes[i] for i in places])
        ours = _each(
            jc.map_all(eqx.Partial(motion, rtol=RTOL, most=MOST_STEPS), group), len(places)
        )
        fine = eqx.Partial(motion, rtol=FINE, most=MOST_FINE)
        fellow = eqx.Partial(motion, rtol=RTOL, most=MOST_FINE)
        known, fellows = (
            _each(jc.map_all(how, group, engine="loop"), len(places)) for how in (fine, fellow)
        )
        others = [
            _each(jc.map_all(fine, stack([_moved(scenes[i], at) for i in places])), len(places))
            for at in (still, Vector(still.x + OFFSET, still.y), Vector(still.x, still.y + OFFSET))
        ]
        for at, i in enumerate(places):
            near = [each[at] for each in others]
            yield judged(kind.name, i, ours[at], known[at], fellows[at], near)


def judged(
    name: str,
    i: int,
    ours: Trajectory,
    known: Trajectory,
    fellow: Trajectory,
    others: list[Trajectory],
) -> Row:
    """Compare a motion with the reference for as long as neighbours and a fellow stay with it.

    The fellow is the reference's program at the tolerance of ours.
    """
    if not bool(ours.success):
        return Row(name, i, REFUSED, remark=ours.failure or "NO WORD")
    if not all(bool(one.success) for one in (known, fellow, *others)):
        return Row(name, i, UNKNOWN, remark=known.failure)
    forces = [of for seen, of in known.values.items() if seen.endswith("normal_force")]
    contacts = np.sum([changes(np.asarray(force)) for force in forces], axis=0)
    worst = Row(name, i, AGREES, 0.0, 0.0, 1.0, float(contacts[-1]), 0.0)
    for seen, theirs in known.values.items():
        if seen.endswith("normal_force"):
            continue
        theirs = np.asarray(theirs).reshape(INSTANTS, -1)
        size = abs(theirs).max()
        off = abs(np.asarray(ours[seen]).reshape(INSTANTS, -1) - theirs).max(axis=1) / size
        base, *moved = (np.asarray(one[seen]).reshape(INSTANTS, -1) for one in others)
        parted = np.max([abs(one - base).max(axis=1) for one in moved], axis=0) / size
        added = abs(np.asarray(fellow[seen]).reshape(INSTANTS, -1) - theirs).max(axis=1) / size
        parted, added = np.maximum.accumulate(parted), np.maximum.accumulate(added)
        grown = np.maximum((1 + contacts) * parted, FELLOWS * added)
        kept = np.cumprod(grown <= PREDICTABLE).astype(bool)
        share = float(kept.mean())
        ratio = np.where(kept, off / np.maximum(grown, PROMISED), 0)
        at = int(np.argmax(ratio))
        alike = float(np.where(kept, abs(base - theirs).max(axis=1), 0).max() / size)
        worst = replace(worst, span=min(worst.span, share), programs=max(worst.programs, alike))
        wrong = not np.isfinite(off).all() or ratio[at] > 1
        if wrong:
            worst = replace(worst, verdict=DISAGREES)
        if not ratio[at] <= worst.over_allowed:
            worst = replace(worst, error=float(off[at]), over_allowed=float(ratio[at]), remark=seen)
    return worst


def run_drawn(out: Path, seed: int, count: int) -> None:
    """Judge drawn motions, as many of each kind; write stability_drawn.csv and print a table."""
    each = count // len(KINDS)
    run_kinds(out, "stability_drawn.csv", KINDS, lambda kind: compared(kind, seed, each))


def run_kinds(
    out: Path,
    file: str,
    kinds: Sequence[Any],
    judge: Callable[[Any], Iterable[Any]],
    verdicts: Sequence[str] = (AGREES, SMOOTHED, REFUSED, UNKNOWN, DISAGREES),
) -> None:
    """Write the rows of each kind, which have names, as they come; print a table of verdicts."""
    folder, rows = results_folder(out), []
    for kind in kinds:
        began = time.perf_counter()
        for row in judge(kind):
            rows.append(row)
            write_table(folder / file, map(asdict, rows))
        print(f"{kind.name}: {time.perf_counter() - began:.0f} s", flush=True)
    counts = Counter((row.kind, row.verdict) for row in rows)
    cells = [[kind.name, *(counts[kind.name, v] for v in verdicts)] for kind in kinds]
    cells.append(["all", *(sum(row.verdict == v for row in rows) for v in verdicts)])
    print(table(["drawn", *verdicts], cells))
