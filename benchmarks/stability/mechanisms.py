"""Slider-cranks, four-bars and crushers drawn at random, beside free bodies by numba and SciPy."""

import cmath
import math
import random
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import jaxcrusher as jc
from benchmarks.narrow import narrow
from benchmarks.peers import scipy_peer
from benchmarks.peers.any_linkage import AnyLinkage
from benchmarks.stability import drawn_run
from benchmarks.stability.judgement import AGREES, DISAGREES, REFUSED
from jaxcrusher.batch.engines import stack
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.section import fine
from jaxcrusher.motion.simulation import Trajectory
from jaxcrusher.scenes.linkages import LinkageStructure
from jaxcrusher.scenes.machine import Machine

SPAN = 0.03  # s
TIMES = np.linspace(0, SPAN, drawn_run.INSTANTS)
# Of positions of some 0.3 m: 1e-13 of them is 3e-10 clearances.
FINE, FELLOW = 1e-13, 1e-12
# Of the ledger's largest work: RTOL a step, over some thousand steps.
LEDGER = 1e-6


@dataclass(frozen=True)
class Family:
    """Mechanisms of one structure: a slider at the end or a rocker, what is loose, supports."""

    end: str  # "slider", "rocker"
    loose: str  # of O, A, B and D
    supports: bool = False
    slip: str = "surface"
    side: int = 1  # of the assembly: one structure is one program

    @property
    def name(self) -> str:
        """Return it in words."""
        kind = "slider-crank" if self.end == "slider" else "four-bar"
        return f"{kind}, {', '.join(self.loose)}{' on supports' if self.supports else ''}"


FAMILIES = (
    Family("slider", "B"),
    Family("slider", "AB", slip="centre", side=-1),
    Family("slider", "OAB", supports=True),
    Family("slider", "A", supports=True, side=-1),
    Family("rocker", "B", slip="centre"),
    Family("rocker", "AD", supports=True, side=-1),
    Family("rocker", "ABD"),
    Family("rocker", "OABD", side=-1),
)


@dataclass(frozen=True)
class Drawn:
    """A mechanism, and the angles of its bodies at the crank's angle 0."""

    machine: Machine
    angles: np.ndarray

    def peer(self, e: dict[str, complex]) -> AnyLinkage:
        """Return its motion by free bodies from e (m)."""
        d, values = self.machine.structure, self.machine.values
        assert isinstance(d, LinkageStructure)
        pushed = tuple((name, body, False) for name, body, _ in d.forces)
        return AnyLinkage(values, d.bodies, d.joints, d.slides, pushed, self.angles, e)


def mechanism(family: Family, seed: str) -> Drawn:
    """Draw one as it stands at the crank's angle 0; ValueError if it does not go round."""
    chance = random.Random(f"{seed} {family.name}")

    def between(low: float, high: float) -> float:
        return math.exp(chance.uniform(math.log(low), math.log(high)))

    def anywhere(size: float) -> complex:
        return complex(chance.uniform(-size, size), chance.uniform(-size, size))

    crank = between(0.02, 0.2)
    size, side = crank * between(2.5, 6), family.side
    a = crank + (o := anywhere(size))
    last: dict[str, Any] = {}
    if family.end == "rocker":
        base, rocker = size * between(0.7, 1.4), size * between(0.7, 1.4)
        d = o + cmath.rect(base, chance.uniform(-math.pi, math.pi))
        span = d - a
        share = (abs(span) ** 2 + size**2 - rocker**2) / (2 * abs(span) ** 2)
        rise = (size / abs(span)) ** 2 - share**2
        b = a + span * complex(share, side * math.sqrt(max(rise, 0.0)))
        last = {"D": ("frame", d, "rocker")}
    else:
        ahead = cmath.rect(1.0, chance.uniform(-math.pi, math.pi))
        through = o + 0.3 * crank * chance.uniform(-1, 1) * 1j * ahead
        on_slider = anywhere(0.2 * size)
        foot = (((a - through - on_slider) / ahead).real) * ahead + through + on_slider
        rest = size**2 - abs(a - foot) ** 2
        b = foot + side * math.sqrt(max(rest, 0.0)) * ahead
    places = {"crank": (o, a), "coupler": (a, b), family.end: (b, last["D"][1] if last else b)}
    joints = {
        "O": ("frame", o, "crank"),
        "A": ("coupler", a, "crank"),
        "B": ("coupler", b, family.end),
    }
    joints |= last
    # Each body's axes are anywhere on it, but the crank's angle is 0 and a slider does not turn.
    axes = {"frame": (0j, 1 + 0j)}
    for body, (begin, _) in places.items():
        turn = (
            cmath.rect(1.0, chance.uniform(-math.pi, math.pi))
            if body in ("coupler", "rocker")
            else 1
        )
        axes[body] = begin + anywhere(0.3 * size), complex(turn)
    if family.end == "slider":
        axes["slider"] = b - on_slider, 1 + 0j

    def at(body: str, place: complex) -> list[float]:
        origin, turn = axes[body]
        arm = (place - origin) / turn
        return [arm.real, arm.imag]

    of: dict[str, Any] = {"crank": "crank", "start": "centred", "bodies": {}, "joints": {}}
    of["speed"] = math.sqrt(between(2, 60) / crank)
    of["gravity"] = chance.uniform(0.1, 9.81)
    for body, (begin, end) in places.items():
        mass = between(0.3, 30) * size
        of["bodies"][body] = {
            "mass": mass,
            "inertia": mass * (size * between(0.1, 0.6)) ** 2,
            "mass_centre": at(body, (begin + end) / 2 + anywhere(0.2 * size)),
        }
    weight = sum(one["mass"] for one in of["bodies"].values()) * 9.81
    for name, (bore, place, pin) in joints.items():
        joint: dict[str, Any] = {"bore": [bore, *at(bore, place)], "pin": [pin, *at(pin, place)]}
        if name in family.loose:
            radius = size * between(0.02, 0.1)
            joint |= {
                "clearance": radius * between(3e-4, 2e-2),
                "bore_radius": radius,
                "young": between(2e10, 3e11),
                "poisson": chance.uniform(0.2, 0.4),
                "restitution": chance.uniform(0.3, 0.95),
                "impact_velocity": between(0.1, 2),
                "friction": chance.uniform(0.01, 0.2),
                "slip": family.slip,
            }
        of["joints"][name] = joint
    push = weight * between(0.1, 10) * cmath.rect(1.0, chance.uniform(-math.pi, math.pi))
    where = at(family.end, b + anywhere(0.2 * size))
    of["forces"] = {"push": {"body": family.end, "at": where, "force": [push.real, push.imag]}}
    if family.end == "slider":
        way = {"along": [ahead.real, ahead.imag], "through": [through.real, through.imag]}
        of["slides"] = {"guide": {"body": "slider", **way}}
    if family.supports:
        block = weight / 9.81 * between(1, 30)
        stiffness = block * between(20, 400) ** 2
        centre, wide = o + anywhere(size), size * between(0.5, 2)
        of["foundation"] = {
            "mass": block,
            "inertia": block * (size * between(0.3, 1)) ** 2,
            "x": centre.real,
            "y": centre.imag,
            "left": centre.real - wide * between(0.5, 1),
            "right": centre.real + wide,
            "base": centre.imag - size * chance.random(),
            "horizontal_stiffness": stiffness,
            "vertical_stiffness": stiffness * between(0.5, 3),
            "horizontal_damping": block * chance.uniform(0, 100),
            "vertical_damping": block * chance.uniform(0, 100),
        }
    of["assembly"] = {"coupler": side}
    read = jc.linkage_machine(**of)
    angles = np.array([cmath.phase(axes[body][1]) for body in of["bodies"]])
    return Drawn(read, angles)


def by_peer(one: Drawn, e: dict[str, complex], rtol: float) -> Trajectory:
    """Integrate the free bodies by SciPy, stopped where pins touch their bores or part."""
    motion = one.peer(e)
    seen = motion.observe(TIMES, scipy_peer.integrate(motion, TIMES, rtol=rtol))
    return Trajectory(jnp.asarray(TIMES), fine(), jax.tree.map(jnp.asarray, seen))


def motion(scene: Scene, names: tuple[str, ...], rtol: float) -> Trajectory:
    """Return 30 ms of a motion, and its ledger."""
    method = jc.Method(max_steps=drawn_run.MOST_STEPS)
    return jc.simulate(scene, TIMES, outputs=(*names, "energy"), rtol=rtol, method=method)


def compared(family: Family, seed: int, count: int) -> Iterator[drawn_run.Row]:
    """Yield the verdict on each drawn mechanism of a family, by lanes in both formulations."""
    made: dict[int, Drawn] = {}
    for i in range(count):
        try:
            made[i] = mechanism(family, f"{seed} {i}")
        except ValueError as error:
            yield drawn_run.Row(family.name, i, REFUSED, remark=str(error))
    known = {}
    for i, one in list(made.items()):
        size = {joint: one.machine.number(f"joints.{joint}.clearance") for joint in family.loose}
        moved = [
            {joint: way * drawn_run.OFFSET * c for joint, c in size.items()} for way in (1, 1j)
        ]
        starts = (({}, FINE), ({}, FELLOW), *((e, FINE) for e in moved))
        try:
            known[i] = [by_peer(one, *start) for start in starts]
        except RuntimeError as error:
            del made[i]
            yield drawn_run.Row(family.name, i, drawn_run.UNKNOWN, remark=str(error))
    names = tuple(next(iter(known.values()))[0].values)
    for formulation in ("eccentricity", "multiplier"):
        group = [one.machine.scene(formulation=formulation) for one in made.values()]
        how = eqx.Partial(motion, names=names)
        ours = jc.map_all(eqx.Partial(how, rtol=drawn_run.RTOL), stack(group))
        for place, i in enumerate(made):
            found = jax.tree.map(lambda leaf, at=place: np.asarray(leaf[at]), ours)
            ledger = found.values.pop("energy")
            theirs, fellow, *near = known[i]
            row = drawn_run.judged(
                f"{family.name}, {formulation}", i, found, theirs, fellow, [theirs, *near]
            )
            works = (ledger.drive_work, ledger.contact_loss, ledger.load_work, ledger.kinetic)
            off = abs(ledger.imbalance).max() / max(abs(work).max() for work in works)
            if row.verdict == AGREES and not off <= LEDGER:
                row = replace(row, verdict=DISAGREES, remark=f"the ledger is off by {off:.1e}")
            if row.verdict == DISAGREES:
                sharp = stack([narrow(group[place])])
                sharp = jc.map_all(eqx.Partial(how, rtol=FELLOW), sharp)
                found = jax.tree.map(lambda leaf: np.asarray(leaf[0]), sharp)
                found.values.pop("energy")
                again = drawn_run.judged(row.kind, i, found, theirs, fellow, [theirs, *near])
                row = replace(row, verdict=drawn_run.SMOOTHED) if again.verdict == AGREES else row
            yield row


def run_mechanisms(out: Path, seed: int, count: int) -> None:
    """Judge drawn mechanisms, as many of each family; write stability_mechanisms.csv."""
    each, file = count // len(FAMILIES), "stability_mechanisms.csv"
    drawn_run.run_kinds(out, file, FAMILIES, lambda family: compared(family, seed, each))
