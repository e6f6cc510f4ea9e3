"""Cases compared instant by instant: each yields comparisons of ours with other programs."""

from collections.abc import Iterator

import equinox as eqx
import numpy as np

import jaxcrusher as jc
from benchmarks import comparison
from benchmarks.comparison import Comparison
from benchmarks.crosschecks.programs import (
    ANGLES,
    CONTACT_POINT,
    CVODE,
    DOP853,
    EXUDYN,
    FORMULATIONS,
    GROWTH,
    LEVELS,
    NINE,
    OURS,
    REACTIONS,
    at_middle_of_overlap,
    growth,
    our_scene,
    simulate_ours,
    simulate_theirs,
    timed,
)
from benchmarks.peers import motion, nine_coordinates
from benchmarks.peers.equations import Crusher
from benchmarks.peers.exudyn_peer import Model
from benchmarks.peers.motion import Motion
from jaxcrusher.mechanism.drives import GivenTorque


def instants(count: int = 40) -> Iterator[Comparison]:
    """Compare forces at random states in contact, in one instant: no integration."""
    crusher, random = Crusher(friction=0.1), np.random.default_rng(0)
    depths, angles = 10 ** random.uniform(-2, 0.5, count), random.uniform(0, 2 * np.pi, count)
    eccentricities = (1 + depths) * crusher.clearance * np.exp(1j * angles)
    # The centres' speed takes the slip through the ramp of friction, to either side of zero.
    rates = random.uniform(-5, 5, count) + 1j * random.uniform(-5, 5, count)
    by_program = {ANGLES: [], NINE: []}
    for e, rate in zip(eccentricities, rates, strict=True):
        start = Motion(crusher, e=complex(e), rate=complex(rate))
        by_program[ANGLES].append(start.observe([0.0], [start.start]))
        states, _ = nine_coordinates.start(start)
        by_program[NINE].append(nine_coordinates.observe(crusher, [0.0], [states]))
    for formulation in FORMULATIONS:
        ours = [
            simulate_ours(our_scene(crusher, formulation, complex(e), complex(v)), [0.0])
            for e, v in zip(eccentricities, rates, strict=True)
        ]
        for program, theirs in by_program.items():
            for name in (*REACTIONS, "normal_force", "friction_force"):
                mine, other = (np.concatenate([h[name] for h in hs]) for hs in (ours, theirs))
                # Each state counts against its own force, not against the largest.
                size = abs(other).max(axis=tuple(range(1, other.ndim)), keepdims=True)
                worst = float((abs(mine - other) / (size + 1.0)).max())
                yield Comparison(
                    f"{name.replace('_', ' ')}, {count} states ({formulation})",
                    abs(mine).max(),
                    abs(other).max(),
                    program,
                    worst,
                    1e-7,
                    "smoothed |e|",
                )


def ideal(speeds=(25.0, 30.0, 35.0, 40.0), exudyn_steps: int = 4000) -> Iterator[Comparison]:
    """Compare the ideal joint over a turn."""
    for speed in speeds:
        crusher, count = Crusher(speed=speed), 2000
        times = np.arange(count + 1) * 2 * np.pi / speed / count
        with timed(ANGLES):
            theirs = motion.ideal(crusher, times)
        with timed(OURS):
            ours = jc.statistics(jc.ideal_scene(speed), 0, 1)
        force = theirs["foundation_force"][:-1]
        top = int(np.argmax(force))
        fit = np.polyfit([-1, 0, 1], np.take(force, [top - 1, top, top + 1], mode="wrap"), 2)
        known = {
            "mean": (ours.foundation_mean, force.mean(), 1e-8, "quadrature"),
            "RMS": (ours.foundation_rms, np.sqrt((force**2).mean()), 1e-8, "quadrature"),
            "peak": (ours.foundation_peak, fit[2] - fit[1] ** 2 / (4 * fit[0]), 1e-7, "parabola"),
        }
        for name, (mine, other, limit, reason) in known.items():
            label = f"{name} of |R_O| + |R_C|, {speed:g} rad/s, N"
            yield comparison.numbers(label, mine, other, ANGLES, limit, reason)
        ours = simulate_ours(jc.ideal_scene(speed), times)
        for name in REACTIONS:
            label = f"{name.replace('_', ' ')}, {speed:g} rad/s"
            yield comparison.histories(label, ours[name], theirs[name], ANGLES, 1e-10, "algebra")
        with timed(EXUDYN):
            step = times[-1] / exudyn_steps
            theirs = Model(Motion(crusher), ideal=True).run(times[-1], step, times[1])
        for name in ("bearing_reaction", "toggle_reaction", "drive_torque", "foundation_force"):
            label = f"{name.replace('_', ' ')}, {speed:g} rad/s"
            mine, other = (of[name][count // 20 :] for of in (ours, theirs))
            yield comparison.histories(label, mine, other, EXUDYN, 6e-5, "second order")


def torque(
    frictions=(None, 0.1), peers=(DOP853, CVODE, EXUDYN), formulations=FORMULATIONS
) -> Iterator[Comparison]:
    """Compare a free shaft under 300 N m from 30 rad/s: its gain of speed over 20 ms."""
    times = 1e-5 * np.arange(2001)
    for friction in frictions:
        crusher = Crusher(friction=friction)
        grown = growth(crusher, times, 300.0)["speed_gain"][-1]
        _, moved = at_middle_of_overlap(crusher, times, 300.0)
        theirs = {name: simulate_theirs(name, Motion(crusher, 300.0), times) for name in peers}
        for formulation in formulations:
            drive = GivenTorque(300.0, crusher.speed)
            scene = eqx.tree_at(lambda s: s.drive, our_scene(crusher, formulation), drive)
            ours = simulate_ours(scene, times)
            for program, other in theirs.items():
                limit = max(LEVELS[formulation], LEVELS[program]) * grown
                reason = GROWTH
                if program == EXUDYN and friction is not None:
                    limit, reason = limit + moved["speed_gain"][-1], CONTACT_POINT
                label = "no friction" if friction is None else f"friction {friction:g}"
                yield comparison.histories(
                    f"gain of shaft speed in 20 ms, rad/s ({label}, {formulation})",
                    ours["speed_gain"],
                    other["speed_gain"],
                    program,
                    limit,
                    reason,
                )
