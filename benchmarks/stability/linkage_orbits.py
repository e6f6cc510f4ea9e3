"""Periodic orbits of drawn linkages, each integrated round its period as free bodies by SciPy."""

from dataclasses import replace
from pathlib import Path

import jax
import numpy as np

from benchmarks.peers import scipy_peer
from benchmarks.peers.any_linkage import AnyLinkage, instant
from benchmarks.stability.drawn_orbits import VERDICTS, Row, judged
from benchmarks.stability.drawn_run import run_kinds
from benchmarks.stability.mechanisms import FAMILIES, Drawn, Family, mechanism
from jaxcrusher.mechanism.frame import frame_units
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.orbits.result import PeriodicOrbit

SAMPLES = 1024  # a turn, of the shaking force
SLOW = 0.3  # every other mechanism turns at this share of the drawn speed, to keep contact


def on_orbit(orbit: PeriodicOrbit, drawn: Drawn) -> AnyLinkage:
    """Return the free bodies as they stand and move where the orbit begins."""
    scene = orbit.scene
    state = jax.tree.structure(scene.formulation.initial(scene))
    at = jax.tree.unflatten(state, np.asarray(orbit.section))
    e, rates, frame = {}, {}, None
    for name, joint in scene.joints.items():
        of = at.joints.at(name)
        part = float(joint.clearance) * of.relative_eccentricity
        e[name], rates[name] = complex(part.x, part.y), complex(of.rate.x, of.rate.y)
    if at.frame is not None:
        moved = frame_units(scene).motion(at.frame)
        place, velocity = moved.displacement, moved.velocity
        six = (place.x, place.y, moved.rotation, velocity.x, velocity.y, moved.spin)
        frame = np.array([float(number) for number in six])
    return replace(drawn.peer(e), rates=rates, frame=frame)


def by_free_bodies(orbit: PeriodicOrbit, drawn: Drawn) -> tuple[float, float]:
    """Return by how much state and RMS of the shaking force differ after one period.

    Each e is counted in the clearance of its joint, what is no loose joint's in the smallest; rates
    in m/s and rad/s.
    """
    peer, speed = on_orbit(orbit, drawn), float(orbit.scene.drive.speed)
    span = orbit.period * 2 * np.pi / speed
    times = np.linspace(0, span, SAMPLES * orbit.period + 1)
    states = scipy_peer.integrate(peer, times)
    change = abs(peer.relative(states[-1]) - peer.relative(states[0]))
    half, clearances = len(change) // 2, peer.numbers[5][:, 0]
    least = clearances[clearances > 0].min()
    change[: 2 * len(clearances)] /= np.repeat(np.where(clearances > 0, clearances, least), 2)
    change[2 * len(clearances) : half] /= least
    rates = [instant(t, y, peer.numbers)[0] for t, y in zip(times[1:], states[1:], strict=True)]
    bodies = np.array(rates).reshape(len(rates), -1, 3)[:, 1:, :2]
    shaken = np.einsum("tbi,b->ti", bodies, peer.numbers[2][1:, 0])
    rms = np.sqrt((shaken**2).sum(axis=1).mean())
    return float(change.max()), abs(float(rms / orbit["shaking_rms"]) - 1)


def run_linkage_orbits(out: Path, seed: int, count: int) -> None:
    """Judge drawn orbits of linkages, as many of each family; print a table."""

    def drawn(family: Family, i: int) -> Drawn:
        found = mechanism(family, f"{seed} {i}")
        slow = {"speed": SLOW * found.values["speed"]} if i % 2 else {}
        return replace(found, values=found.values | slow)

    def row(family: Family, i: int) -> Row:
        def make() -> AbstractScene:
            found = drawn(family, i)
            return found.drawing(**found.values)

        return judged(family.name, i, make, lambda orbit: by_free_bodies(orbit, drawn(family, i)))

    each, file = range(count // len(FAMILIES)), "stability_linkage_orbits.csv"
    run_kinds(out, file, FAMILIES, lambda family: (row(family, i) for i in each), VERDICTS)
