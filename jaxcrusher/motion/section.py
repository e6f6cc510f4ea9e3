"""The once-per-turn map of a motion: its section points, and its Jacobians."""

import math

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree, Scalar

from jaxcrusher.basics.checks import require, require_choice, require_whole, require_x64
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.motion.integrate import RESULTS, Carried, Integration, Outcome, Problem, integrate
from jaxcrusher.motion.method import Method, resolve
from jaxcrusher.motion.statistics import (
    FURTHER_STATISTICS,
    PEAK_POWER,
    SAMPLES,
    STATISTICS,
    sampled_observables,
    statistics_problem,
)


class Section(eqx.Module):
    """States at the end of each turn, where the shaft is again at angle zero.

    With the default formulation a state is (e_x / c, e_y / c, e_x', e_y') in 1 and m/s, and
    after them the memory of a tracked impact velocity.
    """

    states: Float[Array, "turns dims"]
    jacobians: Float[Array, "turns*slices dims dims"] | None  # of each slice of a turn
    outcome: Outcome
    values: dict[str, Float[Array, " turns"]]  # statistics of each turn, as far as asked for

    @property
    def slices(self) -> int:
        """Jacobians a turn."""
        assert self.jacobians is not None
        return self.jacobians.shape[0] // self.states.shape[0]


class _Flow(eqx.Module):
    """Where and when a piece of motion starts."""

    scene: Scene
    state: PyTree[Scalar]
    angle: Scalar  # of the shaft, rad


def _flow_problem(outputs: tuple[str, ...], share: float) -> Problem:
    """The motion from a given state on, with statistics of a share of a turn."""
    parts = statistics_problem(outputs)

    def initial(flow: _Flow) -> Carried:
        return Carried(flow.state, parts.initial(flow.scene).totals)

    def field(angle: Scalar, y: Carried, flow: _Flow) -> Carried:
        return parts.field(flow.angle + angle, y, flow.scene)

    def observe(angle: Scalar, y: Carried, flow: _Flow) -> tuple[PyTree, PyTree]:
        return y.motion, parts.observe(flow.angle + angle, y, flow.scene)

    def summarise(seen: tuple[PyTree, PyTree], totals: PyTree) -> tuple[PyTree, PyTree]:
        motion, observed = seen
        means = {name: total / share for name, total in totals.items()}
        return jax.tree.map(lambda leaf: leaf[-1], motion), parts.summarise(observed, means)

    return Problem(initial, field, observe, summarise)


def advance(
    scene: Scene,
    state: PyTree[Scalar],
    angle: Scalar,
    span: float,
    method: Integration,
    outputs: tuple[str, ...] = (),
) -> tuple[PyTree[Scalar], dict[str, Scalar], Outcome]:
    """The state `span` radians of shaft angle after `angle`, and statistics on the way there.

    Differentiable by the scene and the state.
    """
    share = span / (2 * math.pi)
    samples = max(round(share * SAMPLES), 3) if sampled_observables(outputs) else 1
    times = span * jnp.arange(1, samples + 1)[None] / samples
    flow, problem = _Flow(scene, state, angle), _flow_problem(outputs, share)
    (after, values), outcome = integrate(flow, times, problem=problem, method=method)
    after, values = jax.tree.map(lambda leaf: leaf[0], (after, values))
    if "mean_square" in values:
        values["foundation_rms"] = jnp.sqrt(values.pop("mean_square"))
    if "foundation_smooth_peak" in values:
        values["foundation_smooth_peak"] **= 1 / PEAK_POWER
    return after, values, outcome


# Statistics that are the largest of many samples rather than means.
LARGEST = ("foundation_peak", "penetration_ratio", "impact_speed", "joint_peak")


def whole(name: str, values: Float[Array, " n"]) -> Scalar:
    """The statistic `name` over n equal pieces of a motion, from that of each."""
    if name in LARGEST:
        return jnp.max(values)
    power = {"foundation_rms": 2, "foundation_smooth_peak": PEAK_POWER}.get(name, 1)
    return jnp.mean(values**power) ** (1 / power)


def poincare_section(
    scene: Scene,
    settle_turns: int,
    turns: int,
    *,
    slices: int | None = None,
    state: Float[Array, " dims"] | None = None,
    outputs: tuple[str, ...] = (),
    rtol: float | Scalar = 1e-9,
    method: Method = Method(),
) -> Section:
    """Section points of `turns` turns after `settle_turns` turns.

    **Arguments:**

    - `scene`: with a shaft of constant speed.
    - `slices`: with it, the Jacobian of each of so many slices of a turn comes along; more
      slices for faster growth, since a Jacobian of condition 1e16 holds nothing.
    - `state`: to start from, shape (dims,), in place of the scene's start.
    - `outputs`: statistics of each turn that come along, as in
      `jaxcrusher.statistics`.
    - `rtol`, `method`: as in `jaxcrusher.statistics`.

    **Returns:** a `Section`; NaN from a failure on.

    Raises ValueError for counts that are not whole numbers in range, for a free shaft and for
    unknown outputs.
    """
    require_x64()
    require_whole("settle_turns", settle_turns, 0)
    require_whole("turns", turns, 1)
    if slices is not None:
        require_whole("slices", slices, 1)
    for name in outputs:
        require_choice("outputs", name, (*STATISTICS, *FURTHER_STATISTICS))
    free = scene.drive.initial() is not None
    require(not free, "scene", "have a shaft of constant speed", scene.drive)
    how = resolve(scene, rtol, method)
    return _section(scene, settle_turns, turns, slices, state, tuple(outputs), how)


@eqx.filter_jit
def initial_state(scene: Scene) -> Float[Array, " dims"]:
    """Where the scene starts, as a section point."""
    return ravel_pytree(scene.formulation.initial(scene))[0]


@eqx.filter_jit
def _section(
    scene: Scene,
    settle_turns: int,
    turns: int,
    slices: int | None,
    state,
    outputs: tuple[str, ...],
    method: Integration,
) -> Section:
    start, unravel = ravel_pytree(scene.formulation.initial(scene))
    state = start if state is None else jnp.asarray(state, dtype=float)

    def flow(state, angle, span, outputs):
        after, values, outcome = advance(scene, unravel(state), angle, span, method, outputs)
        return ravel_pytree(after)[0], values, outcome

    def turn(carry, outputs):
        state, before = carry
        after, values, outcome = flow(state, jnp.zeros(()), 2 * jnp.pi, outputs)
        outcome = _first_failure(before, outcome, 2 * jnp.pi)
        return (after, outcome), (after, values)

    def sliced_turn(carry, _):
        count = slices or 1
        span = 2 * jnp.pi / count

        def one(carry, angle):
            state, before = carry

            def after(state):
                end, values, outcome = flow(state, angle, span, outputs)
                return end, (end, values, outcome)

            jacobian, (end, values, outcome) = jax.jacfwd(after, has_aux=True)(state)
            return (end, _first_failure(before, outcome, span)), (jacobian, values)

        carry, (jacobians, values) = jax.lax.scan(one, carry, span * jnp.arange(count))
        values = {name: whole(name, parts) for name, parts in values.items()}
        return carry, (carry[0], values, jacobians)

    fine = Outcome(RESULTS.promote(diffrax.RESULTS.successful), jnp.zeros(()), jnp.array(0))
    carry = (state, fine)
    if settle_turns:
        carry, _ = jax.lax.scan(lambda carry, _: turn(carry, ()), carry, length=settle_turns)
    if slices is None:
        (_, outcome), (states, values) = jax.lax.scan(
            lambda carry, _: turn(carry, outputs), carry, length=turns
        )
        return Section(states, None, outcome, values)
    (_, outcome), (states, values, jacobians) = jax.lax.scan(sliced_turn, carry, length=turns)
    return Section(states, jacobians.reshape(-1, *jacobians.shape[2:]), outcome, values)


def _first_failure(before: Outcome, outcome: Outcome, span: float) -> Outcome:
    """The outcome of two consecutive pieces; a NaN state makes the second fail at once."""
    reached = before.reached + jnp.where(before.success, outcome.reached, 0)
    result = RESULTS.where(before.success, outcome.result, before.result)
    return Outcome(result, reached, before.steps + outcome.steps)
