"""The programs, each run in the same way: ours, and those that others wrote."""

import time
from collections import defaultdict
from contextlib import contextmanager
from dataclasses import replace
from typing import Literal

import equinox as eqx
import numpy as np

import jaxcrusher as jc
from benchmarks.peers import exudyn_peer, nine_coordinates, scipy_peer, sundials_peer
from benchmarks.peers.equations import Crusher
from benchmarks.peers.motion import Motion
from benchmarks.peers.parting import parted
from jaxcrusher.basics.plane import Vector
from jaxcrusher.mechanism.starts import Given

Formulation = Literal["eccentricity", "multiplier"]
FORMULATIONS: tuple[Formulation, ...] = ("eccentricity", "multiplier")
OURS = "jaxcrusher"
ANGLES, NINE = "NumPy, angles", "NumPy, nine coordinates"
DOP853, CVODE, IDA, EXUDYN = "SciPy DOP853", "SUNDIALS CVODE", "SUNDIALS IDA", "EXUDYN"
REACTIONS = ("bearing_reaction", "elbow_reaction", "toggle_reaction", "drive_torque")
FORCES = ("normal_force", "friction_force")
OBSERVED = (*REACTIONS, *FORCES, "eccentricity", "foundation_force", "shaft_speed")

# Errors at the first contact, in clearances: the tolerance of a step times a few thousand
# steps, for 0.06 mm.
LEVELS = {
    "eccentricity": 3e-8,  # 1e-11
    "multiplier": 1e-6,  # 2e-14 m, the rounding of positions of 0.6 m
    DOP853: 3e-8,
    CVODE: 3e-8,
    IDA: 1e-6,  # 1e-11 of 0.7 m: 1e-7 a step
    EXUDYN: 2e-6,  # (2 pi 740 Hz 1e-6 s)^2 / 12 of the phase of a contact
}
# Names of reasons, which crosschecks.md explains.
GROWTH, CONTACT_POINT = "growth", "growth, contact point"

seconds: dict[str, float] = defaultdict(float)


@contextmanager
def timed(program: str):
    """Add the time of this block to the program's `seconds`."""
    begin = time.perf_counter()
    yield
    seconds[program] += time.perf_counter() - begin


def our_scene(
    crusher: Crusher, formulation: Formulation = "eccentricity", e: complex = 0j, rate: complex = 0j
):
    """Return the scene of a peer's crusher, from eccentricity `e` (m) at `rate` (m/s)."""
    scene = jc.paper_scene(
        crusher.speed,
        crusher.clearance,
        slip="surface",
        friction=crusher.friction or 0.0,
        formulation=formulation,
    )
    relative = e / crusher.clearance
    start = Given(
        {"main": Vector(relative.real, relative.imag)}, {"main": Vector(rate.real, rate.imag)}
    )
    return eqx.tree_at(lambda s: s.start, scene, start)


def simulate_ours(scene, times) -> dict[str, np.ndarray]:
    """Return our histories by name."""
    with timed(OURS):
        found = jc.simulate(scene, times, outputs=OBSERVED)
        if not found.success:
            raise RuntimeError(f"jaxcrusher {found.failure}")
        known = {name: np.asarray(found[name]) for name in OBSERVED}
    known["contact_force"] = np.hypot(known["normal_force"], known["friction_force"])
    known["speed_gain"] = known["shaft_speed"] - float(scene.drive.speed)
    return known


def simulate_theirs(program: str, start: Motion, times) -> dict[str, np.ndarray]:
    """Return another program's histories by name, at evenly spaced `times` (s) from 0."""
    with timed(program):
        known = _run(program, start, times)
    if "shaft_speed" in known:
        known["speed_gain"] = known["shaft_speed"] - start.crusher.speed
    return known


def _run(program: str, start: Motion, times) -> dict[str, np.ndarray]:
    if program == DOP853:
        return start.observe(times, scipy_peer.integrate(start, times))
    if program == CVODE:
        return start.observe(times, sundials_peer.cvode(start, times))
    if program == IDA:
        return nine_coordinates.observe(start.crusher, times, sundials_peer.ida(start, times))
    if program == EXUDYN:
        return exudyn_peer.Model(start).run(times[-1], every=times[1])
    raise ValueError(f"Argument `program` must be one of {list(LEVELS)}, but is {program!r}.")


def growth(crusher: Crusher, times, torque: float | None = None) -> dict[str, np.ndarray]:
    """Return by quantity and time how far an offset start of one clearance would move it.

    It is the largest movement up to each time, relative to the largest value.
    """

    def run(e: complex) -> dict[str, np.ndarray]:
        return simulate_theirs(CVODE, Motion(crusher, torque, e * crusher.clearance), times)

    still, offset = run(0j), 1e-7
    moved = [run(e) for e in (offset + 0j, offset * 1j)]
    return {name: share / offset for name, share in parted(still, moved).items()}


def at_middle_of_overlap(crusher: Crusher, times, torque=None) -> tuple[dict, dict]:
    """Return CVODE's motion with EXUDYN's point of contact, and how far that moves each quantity.

    EXUDYN lets friction act in the middle of the overlap, ours on the bore's surface.
    """
    here, there = (
        simulate_theirs(CVODE, Motion(replace(crusher, overlap=o), torque), times)
        for o in (0.0, 0.5)
    )
    return there, parted(here, [there])
