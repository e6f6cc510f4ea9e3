"""The kind of a motion: a verdict on which several indicators must agree."""

from collections.abc import Callable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from typing_extensions import override

from jaxcrusher.basics.checks import require, require_untraced, require_whole
from jaxcrusher.basics.integrate import Outcome
from jaxcrusher.files.summary import Row, Summarised, Summary
from jaxcrusher.files.text import measured, with_error
from jaxcrusher.mechanism.reductions import ALL_THE_TIME
from jaxcrusher.mechanism.scene import Scene, require_scene
from jaxcrusher.mechanism.state import pins_of
from jaxcrusher.motion import indicators
from jaxcrusher.motion.flow import initial_state
from jaxcrusher.motion.indicators import Lyapunov
from jaxcrusher.motion.section import Section, Slices, poincare_section
from jaxcrusher.motion.statistics import Statistics, of_whirl
from jaxcrusher.motion.tangents import SLICES
from jaxcrusher.orbits.forced import refusal
from jaxcrusher.orbits.oscillation import oscillation_about, section_of
from jaxcrusher.orbits.periodic_orbit import periodic_orbit
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.orbits.solving import NODES

# Ten batches of two points: the least that show a trend. The 0-1 test needs more: of 100 points it
# takes one torus of ten for chaos, of 20 every one, and of 200 none.
LEAST_TURNS, TESTED = 20, 200
# After how many turns a whirl is called one.
WHIRL_TURNS = 20
# What the integration leaves on a periodic orbit, in tolerances: a thousand steps a turn, and
# turns that hardly contract. Measured on orbits of period 2 to 8: up to 1.2e5.
NOISE = 2e5


@dataclass(frozen=True, repr=False)
class Regime(Summarised):
    """A verdict and its evidence.

    `name` is "periodic", "quasi-periodic", "chaotic", "whirl", "not settled", "undecided" or
    "failed"; exponents are per turn.
    """

    name: str
    evidence: tuple[str, ...]
    period: int | None = None  # turns
    exponents: Lyapunov | None = None
    zero_one: float | None = None
    trend: float | None = None  # change of the section's spread over the window, as a share
    statistics: Statistics | None = None
    state: np.ndarray | None = None  # the last of the section's points

    @property
    def _verdict(self) -> str:
        return f"period {self.period}" if self.period else self.name

    @override
    def _summary(self) -> Summary:
        title = "Regime FAILED" if self.name == "failed" else f"Regime: {self._verdict}"
        found = self.exponents
        both = () if found is None else zip(found.exponents, found.errors, strict=True)
        exponents = [measured(float(one), "a turn", float(error)) for one, error in both]
        rows = [Row(f"exponent {i}", text) for i, text in enumerate(exponents[:4], 1)]
        return Summary(title, rows, self.evidence)

    @override
    def __str__(self) -> str:
        return f"{self._verdict}: {'; '.join(self.evidence)}"


def regime(
    scene: Scene,
    settle_turns: int = 200,
    turns: int = 1000,
    *,
    tangent_turns: int = 100,
    rtol: float = 1e-10,
) -> Regime:
    """Classify the motion of `scene` after `settle_turns`, from `turns` (>= 20) section points.

    The exponents come from `tangent_turns` further turns. A verdict other than "undecided" needs
    its indicators to agree, of which the 0-1 test is left out below 200 points; points whose spread
    still changes are "not settled", unless they repeat or are chaotic. A motion that never leaves
    contact and swings about a stable orbit of one turn is "not settled" too, however slowly the
    swing dies: the multipliers of that orbit show it where no window of turns does. Whirls are
    named by `Statistics.whirl`. `rtol` is that of `jaxcrusher.statistics`, tighter by default. It
    decides which points repeat. A looser one than 1e-10 damps or feeds a swing itself, so that a
    trend of the spread may come from the method.

    Raises ValueError for fewer points, for ideal joints in a clamped frame, whose motion has no
    state, and as `poincare_section` does.
    """
    require_scene(scene)
    require_untraced("scene", scene, "regime", "jaxcrusher.statistics")
    require(scene.has_unknowns, "scene", "have a joint with clearance, or supports", "an ideal one")
    require_whole("tangent_turns", tangent_turns, 1)

    def further(state: Float[Array, " dims"]) -> Section:
        return poincare_section(scene, 0, tangent_turns, slices=SLICES, state=state, rtol=rtol)

    return classify(scene, settle_turns, turns, rtol, further)


def classify(
    scene: Scene,
    settle_turns: int,
    turns: int,
    rtol: float,
    further: Callable[[Array], Section | Slices],
) -> Regime:
    """`regime`, with the Jacobians made by the caller.

    `further` maps the last section point to the `SLICES` slices of each of the next turns, with
    their Jacobians; it is not called for a whirl or a failure.
    """
    record = _record(scene, settle_turns, turns, rtol)
    return judged(record, rtol, further, lambda: _orbit_in_contact(scene, record))


def judged(
    record: Section,
    rtol: float,
    further: Callable[[Array], Section | Slices],
    in_contact: Callable[[], PeriodicOrbit | None],
) -> Regime:
    """Return the regime of section points, from what the indicators say of them.

    `in_contact` finds the orbit that they swing about without leaving contact; it is not called
    for a whirl, a failure or chaos.
    """
    points, summary = np.asarray(record.states), record.statistics
    if not bool(summary.success):
        return Regime("failed", (summary.failure,), statistics=summary)
    if bool(summary.whirl):
        windings = (float(q) for n, q in summary.values.items() if n.endswith("winding"))
        winding = f"winds {max(windings, key=abs):.0f} times a turn round its bore"
        return Regime("whirl", (winding,), statistics=summary)
    along = further(summary.state)
    if not np.isfinite(along.jacobians).all():
        why = f"the tangents are not finite; {along.failure}".rstrip("; ")
        return Regime("failed", (why,), statistics=summary)
    exponents = indicators.lyapunov_spectrum(along.jacobians, slices=SLICES)
    zero_one = (
        indicators.zero_one_test(indicators.widest(points)) if len(points) >= TESTED else None
    )
    period = indicators.detect_period(points, noise=NOISE * rtol)
    trend, significant = indicators.spread_trend(points, noise=NOISE * rtol)
    largest, error = exponents.exponents[0], exponents.errors[0]
    evidence = [
        f"largest exponent {with_error(largest, error)} a turn",
        f"no 0-1 test of fewer than {TESTED} points"
        if zero_one is None
        else f"0-1 test {zero_one:.2f}",
        f"period {period}" if period else "no period up to 32",
        f"spread changes by {100 * trend:.0f} %",
    ]
    # Without that test a growth that a swing may have too is none.
    grows = bool(exponents.positive and (zero_one is not None or largest > indicators.CHAOS))
    name = indicators.verdict(
        period, grows, zero_one, trending=significant, neutral=exponents.neutral
    )
    orbit = None if name == "chaotic" else in_contact()
    if orbit is not None:
        # Of neither a torus nor a limit does it tell that a window sees no change in.
        name = "periodic" if name == "periodic" else "not settled"
        evidence.append(
            f"in contact about a motion of one turn, whose largest multiplier is 1 - "
            f"{1 - float(orbit.largest_multiplier):.2g}: a swing dies in "
            f"{float(orbit.settling_turns):.3g} turns"
        )
    found = period if name == "periodic" else None
    return Regime(name, tuple(evidence), found, exponents, zero_one, trend, summary, points[-1])


def _orbit_in_contact(scene: Scene, record: Section) -> PeriodicOrbit | None:
    """The stable motion of one turn that the record swings about without leaving contact."""
    kept = all(
        bool(jnp.all(record.values[f"{scene.prefix(joint)}contact_fraction"] >= ALL_THE_TIME))
        for joint in scene.joints.names
    )
    if not kept or scene.is_ideal or refusal(scene):
        return None
    orbit = periodic_orbit(scene, nodes=NODES)
    if not bool(orbit.stable):
        return None
    swing = oscillation_about(np.asarray(record.states), 1, pins_of(scene))
    return orbit if swing.is_about(section_of(orbit)) else None


def _record(scene: Scene, settle_turns: int, turns: int, rtol: float) -> Section:
    """Section points, and what tells contact and a whirl; a whirl or a failure ends it early.

    Turn by turn: one program serves any number of them.
    """
    require_whole("settle_turns", settle_turns, 0)
    require_whole("turns", turns, LEAST_TURNS)
    state, steps, seen = initial_state(scene), 0, []
    contact = (f"{scene.prefix(joint)}contact_fraction" for joint in scene.joints.names)
    outputs = tuple(dict.fromkeys((*of_whirl(scene), *contact)))
    for i in range(settle_turns + turns):
        turn = poincare_section(scene, 0, 1, state=state, outputs=outputs, rtol=rtol)
        state, steps = turn.state, steps + turn.outcome.steps
        reached = 2 * np.pi * i + turn.outcome.reached
        failed = not bool(turn.success)
        if i >= settle_turns or failed:
            seen.append(turn)
        last = failed or i == settle_turns + turns - 1
        if last or len(seen) == WHIRL_TURNS:
            record = _joined(seen, Outcome(turn.outcome.result, reached, steps))
            if last or bool(record.statistics.whirl):
                break
    return record


def _joined(turns: list[Section], outcome: Outcome) -> Section:
    """Consecutive turns as one section."""
    names = turns[0].values
    values = {name: jnp.concatenate([turn[name] for turn in turns]) for name in names}
    states = jnp.concatenate([turn.states for turn in turns])
    return Section(states, turns[0].jacobians, outcome, values, turns[0].known)
