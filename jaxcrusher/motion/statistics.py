"""Statistics of a motion over whole turns, integrated or sampled along with it."""

import dataclasses
import functools
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float, PyTree, Scalar
from typing_extensions import override

from jaxcrusher.basics.checks import nan_unless, require_whole
from jaxcrusher.basics.following import Following, Instant
from jaxcrusher.basics.integrate import (
    Carried,
    InitialValueProblem,
    Integration,
    Outcome,
    failure_text,
    integrate,
)
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.files import svg
from jaxcrusher.files.summary import Row
from jaxcrusher.joint.validity import Validity, validity
from jaxcrusher.mechanism.reductions import (
    SAMPLES,
    AbstractFollowed,
    AbstractMean,
    Chosen,
    Sampled,
    Statistic,
)
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.snapshot import Snapshot
from jaxcrusher.motion.flow import Flow, by_phase, flat, unflattened
from jaxcrusher.motion.method import Method, resolve, warn_of_slopes
from jaxcrusher.motion.named import AbstractNamed
from jaxcrusher.motion.names import StatisticNames
from jaxcrusher.motion.settling import error, is_settled, standard_error, swing_of

# Friction whirl: the pin rolls round the bore, in contact, hundreds of times a turn. A pin
# that rests in the bore follows the joint force, which goes round at most once or twice.
WHIRL_CONTACT = 0.99
WHIRL_WINDING = 10.0
# Statistics that tell whether the motion at a joint is inside the contact model.
OF_CONTACT = ("penetration_ratio", "impact_speed")


class AbstractOverTurns(AbstractNamed, StatisticNames):
    """Statistics by name, and how their integration ended."""

    outcome: Outcome  # fields of the module that inherits
    known: Chosen

    @override
    def units(self) -> dict[str, str]:
        return {name: one.unit for name, one in self.known}

    @override
    def _entries(self) -> Mapping[str, Any]:
        return dict(self.known)

    @property
    @override
    def success(self) -> Bool[Array, "*batch"]:
        """Whether the integration came to its end."""
        return self.outcome.success

    @property
    @override
    def failure(self) -> str:
        """Why and when the integration stopped, or nothing (concrete values only)."""
        return failure_text(self.outcome, "rad of phase")


class Statistics(AbstractOverTurns, eqx.Module):
    """Statistics over the turns after settling, by name: the scene tells units and meanings.

    A failed run has `success` False, NaN in every number, and says why in `failure`.
    """

    turns: int = eqx.field(static=True)
    outcome: Outcome
    values: Mapping[str, Scalar]
    by_turn: Mapping[str, Float[Array, " turns"]]  # of each turn alone
    state: Float[Array, " dims"]  # at the end, to go on from: see `Section`
    # The motion against the limits of its contact model, as far as the statistics that were asked
    # for tell it; an ideal joint keeps to them.
    validity: Validity = Validity(missing=("its scene",))
    known: Chosen = eqx.field(static=True, default=())
    # of a pin in its bore, in clearances: see `jaxcrusher.motion.settling.swing_of`
    swing: Scalar | float = 0.0

    @property
    def whirl(self) -> Bool[Array, "*batch"]:
        """Whether the motion is a friction whirl: a pin rolls round its bore.

        The pin rolls against the rotation of its body in the bore, so backwards at a crusher's main
        joint. Its penetrations, of the order of the clearance, are outside Hertz's theory. Each pin
        whose winding was asked for counts. Pins of elbow and pivot go round only while A's does
        (docs/stability_seats.md), that of the shaft's bearing also alone.
        """
        rolling = jnp.zeros_like(self.success)
        asked = [name for name in self.values if name.endswith("winding")]
        for name in asked or [name for name, _ in self.known if name.endswith("winding")]:
            at = name.removesuffix("winding")
            kept = self[f"{at}contact_fraction"] > WHIRL_CONTACT
            rolling = rolling | (kept & (abs(self[f"{at}winding"]) > WHIRL_WINDING))
        return rolling

    @property
    def settled(self) -> Bool[Array, "*batch"]:
        """Whether the motion has settled, as far as its turns show it.

        No pin swings in its bore without leaving it (a swing that decays in thousands of turns),
        and no force, moment, power, pressure or displacement has a trend. One turn does not show
        that.
        """
        if self.outcome.success.ndim:
            return jax.vmap(lambda one: one.settled)(self)
        return self.success & is_settled(self.known, self.by_turn, jnp.asarray(self.swing))

    @property
    def foundation_rms_error(self) -> Scalar:
        """The error of the RMS of |R_O| + |R_C|, N; see `error`."""
        return self.error("foundation_rms")

    def error(self, name: str) -> Scalar:
        """Return the error of a statistic: its standard error, and what has not settled.

        See `jaxcrusher.motion.settling.error`; infinite for one turn.
        """
        how = self._entry(name)
        found = jnp.vectorize(functools.partial(error, how), signature="(n),()->()")
        return found(self.by_turn[name], self.swing)

    def standard_error(self, name: str) -> Scalar:
        """Return the error of a statistic of a stationary motion, by the scatter of its turns.

        See `jaxcrusher.motion.settling.standard_error`; infinite for one turn.
        """
        how = self._entry(name)
        found = jnp.vectorize(functools.partial(standard_error, how), signature="(n)->()")
        return found(self.by_turn[name])

    @override
    def _headline(self) -> str:
        waits = self.turns > 1 and not bool(_judged(self)[1])
        turns = "1 turn" if self.turns == 1 else f"{self.turns} turns"
        waiting = " of a motion that has NOT settled" if waits else ""
        return f"{turns}{waiting}, {self.validity.verdict()}"

    @override
    def _counted(self) -> Mapping[str, Any]:
        return {"inside the contact model": self.validity.inside}

    @override
    def _rows(self) -> list[Row]:
        known = self.turns > 1 and not self.success.ndim
        return self._rows_of(self._told, _judged(self)[0] if known else {})

    @override
    def _picture(self) -> str:
        if self.turns < 2 or not self._is_one or not self.by_turn:
            return ""
        name = self._told[0]
        values = self.by_turn[name]
        return svg.curve(np.arange(1, self.turns + 1), values, f"{name} by turn")

    def _entry(self, name: str) -> Statistic:
        self[name]  # raises an error that says what is missing
        return dict(self.known)[name]


@eqx.filter_jit  # one by one their functions take seconds
def _judged(found: Statistics) -> tuple[dict[str, Scalar], Bool[Array, ""]]:
    """Return the errors of all statistics, and whether the motion has settled."""
    return {name: found.error(name) for name in found.values}, found.settled


def statistics(
    scene: Scene,
    settle_turns: int,
    turns: int,
    *,
    outputs: tuple[str, ...] | None = None,
    state: Float[ArrayLike, " dims"] | None = None,
    rtol: float | Scalar = 1e-9,
    method: Method = Method(),
) -> Statistics:
    """Statistics over `turns` turns of the shaft, after `settle_turns` turns.

    **Arguments:**

    - `scene`: what to simulate; its numbers may be traced.
    - `settle_turns`, `turns`: whole numbers, >= 0 and >= 1.
    - `outputs`: any of `scene.statistics`, which has the user's own (`scene.with_statistics`) too;
      the rest is neither computed nor traced. None is `scene.usual_statistics`: for a crusher
      `jaxcrusher.STATISTICS`, and the same of each other loose joint, prefixed by its name.
    - `state`: to start from, shape (dims,), as `Statistics.state` and `Section.state` have it, in
      place of the scene's start.
    - `rtol`, `method`: as in `jaxcrusher.simulate`, with time in radians of phase and
      steps counted per turn.

    **Returns:** a `Statistics`. RMS and means are integrated with the motion; peaks, shares of the
    time and counts are followed from step to step of the integrator. A peak is the top of a
    parabola through the ends of three steps. `Sampled` ones are seen at 1024 instants a turn.

    Raises ValueError for counts that are not whole numbers in range, outputs that the scene does
    not have, and a state of another shape.

    Warns, once in a process, where a derivative outside of `jax.jit` belongs to a motion so
    sensitive that it says nothing of other motions (docs/gradients.md).
    """
    require_set_up()
    require_whole("settle_turns", settle_turns, 0)
    require_whole("turns", turns, 1)
    how = resolve(scene, rtol, method)
    outputs = scene.usual_statistics if outputs is None else outputs
    scene.require_outputs(outputs, scene.statistics)
    found = over_turns(scene, state, settle_turns, turns, scene.entries(outputs), how)
    warn_of_slopes(found, found.outcome)
    return found


@eqx.filter_jit
def over_turns(
    scene: Scene,
    state: ArrayLike | None,
    settle_turns: int,
    turns: int,
    outputs: Chosen,
    method: Integration,
) -> Statistics:
    """`statistics` of entries of the table, with all checked and resolved."""
    states, by_turn, outcome = by_turns(scene, state, settle_turns + turns, outputs, method)
    by_turn = {name: values[settle_turns:] for name, values in by_turn.items()}
    values = {name: one.reduction.of_pieces(by_turn[name]) for name, one in outputs}
    values = nan_unless(outcome.success, values)
    limits = limits_of(scene, values)
    known = tuple({**scene.statistics, **dict(outputs)}.items())
    swing = swing_of(states[settle_turns:], scene)
    return Statistics(turns, outcome, values, by_turn, states[-1], limits, known, swing)


def by_turns(
    scene: Scene, state: ArrayLike | None, turns: int, outputs: Chosen, method: Integration
) -> tuple[Float[Array, "turns dims"], dict[str, Float[Array, "turns ..."]], Outcome]:
    """Return the section points at the ends of turns, statistics of each turn, and the outcome."""
    flow = Flow(scene, unflattened(state, scene))
    problem, shares = statistics_problem(flow, outputs)
    times = 2 * jnp.pi * (jnp.arange(turns, dtype=float)[:, None] + shares[None])
    (states, values), outcome = integrate(flow, times, problem=problem, method=method)
    # Of an ideal joint a state has no numbers, and the turns alone say how many there are.
    points = jax.vmap(lambda state, _: flat(state))(states, jnp.arange(turns))
    return points, values, outcome


def limits_of(scene: Scene, values: Mapping[str, Scalar]) -> Validity:
    """Return the limits of the contact model, as far as these statistics tell them.

    They are the limits of the joint without a prefix; `others` has those of the other loose joints
    and of other parts, such as a rod. A joint that is ideal or does not exist keeps to its limits.
    """
    parts: dict[str, tuple[Callable[..., Any], tuple[str, ...]]] = {
        joint: (
            functools.partial(validity, one),
            tuple(scene.prefix(joint) + n for n in OF_CONTACT),
        )
        for joint, one in scene.joints.items()
    }
    main = scene.template.first or ""
    if main not in parts:  # neither contact nor impacts; NaN if the run failed
        none = 0 * next(iter(values.values()), jnp.zeros(()))
        values = {**values, "none": none}
        parts[main] = functools.partial(validity, None), ("none", "none")
    parts |= scene.limits
    others = {
        part: limits(*(values[name] for name in names))
        for part, (limits, names) in parts.items()
        if all(name in values for name in names)
    }
    needed = dict.fromkeys(name for _, names in parts.values() for name in names)
    missing = tuple(name for name in needed if name not in values)
    first = others.pop(main, Validity())
    return dataclasses.replace(first, others=others, missing=missing)


def of_whirl(scene: Scene) -> tuple[str, ...]:
    """Return the names of a scene's headline statistic and of those that show a whirl.

    Ideal joints have none, but an ideal crusher has those of its main joint all the same.
    """
    prefixes = map(scene.prefix, scene.joints.names or scene.watched)
    return scene.headline, *(at + of for at in prefixes for of in ("contact_fraction", "winding"))


def statistics_problem(
    flow: Flow, outputs: Chosen, share: float | None = None
) -> tuple[InitialValueProblem, Float[Array, " n"]]:
    """Return the problem of a turn with its statistics, or of a share of a turn, and its instants.

    The instants are the shares of a turn at which samples are taken, and the end. Totals and
    samples are by phase, in radians. A share of a turn gives means, samples and followed numbers;
    `jaxcrusher.mechanism.reductions.of_slices` puts them together.
    """
    # A motion without a state has no impacts, and nothing that chooses steps for it.
    moves = bool(jax.tree.leaves(jax.eval_shape(flow.initial)))
    kinds = (AbstractFollowed, Sampled) if not moves else Sampled
    seen = any(isinstance(one.reduction, kinds) for _, one in outputs)
    span = 1.0 if share is None else share
    count = max(round(span * SAMPLES), 3) if seen else 1
    return _problem(outputs, share, moves), span * jnp.arange(1, count + 1, dtype=float) / count


@functools.cache  # so that programs of other counts share its trace
def _problem(outputs: Chosen, share: float | None, moves: bool) -> InitialValueProblem:
    looks = {name: one.quantity for name, one in outputs}
    reductions = {name: one.reduction for name, one in outputs}
    means = {n: how for n, how in reductions.items() if isinstance(how, AbstractMean)}
    others = {n: how for n, how in reductions.items() if not isinstance(how, AbstractMean)}
    followed = {n: how for n, how in others.items() if moves and isinstance(how, AbstractFollowed)}
    samples = {n: how for n, how in others.items() if n not in followed}

    def quantities(names: Iterable[str], snapshot: Snapshot, flow: Flow) -> dict[str, Array]:
        """Return the quantity of each statistic; one that several share is computed once."""
        once = dict.fromkeys(looks[name] for name in names)
        found = {quantity: quantity(snapshot, flow.scene) for quantity in once}
        return {name: found[looks[name]] for name in names}

    def seen_at(names: Iterable[str], phase: Scalar, y: Carried, flow: Flow) -> dict[str, Array]:
        _, snapshot = by_phase(flow.phase + phase, y.motion, flow.scene)
        return quantities(names, snapshot, flow)

    def initial(flow: Flow) -> Carried:
        totals = {name: mean.integrands(jnp.zeros(())) for name, mean in means.items()}
        return Carried(flow.initial(), jax.tree.map(jnp.zeros_like, totals))

    def field(phase: Scalar, y: Carried, flow: Flow) -> Carried:
        rate, snapshot = by_phase(flow.phase + phase, y.motion, flow.scene)
        now = quantities(means, snapshot, flow)
        rates = {name: mean.integrands(now[name]) for name, mean in means.items()}
        return Carried(rate, jax.tree.map(lambda one: one / (2 * jnp.pi), rates))

    def follow(kept: dict[str, PyTree], *instants: Instant) -> dict[str, PyTree]:
        def one(name: str) -> PyTree:
            return followed[name].follow(
                kept[name], *(Instant(at.time, at.seen[name]) for at in instants)
            )

        return {name: one(name) for name in followed}

    def summarise(
        seen: dict[str, Array], end: Carried, kept: dict[str, PyTree] | None
    ) -> tuple[PyTree, dict[str, PyTree]]:
        span = 2 * jnp.pi * (1.0 if share is None else share)
        values = {} if kept is None else {n: followed[n].of_kept(kept[n], span) for n in followed}
        if share is not None:
            return end.motion, jax.tree.map(lambda total: total / share, end.totals) | seen | values
        values |= {name: mean.of_means(*end.totals[name]) for name, mean in means.items()}
        values |= {name: how.of_samples(seen[name]) for name, how in samples.items()}
        return end.motion, values

    following = None
    if followed:
        following = Following(
            lambda flow: {name: how.begin() for name, how in followed.items()},
            functools.partial(seen_at, tuple(followed)),
            follow,
        )
    observe = functools.partial(seen_at, tuple(samples))
    return InitialValueProblem(initial, field, observe, summarise, following)
