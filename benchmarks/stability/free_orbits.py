"""A periodic orbit, integrated round its period as free bodies by SciPy."""

from dataclasses import replace

import numpy as np

from benchmarks.peers import scipy_peer
from benchmarks.peers.any_linkage import AnyLinkage, instant
from jaxcrusher.crusher.machine import LETTERS
from jaxcrusher.mechanism.state import frame_units
from jaxcrusher.motion.flow import unflattened
from jaxcrusher.orbits.result import PeriodicOrbit

# A turn, of the shaking force: its RMS is known to 1e-7 where pins bounce, and by 1024 to 5e-4.
SAMPLES = 16384
PATIENCE = 300.0  # seconds of the processor that SciPy has


def on_orbit(orbit: PeriodicOrbit, peer: AnyLinkage) -> AnyLinkage:
    """Return the free bodies as they stand and move where the orbit begins."""
    scene = orbit.scene
    state = unflattened(orbit.section, scene)
    assert state is not None
    parts = state.parts
    e, rates, frame = {}, {}, None
    for name, joint in scene.joints.items():
        at, rate = parts.eccentricities.at(name), parts.rates.at(name)
        part, letter = float(joint.clearance) * at, LETTERS.get(name, name)
        e[letter], rates[letter] = complex(part.x, part.y), complex(rate.x, rate.y)
    if parts.frame is not None:
        moved = frame_units(scene).motion(parts.frame)
        place, velocity = moved.displacement, moved.velocity
        six = (place.x, place.y, moved.rotation, velocity.x, velocity.y, moved.spin)
        frame = np.array([float(number) for number in six])
    return replace(peer, e=e, rates=rates, frame=frame)


def by_free_bodies(orbit: PeriodicOrbit, peer: AnyLinkage) -> tuple[float, float]:
    """Return by how much state and RMS of the shaking force differ after one period.

    Each e is counted in the clearance of its joint, what is no loose joint's in the smallest; rates
    in m/s and rad/s.
    """
    peer, speed = on_orbit(orbit, peer), float(orbit.scene.drive.speed)
    span = orbit.period * 2 * np.pi / speed
    times = np.linspace(0, span, SAMPLES * orbit.period + 1)
    states = scipy_peer.integrate(peer, times, seconds=PATIENCE)
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
