"""Statistics of a motion over whole turns, integrated or sampled along with it."""

import dataclasses
import functools
import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float, PyTree, Scalar

from jaxcrusher.basics.checks import nan_unless, require_names, require_whole
from jaxcrusher.basics.integrate import (
    Carried,
    Integration,
    Outcome,
    Problem,
    failure_text,
    integrate,
)
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.joint.validity import Validity, validity
from jaxcrusher.mechanism.named import before
from jaxcrusher.mechanism.reductions import SAMPLES, AbstractMean, Chosen, Sampled
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.mechanism.snapshot import Snapshot
from jaxcrusher.motion.flow import Flow, by_phase, flat, unflattened
from jaxcrusher.motion.method import Method, resolve
from jaxcrusher.motion.named import AbstractNamed
from jaxcrusher.motion.names import StatisticNames

# Friction whirl: the pin rolls round the bore, in contact, hundreds of times a turn. A pin
# that rests in the bore follows the joint force, which goes round at most once or twice.
WHIRL_CONTACT = 0.99
WHIRL_WINDING = 10.0
# Statistics that tell whether the motion at a joint is inside the contact model.
OF_CONTACT = ("penetration_ratio", "impact_speed")


class AbstractOverTurns(AbstractNamed, StatisticNames):
    """Statistics by name, and how the integration that they are of ended."""

    outcome: Outcome  # fields of the module that inherits
    known: Chosen

    def units(self) -> dict[str, str]:
        """Return the unit of every statistic that might have been asked for."""
        return {name: one.unit for name, one in self.known}

    @property
    def success(self) -> Bool[Array, "*batch"]:
        """Whether the integration came to its end."""
        return self.outcome.success

    @property
    def failure(self) -> str:
        """Why and when the integration stopped, or nothing (concrete values only)."""
        return failure_text(self.outcome, "rad of phase")


class Statistics(eqx.Module, AbstractOverTurns):
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

    @property
    def whirl(self) -> Bool[Array, "*batch"]:
        """Whether the motion is a friction whirl: a pin rolls round its bore.

        It rolls against its body's turning in the bore, so backwards at a crusher's main joint.
        Its penetrations, of the order of the clearance, are outside Hertz's theory. Any pin tells
        whose winding was asked for. Those of elbow and pivot go round only while A's does
        (docs/stability_seats.md), and that of the shaft's bearing also alone.
        """
        rolling = jnp.zeros_like(self.success)
        asked = [name for name in self.values if name.endswith("winding")]
        for name in asked or [name for name, _ in self.known if name.endswith("winding")]:
            at = name.removesuffix("winding")
            kept = self[f"{at}contact_fraction"] > WHIRL_CONTACT
            rolling = rolling | (kept & (abs(self[f"{at}winding"]) > WHIRL_WINDING))
        return rolling

    @property
    def foundation_rms_error(self) -> Scalar:
        """Standard error of the RMS of |R_O| + |R_C|, N; see `standard_error`."""
        return self.standard_error("foundation_rms")

    def standard_error(self, rms: str) -> Scalar:
        """Return the standard error of an RMS from the scatter of up to ten batches of turns.

        Right for turns that are independent from batch to batch; infinite for one turn.
        """
        value, batches = self[rms], min(10, self.turns)
        if batches == 1:
            return value + jnp.inf
        length = self.turns // batches
        used = self.by_turn[rms][..., : batches * length] ** 2
        means = jnp.mean(used.reshape(*used.shape[:-1], batches, length), axis=-1)
        # Turns that fill no batch are in the RMS too.
        scatter = jnp.std(means, axis=-1, ddof=1) * math.sqrt(length / self.turns)
        return scatter / (2 * value)


def statistics(
    scene: AbstractScene,
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
    - `outputs`: any of `jaxcrusher.STATISTICS` and `FURTHER_STATISTICS`, the same of another
      loose joint with `elbow_`, `pivot_` or `shaft_bearing_` before the name, and whatever was
      added to `STATISTIC`; the rest is neither computed nor traced. None is `STATISTICS`, of each
      joint that is loose, and whatever was added.
    - `state`: to start from, shape (dims,), as `Statistics.state` and `Section.state` have it, in
      place of the scene's start.
    - `rtol`, `method`: as in `jaxcrusher.simulate`, with time in radians of phase and
      steps counted per turn.

    **Returns:** a `Statistics`. RMS and means are integrated with the motion; the rest is
    seen at 1024 instants a turn, the peak as the top of a parabola through three of them.

    Raises ValueError for counts that are not whole numbers in range, unknown outputs, a state of
    another shape, and a sliding power asked of a scene without friction.
    """
    require_set_up()
    require_whole("settle_turns", settle_turns, 0)
    require_whole("turns", turns, 1)
    how = resolve(scene, rtol, method)
    outputs = scene.usual_statistics if outputs is None else outputs
    require_names("outputs", outputs, tuple(scene.statistics))
    return over_turns(scene, state, settle_turns, turns, scene.entries(outputs), how)


@eqx.filter_jit
def over_turns(
    scene: AbstractScene,
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
    known = tuple(scene.statistics.items())
    return Statistics(turns, outcome, values, by_turn, states[-1], limits, known)


def by_turns(
    scene: AbstractScene, state: ArrayLike | None, turns: int, outputs: Chosen, method: Integration
) -> tuple[Float[Array, "turns dims"], dict[str, Float[Array, " turns"]], Outcome]:
    """Return the section points at the ends of turns, statistics of each turn, and the outcome."""
    flow, problem = Flow(scene, unflattened(state, scene)), statistics_problem(outputs)
    times = 2 * jnp.pi * (jnp.arange(turns, dtype=float)[:, None] + instants(outputs)[None])
    (states, values), outcome = integrate(flow, times, problem=problem, method=method)
    # Of an ideal joint a state has no numbers, and the turns alone say how many there are.
    points = jax.vmap(lambda state, _: flat(state, scene))(states, jnp.arange(turns))
    return points, values, outcome


def limits_of(scene: AbstractScene, values: Mapping[str, Scalar]) -> Validity:
    """Return the limits of the contact model, as far as these statistics tell them.

    They are those of the main joint, and in `others` those of the other loose joints and of what
    else has limits, such as a rod. An ideal main joint keeps to them, and one that there is not.
    """
    parts: dict[str, tuple[Callable[..., Any], tuple[str, ...]]] = {
        joint: (functools.partial(validity, one), tuple(before(joint) + n for n in OF_CONTACT))
        for joint, one in scene.joints.items()
    }
    if "main" not in parts:  # neither contact nor impacts; NaN if the run failed
        none = 0 * next(iter(values.values()), jnp.zeros(()))
        values = {**values, "none": none}
        parts["main"] = functools.partial(validity, None), ("none", "none")
    parts |= scene.limits
    others = {
        part: limits(*(values[name] for name in names))
        for part, (limits, names) in parts.items()
        if all(name in values for name in names)
    }
    needed = dict.fromkeys(name for _, names in parts.values() for name in names)
    missing = tuple(name for name in needed if name not in values)
    main = others.pop("main", Validity())
    return dataclasses.replace(main, others=others, missing=missing)


def of_whirl(scene: AbstractScene) -> tuple[str, ...]:
    """Return the leading statistic of a scene, and what tells a whirl of it: of ideal joints none.

    An ideal crusher has statistics of its main joint all the same.
    """
    main = ("main",) if "contact_fraction" in scene.statistics else ()
    names = scene.joints.names or main
    return scene.leading, *(before(n) + of for n in names for of in ("contact_fraction", "winding"))


def instants(outputs: Chosen, share: float = 1.0) -> Float[Array, " n"]:
    """The shares of a turn (or of a share of it) at which these statistics look, and its end."""
    seen = any(isinstance(one.reduction, Sampled) for _, one in outputs)
    count = max(round(share * SAMPLES), 3) if seen else 1
    return share * jnp.arange(1, count + 1, dtype=float) / count


@functools.cache  # so that programs of other counts share its trace
def statistics_problem(outputs: Chosen, share: float | None = None) -> Problem:
    """Return the problem of a `Flow` over a turn with its statistics, or over a share of a turn.

    Totals and samples by phase, in radians. Of a share come the means and the samples, which
    `jaxcrusher.mechanism.reductions.of_slices` puts together.
    """
    looks = {name: one.quantity for name, one in outputs}
    means = {n: one.reduction for n, one in outputs if isinstance(one.reduction, AbstractMean)}
    samples = {n: one.reduction for n, one in outputs if isinstance(one.reduction, Sampled)}

    def quantities(names: Iterable[str], snapshot: Snapshot, flow: Flow) -> dict[str, Array]:
        """Return the quantity of each statistic; one that several share is computed once."""
        once = dict.fromkeys(looks[name] for name in names)
        found = {quantity: quantity(snapshot, flow.scene) for quantity in once}
        return {name: found[looks[name]] for name in names}

    def initial(flow: Flow) -> Carried:
        totals = {name: mean.integrands(jnp.zeros(())) for name, mean in means.items()}
        return Carried(flow.initial(), jax.tree.map(jnp.zeros_like, totals))

    def field(phase: Scalar, y: Carried, flow: Flow) -> Carried:
        rate, snapshot = by_phase(flow.phase + phase, y.motion, flow.scene)
        now = quantities(means, snapshot, flow)
        rates = {name: mean.integrands(now[name]) for name, mean in means.items()}
        return Carried(rate, jax.tree.map(lambda one: one / (2 * jnp.pi), rates))

    def observe(phase: Scalar, y: Carried, flow: Flow) -> dict[str, Array]:
        _, snapshot = by_phase(flow.phase + phase, y.motion, flow.scene)
        return quantities(samples, snapshot, flow)

    def summarise(seen: dict[str, Array], end: Carried) -> tuple[PyTree, dict[str, PyTree]]:
        if share is not None:
            return end.motion, jax.tree.map(lambda total: total / share, end.totals) | seen
        values = {name: mean.of_means(*end.totals[name]) for name, mean in means.items()}
        values |= {name: how.of_samples(seen[name]) for name, how in samples.items()}
        return end.motion, values

    return Problem(initial, field, observe, summarise)
