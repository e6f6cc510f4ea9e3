"""The scenes, and the answers of independent programs at their tightest tolerances."""

from dataclasses import dataclass, replace
from functools import cache

import equinox as eqx
import jax
import numpy as np
from typing_extensions import override

import jaxcrusher as jc
from benchmarks.peers import motion, scipy_peer, sundials_peer
from benchmarks.peers.equations import Chain, Crusher, Shaft
from benchmarks.peers.motion import Motion
from jaxcrusher.basics.plane import Vector, scalar
from jaxcrusher.mechanism.starts import Given, InContact

SAVES = 256  # instants of a force history
TURN = 2 * np.pi
FORCE = 1e4  # N, the unit of the square that the reference integrates
MANY = (4096, 2048)  # instants of a turn for the mean of the ideal joint's reference
# At this start of the whirl it is established: turns from the centred start.
WHIRL_TURNS = 4


@dataclass(frozen=True)
class Case:
    """A crusher from e = `relative` c and e' = `rate` (m/s), over `span` (rad of the shaft).

    The start stays the same in clearances when the clearance changes: that is the slope meant.
    """

    name: str
    about: str
    crusher: Crusher
    span: float
    relative: complex = 0j
    rate: complex = 0j
    ideal: bool = False
    relative_step: float = 1e-4  # of the differences that give the slope's reference

    @property
    def parameter(self) -> str:
        """The number that the RMS is differentiated by."""
        return "speed" if self.ideal else "clearance"

    @property
    def angles(self) -> np.ndarray:
        """The shaft angles (rad) of the history."""
        return self.span / SAVES * np.arange(1, SAVES + 1)

    def changed(self, value: float) -> "Case":
        """Return the case with another value of its parameter."""
        return replace(self, crusher=replace(self.crusher, **{self.parameter: value}))

    def motion(self) -> "Squared":
        """Return the motion of the peers in plain Python."""
        c = self.crusher
        return Squared(c, e=self.relative * c.clearance, rate=self.rate)

    def scene(self, formulation: str) -> jc.Scene:
        """Return our scene; one program serves all with clearance, which have one structure."""
        c = self.crusher
        if self.ideal:
            return jc.ideal_scene(c.speed)
        scene = jc.paper_scene(c.speed, c.clearance, slip="surface", formulation=formulation)
        start = Given(
            {"main": Vector(self.relative.real, self.relative.imag)},
            {"main": Vector(self.rate.real, self.rate.imag)},
        )
        return eqx.tree_at(
            lambda s: (s.start, s.joints.at("main").friction.coefficient),
            scene,
            (start, scalar(c.friction)),
        )


class Squared(Motion):
    """A motion that integrates (|R_O| + |R_C|)^2 / FORCE^2 as its last number."""

    def __init__(self, crusher: Crusher, e: complex, rate: complex):
        """Start at eccentricity `e` (m) and its `rate` (m/s)."""
        super().__init__(crusher, e=e, rate=rate)
        self.start = np.append(self.start, 0.0)

    @override
    def field(self, time: float, y) -> list[float]:
        (force,) = self.observe([time], [y])["foundation_force"]
        return [*super().field(time, y[:4]), (force / FORCE) ** 2]

    @override
    def corners(self, time: float, y) -> list[float]:
        """Do as `Motion`, without the last number."""
        return super().corners(time, y[:4])

    @override
    def observe(self, times, states) -> dict[str, np.ndarray]:
        """Do as `Motion`, without the last number."""
        return super().observe(times, [y[:4] for y in states])


@dataclass(frozen=True)
class Answer:
    """RMS (N) and history (N) of |R_O| + |R_C| over the case's span."""

    rms: float
    history: np.ndarray


@dataclass(frozen=True)
class Reference:
    """The answer, the slope of the RMS (N per unit of the parameter), and their own errors."""

    answer: Answer
    slope: float
    rms_error: float  # relative
    history_error: float  # largest, over the largest force
    slope_error: float  # relative


def centred(friction: float = 0.0) -> Crusher:
    """Return the crusher of 30 rad/s and 0.06 mm."""
    return Crusher(friction=friction)


@cache
def cases() -> dict[str, Case]:
    """Return the cases by name."""
    quiet = centred(0.1)
    scene = jc.paper_scene(quiet.speed, quiet.clearance, slip="surface")
    e, rate = (play["main"] for play in jax.jit(InContact().eccentricities)(scene))
    assert e is not None and rate is not None
    relative = complex(e.x, e.y) / quiet.clearance
    whirl_e, whirl_rate = _after_turns(quiet, WHIRL_TURNS)
    found = [
        Case(
            "quiet",
            "contact start, friction 0.1, two turns",
            quiet,
            2 * TURN,
            relative,
            complex(rate.x, rate.y),
            relative_step=3e-5,
        ),
        Case("impacting", "centred start, no friction, 30 ms", centred(), 0.9),
        Case(
            "whirl",
            f"friction 0.1, 10 ms from the motion {WHIRL_TURNS} turns after a centred "
            "start, when the whirl is established",
            quiet,
            0.3,
            whirl_e / quiet.clearance,
            whirl_rate,
            relative_step=1e-3,
        ),
        Case("ideal joint", "one turn", Crusher(), TURN, ideal=True),
    ]
    return {case.name: case for case in found}


def _after_turns(crusher: Crusher, turns: int) -> tuple[complex, complex]:
    """Eccentricity (m) and its rate (m/s) of the centred start's motion after whole turns."""
    end = TURN * turns / crusher.speed
    y = sundials_peer.cvode(Motion(crusher), [0.0, end], rtol=1e-9)[-1]
    shaft, chain = Shaft(crusher, 0.0, crusher.speed), Chain(crusher, y[:2], y[2:])
    return shaft.pin - chain.a, shaft.pin_velocity - chain.velocity_a


def solved(case: Case, program, rtol: float) -> Answer:
    """Solve by `scipy_peer.integrate` or `sundials_peer.cvode`, which share their arguments."""
    started = case.motion()
    times = np.append(0.0, case.angles / case.crusher.speed)
    states = program(started, times, rtol=rtol)
    force = started.observe(times[1:], states[1:])["foundation_force"]
    return Answer(FORCE * np.sqrt(states[-1][-1] / times[-1]), force)


def closed_form(case: Case, count: int = SAVES) -> Answer:
    """Solve the ideal joint; the mean over a turn is that over `count` equal steps."""
    angles = case.span / count * np.arange(1, count + 1)
    force = motion.ideal(case.crusher, angles / case.crusher.speed)["foundation_force"]
    return Answer(np.sqrt(np.mean(force**2)), force)


def differences(answer: Answer, exact: Answer) -> tuple[float, float]:
    """Return relative errors of the RMS and of the history."""
    rms = abs(answer.rms / exact.rms - 1)
    return rms, float(abs(answer.history - exact.history).max() / abs(exact.history).max())


def reference(case: Case) -> Reference:
    """Solve by DOP853 stopped at every touch, at 1e-12 (closed form for the ideal joint).

    Its error is the difference of CVODE at 1e-12 (of half as many instants); that of the slope, by
    central differences and Richardson's extrapolation, is what the extrapolation changed, and
    that error of the RMS over the step.
    """
    if case.ideal:
        history = closed_form(case).history
        answer, other = (Answer(closed_form(case, n).rms, history) for n in MANY)
    else:
        answer = solved(case, scipy_peer.integrate, 1e-12)
        other = solved(case, sundials_peer.cvode, 1e-12)
    value = getattr(case.crusher, case.parameter)
    slopes = []
    for step in (case.relative_step * value, 2 * case.relative_step * value):
        ahead, behind = (_rms(case.changed(value + sign * step)) for sign in (1, -1))
        slopes.append((ahead - behind) / (2 * step))
    slope = (4 * slopes[0] - slopes[1]) / 3
    rms_error, history_error = differences(other, answer)
    noise = rms_error * answer.rms / abs(case.relative_step * value * slope)
    changed = abs(slopes[0] / slope - 1)
    return Reference(answer, slope, rms_error, history_error, float(changed + noise))


def _rms(case: Case) -> float:
    found = closed_form(case, MANY[0]) if case.ideal else solved(case, scipy_peer.integrate, 1e-12)
    return found.rms
