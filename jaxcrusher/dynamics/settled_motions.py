"""The stable motions that a crusher comes to from many starts, and how many come to each."""

from collections import Counter
from dataclasses import dataclass

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxcrusher.basics.checks import require, require_positive, require_whole
from jaxcrusher.basics.plane import Vector
from jaxcrusher.batch.engines import map_all, stack
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.crusher.starts import shifted_start
from jaxcrusher.motion.flow import flat
from jaxcrusher.motion.section import poincare_section
from jaxcrusher.settled.periodic_orbit import periodic_orbit
from jaxcrusher.settled.result import PeriodicOrbit
from jaxcrusher.settled.shooting import shoot

# Turns that are looked at half-way and at the end: whole multiples of all periods searched for.
WINDOW, PERIODS = 24, (1, 2, 3, 4)
# Of section points in clearances: what repeats so well is shot for, and what is so near an orbit
# has come to it.
REPEATS, NEAR = 1e-2, 1e-2
# Two orbits whose RMS agrees so well, at the same period, are one.
SAME = 1e-6
RTOL = 1e-9


@dataclass(frozen=True)
class SettledMotions:
    """Stable orbits, the most frequent first, and the share of starts that comes to each.

    Shares and those of `unsettled`, by reason, add up to 1. An orbit solved for that no start
    came to has a share of 0. Shares are of these starts: another spread gives others.
    """

    orbits: tuple[PeriodicOrbit, ...]
    shares: tuple[float, ...]
    unsettled: dict[str, float]

    def __str__(self) -> str:
        """A line for each."""
        lines = [
            f"{share:.0%} period {orbit.period}: RMS {float(orbit.foundation_rms):.2f} N, "
            f"peak {float(orbit.foundation_peak):.0f} N, "
            f"least penetration {float(orbit.least_penetration):.2g} clearances, "
            f"settles in {float(orbit.settling_turns):.3g} turns"
            for orbit, share in zip(self.orbits, self.shares, strict=True)
        ]
        return "\n".join(lines + [f"{share:.0%} {why}" for why, share in self.unsettled.items()])


def settled_motions(
    scene: Scene, *, starts: int = 32, spread: float = 0.5, turns: int = 1000, seed: int = 0
) -> SettledMotions:
    """The stable motions that `starts` random starts come to, each solved for.

    The scene's start is shifted by up to `spread` clearances in any direction. Each motion is
    integrated over `turns` turns; where it then repeats after one to four of them, Newton's method
    takes it from there (`jaxcrusher.settled.shooting`), contact lost or not. A motion that still
    swings is counted with the orbit that it has come nearer to since half-way. The quiet motion,
    from the pin resting in its bore, is looked for besides.

    Raises ValueError for a count, spread or turns out of range, and in one line for a scene that
    `jaxcrusher.periodic_orbit` refuses or whose joint is ideal.
    """
    require_whole("starts", starts, 1)
    require_positive("spread", spread, "clearances")
    require_whole("turns", turns, 2 * WINDOW)
    require_whole("seed", seed, 0)
    require(scene.joint is not None, "scene", "have a clearance joint", "an ideal one")
    quiet = periodic_orbit(scene)
    orbits = [quiet] if bool(quiet.stable) else []
    random = np.random.default_rng(seed)
    radii, angles = spread * np.sqrt(random.uniform(size=starts)), random.uniform(size=starts)
    offsets = radii * np.exp(2j * np.pi * angles)
    shifted = stack([shifted_start(scene, Vector(z.real, z.imag)) for z in offsets])
    run = eqx.Partial(_run, half=turns // 2, rest=turns - turns // 2)
    half, end, success = map_all(run, shifted, starts)
    known = [_section(orbit) for orbit in orbits]
    counts: Counter[int] = Counter()
    swinging = []
    for first, last in zip(half[success], end[success], strict=True):
        near = _nearest(known, last)
        if near is not None and _distance(known[near], last) < NEAR:
            counts[near] += 1
        elif (new := _repeating(scene, last)) is not None:
            alike = [i for i, orbit in enumerate(orbits) if _same(orbit, new)]
            if not alike:
                orbits, known = [*orbits, new], [*known, _section(new)]
            counts[alike[0] if alike else len(orbits) - 1] += 1
        else:
            swinging.append((first, last))
    lost = 0
    for first, last in swinging:
        near = _nearest(known, last)
        if near is None or _distance(known[near], last) >= _distance(known[near], first):
            lost += 1
        else:
            counts[near] += 1
    order = sorted(range(len(orbits)), key=lambda i: -counts[i])
    reasons = {
        "failed to integrate": starts - int(success.sum()),
        f"come to no orbit of up to {PERIODS[-1]} turns after {turns}": lost,
    }
    return SettledMotions(
        tuple(orbits[i] for i in order),
        tuple(counts[i] / starts for i in order),
        {why: count / starts for why, count in reasons.items() if count},
    )


def _run(scene: Scene, *, half: int, rest: int) -> tuple[Array, Array, Bool[Array, ""]]:
    """Section points of the last turns before half-way, and before the end."""
    first = poincare_section(scene, half - WINDOW, WINDOW, rtol=RTOL)
    last = poincare_section(scene, rest - WINDOW, WINDOW, state=first.state, rtol=RTOL)
    return first.states, last.states, first.success & last.success


def _section(orbit: PeriodicOrbit) -> Float[np.ndarray, "period 2"]:
    """Where the pin is at the beginning of each turn, in clearances."""
    places = [flat(orbit.state(2 * np.pi * turn), orbit.scene) for turn in range(orbit.period)]
    return np.array(places)[:, :2]


def _distance(section: Float[np.ndarray, "p 2"], states: Float[np.ndarray, "n 4"]) -> float:
    """Of a motion from an orbit, RMS, in clearances; whichever turn of the orbit comes first."""
    period = len(section)
    shifts = [np.resize(np.roll(section, -k, axis=0), (len(states), 2)) for k in range(period)]
    return min(float(np.sqrt(np.mean((states[:, :2] - shift) ** 2))) for shift in shifts)


def _nearest(known: list[np.ndarray], states: np.ndarray) -> int | None:
    """The orbit that a motion is nearest to."""
    return min(range(len(known)), key=lambda i: _distance(known[i], states), default=None)


def _repeating(scene: Scene, states: Float[np.ndarray, "n 4"]) -> PeriodicOrbit | None:
    """The stable orbit that a motion repeats, with as few turns as it does."""
    for period in PERIODS:
        if np.max(np.abs(states[period:, :2] - states[:-period, :2])) < REPEATS:
            orbit = shoot(scene, states[-1], period)
            if bool(orbit.stable):
                return orbit
    return None


def _same(one: PeriodicOrbit, other: PeriodicOrbit) -> bool:
    apart = abs(float(one.foundation_rms) / float(other.foundation_rms) - 1)
    return one.period == other.period and apart < SAME
