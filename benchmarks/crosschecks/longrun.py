"""Cases compared by statistics: impacting motions, whose trajectories part, and the whirl."""

from collections.abc import Iterator

import numpy as np

import jaxcrusher as jc
from benchmarks import comparison
from benchmarks.comparison import Comparison
from benchmarks.crosschecks.programs import CVODE, EXUDYN, OURS, our_scene, timed
from benchmarks.peers import exudyn_peer, sundials_peer
from benchmarks.peers.equations import Crusher
from benchmarks.peers.motion import Motion

SAMPLES = 4096  # a turn, of the other programs' motions

# Without friction: with it some starts end in the whirl, and means over few runs say nothing.
HARD = (Crusher(speed=40.0, clearance=0.12e-3), Crusher())
# Names of reasons, which crosschecks.md explains.
INDEPENDENT, TURNS = "members", "turns"


def _starts(crusher: Crusher, count: int, seed: int) -> list[complex]:
    """Return eccentricities drawn evenly from a disc of half the clearance, m."""
    random = np.random.default_rng(seed)
    radii = crusher.clearance / 2 * np.sqrt(random.uniform(size=count))
    return [complex(e) for e in radii * np.exp(2j * np.pi * random.uniform(size=count))]


def _ours(crusher: Crusher, starts, settle: int, turns: int) -> dict[str, list[float]]:
    outputs = ("foundation_mean", "foundation_rms", "foundation_peak")
    found = {"mean": [], "RMS": [], "peak": []}
    with timed(OURS):
        for e in starts:
            scene = our_scene(crusher, e=e)
            result = jc.statistics(scene, settle, turns, outputs=outputs)
            for name, output in zip(found, outputs, strict=True):
                found[name].append(float(getattr(result, output)))
    return found


def _theirs(program, crusher: Crusher, starts, settle: int, turns: int) -> dict[str, list[float]]:
    found = {"mean": [], "RMS": [], "peak": []}
    turn = 2 * np.pi / crusher.speed
    times = turn / SAMPLES * np.arange((settle + turns) * SAMPLES + 1)
    for e in starts:
        start = Motion(crusher, e=e)
        with timed(program):
            if program == CVODE:
                known = start.observe(times, sundials_peer.cvode(start, times, rtol=1e-10))
            else:
                steps = round(times[1] / 5e-6)
                known = exudyn_peer.Model(start).run(times[-1], times[1] / steps, times[1])
        force = known["foundation_force"][1 + settle * SAMPLES :]
        found["mean"].append(force.mean())
        found["RMS"].append(np.sqrt((force**2).mean()))
        found["peak"].append(force.max())
    return found


def impacts(
    crushers=HARD, members: int = 24, settle: int = 1, turns: int = 3, exudyn_members: int = 8
) -> Iterator[Comparison]:
    """Compare ensembles in the first turns after random starts, while pin and bore hit."""
    for crusher in crushers:
        ours = _ours(crusher, _starts(crusher, members, 1), settle, turns)
        others = {CVODE: _theirs(CVODE, crusher, _starts(crusher, members, 2), settle, turns)}
        if exudyn_members:
            starts = _starts(crusher, exudyn_members, 3)
            others[EXUDYN] = _theirs(EXUDYN, crusher, starts, settle, turns)
        for program, theirs in others.items():
            yield from _rows(crusher, ours, theirs, program, settle, turns)


def swings(members: int = 16, settle: int = 10, turns: int = 5) -> Iterator[Comparison]:
    """Compare after many turns, when a centred start's impacts left a swing of random size."""
    crusher = Crusher()
    ours = _ours(crusher, _starts(crusher, members, 4), settle, turns)
    theirs = _theirs(CVODE, crusher, _starts(crusher, members, 5), settle, turns)
    yield from _rows(crusher, ours, theirs, CVODE, settle, turns)


def _rows(crusher, ours, theirs, program, settle, turns) -> Iterator[Comparison]:
    what = "no friction" if crusher.friction is None else f"friction {crusher.friction:g}"
    what += f", {crusher.speed:g} rad/s, {1e3 * crusher.clearance:g} mm"
    for name in ours:
        runs = (
            f"{len(ours[name])} and {len(theirs[name])} runs, turns {settle + 1}-{settle + turns}"
        )
        label = f"{name} of |R_O| + |R_C|, N ({what}; {runs})"
        yield comparison.samples(label, ours[name], theirs[name], program, INDEPENDENT)


def whirl(settle: int = 4, turns: int = 8) -> Iterator[Comparison]:
    """Compare the backward whirl: friction 0.1, surface slip, 30 rad/s, 0.06 mm.

    The pin is thrown along its bore, which whirls in any case: of the centred start rounding
    decides.
    """
    crusher = Crusher(friction=0.1)
    e, rate = 1.02 * crusher.clearance + 0j, 1j
    with timed(OURS):
        ours = jc.statistics(our_scene(crusher, e=e, rate=rate), settle, turns)
    start = Motion(crusher, e=e, rate=rate)
    times = 2 * np.pi / crusher.speed / SAMPLES * np.arange((settle + turns) * SAMPLES + 1)
    with timed(CVODE):
        theirs = start.observe(times, sundials_peer.cvode(start, times, rtol=1e-9))
    kept = slice(1 + settle * SAMPLES, None)
    force = theirs["foundation_force"][kept].reshape(turns, SAMPLES)
    rms = np.sqrt((force**2).mean(axis=1))
    yield comparison.samples(
        "RMS of |R_O| + |R_C|, N", ours.by_turn["foundation_rms"], rms, CVODE, TURNS
    )
    angle = np.unwrap(np.arctan2(theirs["eccentricity"][:, 1], theirs["eccentricity"][:, 0]))
    winding = np.diff(angle[settle * SAMPLES :: SAMPLES]) / (2 * np.pi)
    # Ours comes as one number for all turns: its turns scatter as theirs do.
    error = winding.std(ddof=1) * np.sqrt(2 / turns)
    yield comparison.numbers(
        "revolutions of the pin round the bore per turn",
        ours.winding,
        winding.mean(),
        CVODE,
        4 * error / abs(winding.mean()),
        TURNS,
    )
    depth = np.linalg.norm(theirs["eccentricity"][kept], axis=1) / crusher.clearance - 1
    # Both see 1024 instants a turn.
    deepest = depth[3::4].reshape(turns, SAMPLES // 4).max(axis=1)
    yield comparison.numbers(
        "largest penetration / clearance",
        ours.penetration_ratio,
        deepest.max(),
        CVODE,
        4 * deepest.std(ddof=1) / deepest.max(),
        "largest turn",
    )
