"""Clearance in O, A, B and C: the first 10 ms, beside free bodies in SciPy and EXUDYN."""

from collections.abc import Iterator, Mapping

import numpy as np

import jaxcrusher as jc
from benchmarks import comparison
from benchmarks.comparison import Comparison
from benchmarks.crosschecks import programs
from benchmarks.crosschecks.programs import DOP853, EXUDYN, FORMULATIONS, OURS, timed
from benchmarks.narrow import narrow
from benchmarks.peers import crusher_bodies, scipy_peer
from benchmarks.peers.crusher_bodies import PREFIXES, crusher
from benchmarks.peers.exudyn_free_bodies import Model
from benchmarks.peers.parting import parted
from jaxcrusher.scenes.parameters import PE250X400

TIMES = 1e-5 * np.arange(1001)
CLEARANCES = {"A": 6e-5, "B": 1e-4, "C": 8e-5, "O": 7e-5}
FORCES = ("joint_force", "elbow_reaction", "toggle_reaction", "bearing_reaction")
OFFSET = 1e-7  # clearances
# EXUDYN's step (s), and its error of a contact's phase: the toggle, 13 kg at its end, swings on a
# seat of 4e9 N/m at 3 kHz.
STEP = 5e-7
LEVELS = programs.LEVELS | {EXUDYN: (2 * np.pi * 3e3 * STEP) ** 2 / 12}
# One number of a seat at a time, of B and of C, with A, B and C loose.
EXTREMES = {"clearance": (1e-6, 5e-4), "young": (2.07e13,), "friction": (1.0,)}


def described(loose: str, **changes: float | str) -> dict[str, float | str]:
    """Return a crusher with these joints loose, friction 0.1 by the slip of the surfaces."""
    numbers = PE250X400 | {"slip": "surface", "friction": 0.1}
    if "A" not in loose:
        numbers["joint"] = "ideal"
    for joint in loose.replace("A", ""):
        of_joint = {"clearance": CLEARANCES[joint], "slip": "surface", "friction": 0.1}
        numbers |= {PREFIXES[joint] + name: value for name, value in of_joint.items()}
    return numbers | changes


def loose() -> Iterator[Comparison]:
    """Compare sets of loose joints, then one extreme number of a seat at a time."""
    for joints in ("ABCO", "O", "ABC", "AC", "B"):
        yield from against(", ".join(joints), joints, described(joints), FORMULATIONS)
    for joint in "BC":
        for name, values in EXTREMES.items():
            for value in values:
                key = PREFIXES[joint] + name
                numbers = described("ABC", **{key: value})
                yield from against(f"{key} {value:g}", "ABC", numbers, FORMULATIONS[:1])
    smooth = described("ABC", **{PREFIXES[j] + "friction": 0.0 for j in "ABC"})
    yield from against("A, B, C, no friction", "ABC", smooth, FORMULATIONS[:1], EXUDYN)


def against(
    label: str, joints: str, numbers: Mapping[str, float | str], formulations, program: str = DOP853
) -> Iterator[Comparison]:
    """Compare ours with free bodies: eccentricities, and forces in every joint."""
    clearances = {j: float(numbers[PREFIXES[j] + "clearance"]) for j in joints}
    still = moved(numbers, {})
    grown = parted(
        still,
        [moved(numbers, {j: OFFSET * way * c for j, c in clearances.items()}) for way in (1, 1j)],
    )
    theirs, contacts = still, sum(_contacts(still[PREFIXES[j] + "normal_force"]) for j in joints)
    if program == EXUDYN:
        with timed(EXUDYN):
            theirs = Model(crusher(numbers)).run(TIMES[-1], step=STEP, every=TIMES[1])
    for formulation in formulations:
        ours = simulated(dict(numbers) | {"formulation": formulation}, joints)
        level = max(LEVELS[formulation], LEVELS[program])
        for name in (*(PREFIXES[j] + "eccentricity" for j in joints), *FORCES):
            yield comparison.histories(
                f"{label}, {formulation}: {name}",
                ours[name.replace(".", "_")],
                theirs[name],
                program,
                level * (1 + contacts) * (1 + grown[name][-1] / OFFSET),
                "growth of free bodies",
            )


def _contacts(force: np.ndarray) -> int:
    """Count how often pin and bore meet."""
    return int(np.sum((force[1:] > 0) & (force[:-1] <= 0)))


def simulated(values: Mapping[str, float | str], joints: str) -> dict[str, np.ndarray]:
    """Return our histories by name."""
    names = [f"{PREFIXES[j]}eccentricity".replace(".", "_") for j in joints]
    with timed(OURS):
        found = jc.simulate(narrow(jc.build_scene(values)), TIMES, outputs=(*names, *FORCES))
        if not found.success:
            raise RuntimeError(f"jaxcrusher {found.failure}")
        return {name: np.asarray(found[name]) for name in (*names, *FORCES)}


def moved(numbers: Mapping[str, float | str], e: dict[str, complex]) -> dict[str, np.ndarray]:
    """Return histories of free bodies from eccentricities `e` (m)."""
    bodies = crusher(numbers, e)
    with timed(DOP853):
        states = scipy_peer.integrate(bodies, TIMES, rtol=1e-13)
        return crusher_bodies.observe(bodies, TIMES, states)
