"""The motion with clearance, 0.06 mm at 30 rad/s from a centred start, for 30 ms."""

from collections.abc import Iterator

import equinox as eqx
import numpy as np

from benchmarks import comparison
from benchmarks.comparison import Comparison
from benchmarks.crosschecks.programs import (
    CONTACT_POINT,
    CVODE,
    DOP853,
    EXUDYN,
    FORMULATIONS,
    GROWTH,
    IDA,
    LEVELS,
    REACTIONS,
    at_middle_of_overlap,
    growth,
    our_scene,
    simulate_ours,
    simulate_theirs,
)
from benchmarks.peers.equations import Crusher, normal_force
from benchmarks.peers.motion import Motion

WINDOWS = ((0, 4), (4, 8), (8, 12), (12, 16), (16, 20), (20, 30))  # ms
# Our contact's corner is a parabola of this width (m), a quarter of it high: K (width/4)^1.5 is
# 2e-6 of the largest force.
WIDTH, LARGEST_FORCE = 1e-8, 1.8e5


def clearance(
    frictions=(None, 0.1), peers=(DOP853, CVODE, IDA, EXUDYN), formulations=FORMULATIONS
) -> Iterator[Comparison]:
    """Compare histories, and the largest force of windows."""
    times = 5e-6 * np.arange(6001)
    for friction in frictions:
        crusher = Crusher(friction=friction)
        label = "no friction" if friction is None else f"friction {friction:g}"
        grown = growth(crusher, times)
        theirs = {name: simulate_theirs(name, Motion(crusher), times) for name in peers}
        for formulation in formulations:
            ours = simulate_ours(our_scene(crusher, formulation), times)
            what = f"{label}, {formulation}"
            for program, other in theirs.items():
                level = max(LEVELS[formulation], LEVELS[program])
                limits = _limits(crusher, grown, level)
                if program == EXUDYN and friction is not None:
                    yield from _against_exudyn(what, crusher, ours, other, limits, times)
                else:
                    names = ("contact_force", "eccentricity")
                    names += REACTIONS if program in (DOP853, IDA) else ()
                    for name in names:
                        yield from _two_ends(what, name, ours, other, program, times, limits)
            if DOP853 in theirs:
                yield from _windows(what, ours, theirs[DOP853], times, grown, formulation)


def _limits(crusher: Crusher, grown: dict, level: float) -> dict:
    """Return the growth of errors; forces get the error of our smoothed corner besides."""
    corner = normal_force(crusher, WIDTH / 4, crusher.impact_velocity) / LARGEST_FORCE
    forces = ("contact_force", "normal_force", *REACTIONS)
    return {n: level * factor + corner * (n in forces) for n, factor in grown.items()}


def _two_ends(
    what, name, ours, theirs, program, times, limits, reason=GROWTH
) -> Iterator[Comparison]:
    """Compare one quantity over 20 and over 30 ms."""
    for end in (0.02, 0.03):
        count = int(np.searchsorted(times, end + 1e-9))
        yield comparison.histories(
            f"{name.replace('_', ' ')}, {1e3 * end:g} ms ({what})",
            ours[name][:count],
            theirs[name][:count],
            program,
            float(limits[name][count - 1]),
            reason,
        )


def _against_exudyn(what, crusher, ours, theirs, limits, times) -> Iterator[Comparison]:
    """Compare with friction: ours, and CVODE with EXUDYN's point of contact."""
    there, moved = at_middle_of_overlap(crusher, times)
    for name in ("contact_force", "eccentricity"):
        wider = {name: limits[name] + moved[name]}
        yield from _two_ends(what, name, ours, theirs, EXUDYN, times, wider, CONTACT_POINT)
        yield from _two_ends(
            "friction 0.1, CVODE with EXUDYN's contact point for ours",
            name,
            there,
            theirs,
            EXUDYN,
            times,
            limits,
        )


def _windows(what, ours, theirs, times, grown, formulation) -> Iterator[Comparison]:
    """Compare the largest force at A in each window."""
    level = max(LEVELS[formulation], LEVELS[DOP853])
    largest = theirs["contact_force"].max()
    for begin, end in WINDOWS:
        inside = (times >= 1e-3 * begin) & (times < 1e-3 * end)
        mine, other = (known["contact_force"][inside].max() for known in (ours, theirs))
        limit = level * grown["contact_force"][inside].max() * largest / max(other, 1.0)
        label = f"largest force at A, {begin}-{end} ms, N ({what})"
        yield comparison.numbers(label, mine, other, DOP853, limit, GROWTH)


def _widths(scene) -> list:
    joint = scene.joints.at("main")
    return [law.width for law in (joint.normal, joint.friction) if law is not None]


def smoothing() -> Iterator[Comparison]:
    """Compare the default widths of our smoothed corners, and a hundredth of them."""
    times = 1e-5 * np.arange(3001)
    for friction in (None, 0.1):
        crusher = Crusher(friction=friction)
        grown = growth(crusher, times)
        limits = _limits(crusher, grown, LEVELS[CVODE])
        theirs = simulate_theirs(CVODE, Motion(crusher), times)
        for shrink in (1.0, 0.01):
            scene = our_scene(crusher)
            scene = eqx.tree_at(_widths, scene, [shrink * width for width in _widths(scene)])
            ours = simulate_ours(scene, times)
            what = f"friction {friction}, widths times {shrink:g}"
            yield from _two_ends(what, "normal_force", ours, theirs, CVODE, times, limits)
