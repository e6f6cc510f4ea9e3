"""The once-per-turn map of a motion: its section points, and its Jacobians."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, ArrayLike, Float, PyTree, Scalar
from typing_extensions import override

from jaxcrusher.basics.checks import require, require_whole
from jaxcrusher.basics.integrate import RESULTS, Integration, Outcome, integrate
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.files.summary import Row, value_text
from jaxcrusher.mechanism.reductions import Chosen, of_slices
from jaxcrusher.mechanism.scene import Scene, require_steady
from jaxcrusher.motion.flow import Flow, flat, initial_state, unflattened
from jaxcrusher.motion.method import Method, resolve, warn_of_slopes
from jaxcrusher.motion.statistics import AbstractOverTurns, Statistics, by_turns, statistics_problem


class Section(AbstractOverTurns, eqx.Module):
    """States at the end of each turn, where the shaft is again at angle zero.

    With the default formulation a state has, for each loose joint in turn, (e_x / c, e_y / c, e_x',
    e_y') in 1 and m/s, then the memory of a tracked impact velocity, m/s, if the joint has one.
    After all joints come the numbers of a free shaft and the six of a frame on supports, in the
    units of `jaxcrusher.mechanism.state.FrameUnits`. States are NaN from a failure on.
    """

    states: Float[Array, "turns dims"]
    jacobians: Float[Array, "matrices dims dims"]  # of each slice of each turn
    outcome: Outcome
    values: Mapping[str, Float[Array, " turns"]]  # statistics of each turn, as far as asked for
    known: Chosen = eqx.field(static=True, default=())

    @property
    def state(self) -> Float[Array, "*batch dims"]:
        """The last state, to go on from."""
        return self.states[..., -1, :]

    @property
    def statistics(self) -> Statistics:
        """Return the statistics that were asked for, over all turns."""
        if self.states.ndim > 2:
            return jax.vmap(lambda one: one.statistics)(self)
        table = dict(self.known)
        values = {name: table[name].reduction.of_pieces(q) for name, q in self.values.items()}
        turns, state = len(self.states), self.state
        return Statistics(turns, self.outcome, values, self.values, state, known=self.known)

    @override
    def _headline(self) -> str:
        return f"states at the ends of {len(self.states)} turns"

    @override
    def _rows(self) -> list[Row]:
        return [Row("states", value_text(self.states, "1")), *self._rows_of(self._told)]

    @property
    def slices(self) -> int:
        """Jacobians a turn."""
        return self.jacobians.shape[-3] // self.states.shape[-2]


def advance(
    flow: Flow, span: float, method: Integration, outputs: Chosen = ()
) -> tuple[PyTree[Scalar], dict[str, PyTree], Outcome]:
    """The state after `span` radians of phase, and what is kept of statistics on the way there.

    Differentiable by the scene and the state.
    """
    problem, shares = statistics_problem(flow, outputs, span / (2 * math.pi))
    times = 2 * math.pi * shares[None]
    (states, values), outcome = integrate(flow, times, problem=problem, method=method)
    return *jax.tree.map(lambda leaf: leaf[0], (states, values)), outcome


class Slices(eqx.Module):
    """One or several slices of a motion: state x, parameters p, and m, a part of each statistic."""

    jacobians: Float[Any, "*slices dims dims"]  # dx_after / dx_before
    forcing: Float[Any, "*slices dims n"]  # dx_after / dp
    # m, by name or of one, as `of_slices` takes it
    values: PyTree[Float[Any, "..."]]
    by_state: PyTree[Float[Any, "... dims"]]  # dm / dx_before
    by_parameter: PyTree[Float[Any, "... n"]]  # dm / dp
    failure: str = eqx.field(static=True, default="")  # why and when they ended early, if known


class Sloped(eqx.Module):
    """Motions of the scene `build(point)`, integrated with their slopes by state and point."""

    build: Callable[[Array], Scene]
    point: Float[Array, " n"]
    method: Integration
    outputs: Chosen = eqx.field(static=True, default=())

    def turn(
        self, state: Float[Array, " dims"], count: int
    ) -> tuple[Float[Array, " dims"], Slices, Outcome]:
        """Return where a turn leads from a section point, in `count` slices.

        The tangents of a slice by the state and by the point are integrated beside it, from the
        identity and zero on.
        """
        span = 2 * math.pi / count

        def one(carry, phase):
            state, before = carry
            end, found, outcome = self.slice(state, phase, span)
            return (end, first_failure(before, outcome)), found

        (state, outcome), slices = jax.lax.scan(
            one, (state, fine()), span * jnp.arange(count, dtype=float)
        )
        scene = self.build(self.point)
        return flat(unflattened(state, scene)), slices, outcome

    def slice(
        self, state: Float[Array, " dims"], phase: Scalar, span: float
    ) -> tuple[Float[Array, " dims"], Slices, Outcome]:
        """Return where a slice of a turn leads from a state at a phase, with slopes."""
        dims = state.size
        _, unravel = ravel_pytree(unflattened(state, self.build(self.point)))

        def after(both):
            flow = Flow(self.build(both[dims:]), unravel(both[:dims]), phase)
            end, values, outcome = advance(flow, span, self.method, self.outputs)
            found = ravel_pytree(end)[0], values
            return found, (*found, outcome)

        derivatives, (end, values, outcome) = jax.jacfwd(after, has_aux=True)(
            jnp.concatenate([state, self.point])
        )
        matrix, by_state = jax.tree.map(lambda slope: slope[..., :dims], derivatives)
        forcing, by_parameter = jax.tree.map(lambda slope: slope[..., dims:], derivatives)
        return end, Slices(matrix, forcing, values, by_state, by_parameter), outcome


def fine() -> Outcome:
    """Return the outcome of a motion that has not begun."""
    return Outcome(RESULTS.promote(diffrax.RESULTS.successful), jnp.zeros(()), jnp.array(0))


def first_failure(before: Outcome, after: Outcome) -> Outcome:
    """The outcome of two consecutive pieces; a NaN state makes the second fail at once."""
    reached = before.reached + jnp.where(before.success, after.reached, 0)
    result = RESULTS.where(before.success, after.result, before.result)
    sensitivity = jnp.maximum(before.sensitivity, after.sensitivity)
    return Outcome(result, reached, before.steps + after.steps, sensitivity)


def poincare_section(
    scene: Scene,
    settle_turns: int,
    turns: int,
    *,
    slices: int = 0,
    state: Float[ArrayLike, " dims"] | None = None,
    outputs: tuple[str, ...] = (),
    rtol: float | Scalar = 1e-9,
    method: Method = Method(),
) -> Section:
    """Section points of `turns` turns after `settle_turns` turns.

    **Arguments:**

    - `scene`: with a shaft of constant speed, and a load that repeats each turn.
    - `slices`: slices of a turn whose Jacobians are returned. Faster growth needs more slices,
      since a Jacobian of condition 1e16 has no digits left.
    - `state`: to start from, shape (dims,), in place of the scene's start.
    - `outputs`: statistics of each turn to return, as in `jaxcrusher.statistics`.
    - `rtol`, `method`: as in `jaxcrusher.statistics`.

    **Returns:** a `Section`; NaN from a failure on.

    Raises ValueError for counts that are not whole numbers in range, for a free shaft, for
    a rough feed, for slices of ideal joints in a clamped frame, whose motion has no state, for
    unknown outputs and for a state of another shape.

    Warns, once in a process, where a derivative outside of `jax.jit` belongs to a motion so
    sensitive that it says nothing of other motions (docs/gradients.md).
    """
    require_set_up()
    require_whole("settle_turns", settle_turns, 0)
    require_whole("turns", turns, 1)
    require_whole("slices", slices, 0)
    scene.require_outputs(outputs, scene.statistics)
    require_steady(scene)
    free = scene.drive.initial() is not None
    require(not free, "scene", "have a shaft of constant speed", scene.drive)
    good = scene.has_unknowns or not slices
    require(good, "slices", "be 0 for ideal joints in a clamped frame", slices)
    how = resolve(scene, rtol, method)
    found = _section(scene, settle_turns, turns, slices, state, scene.entries(outputs), how)
    warn_of_slopes(found, found.outcome)
    return found


@eqx.filter_jit
def _section(
    scene: Scene,
    settle_turns: int,
    turns: int,
    slices: int,
    state: ArrayLike | None,
    outputs: Chosen,
    method: Integration,
) -> Section:
    before, known = fine(), tuple(scene.statistics.items())
    if settle_turns:
        settled, _, before = by_turns(scene, state, settle_turns, (), method)
        state = settled[-1]
    if not slices:
        states, values, after = by_turns(scene, state, turns, outputs, method)
        dims = states.shape[1]
        return Section(
            states, jnp.zeros((0, dims, dims)), first_failure(before, after), values, known
        )

    sloped = Sloped(lambda _: scene, jnp.zeros(0), method, outputs)

    def sliced_turn(carry, _):
        state, before = carry
        after, found, outcome = sloped.turn(state, slices)
        values = {n: of_slices(one.reduction, found.values[n], 1) for n, one in outputs}
        return (after, first_failure(before, outcome)), (after, values, found.jacobians)

    start = initial_state(scene) if state is None else jnp.asarray(state, float)
    (_, outcome), seen = jax.lax.scan(sliced_turn, (start, before), length=turns)
    states, values, jacobians = seen
    return Section(states, jacobians.reshape(-1, *jacobians.shape[2:]), outcome, values, known)
