"""The once-per-turn map of a motion: its section points, and its Jacobians."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree, Scalar

from jaxcrusher.checks import require, require_whole, require_x64
from jaxcrusher.integrate import RESULTS, Carried, Integration, Outcome, Problem, integrate
from jaxcrusher.scene import Scene
from jaxcrusher.simulate import integration


class Section(eqx.Module):
    """States at the end of each turn, where the shaft is again at angle zero.

    With the default formulation a state is (e_x / c, e_y / c, e_x', e_y') in 1 and m/s, and
    after them the memory of a tracked impact velocity.
    """

    states: Float[Array, "turns dims"]
    jacobians: Float[Array, "turns*slices dims dims"] | None  # of each slice of a turn
    outcome: Outcome

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


def _field(angle: Scalar, y: Carried, flow: _Flow) -> Carried:
    speed = flow.scene.drive.speed
    time = (flow.angle + angle) / speed
    formulation = flow.scene.formulation
    snapshot = formulation.snapshot(time, y.motion, flow.scene)
    rate = formulation.rate(snapshot, y.motion, flow.scene)
    return Carried(jax.tree.map(lambda leaf: leaf / speed, rate), {})


_FLOW = Problem(
    initial=lambda flow: Carried(flow.state, {}),
    field=_field,
    observe=lambda angle, y, flow: y.motion,
    summarise=lambda seen, totals: jax.tree.map(lambda leaf: leaf[-1], seen),
)


def advance(
    scene: Scene,
    state: PyTree[Scalar],
    angle: Scalar,
    span: Scalar | float,
    method: Integration,
) -> tuple[PyTree[Scalar], Outcome]:
    """The state `span` radians of shaft angle after `angle`; differentiable by both."""
    times = jnp.full((1, 1), span)
    after, outcome = integrate(_Flow(scene, state, angle), times, problem=_FLOW, method=method)
    return jax.tree.map(lambda leaf: leaf[0], after), outcome


def poincare_section(
    scene: Scene,
    settle_turns: int,
    turns: int,
    *,
    slices: int | None = None,
    state: Float[Array, " dims"] | None = None,
    rtol: float = 1e-9,
    solver: diffrax.AbstractSolver | None = None,
) -> Section:
    """Section points of `turns` turns after `settle_turns` turns.

    **Arguments:**

    - `scene`: with a shaft of constant speed.
    - `slices`: with it, the Jacobian of each of so many slices of a turn comes along; more
      slices for faster growth, since a Jacobian of condition 1e16 holds nothing.
    - `state`: to start from, shape (dims,), in place of the scene's start.
    - `rtol`, `solver`: as in `jaxcrusher.simulate`.

    **Returns:** a `Section`; NaN from a failure on.

    Raises ValueError for counts that are not whole numbers in range, and for a free shaft.
    """
    require_x64()
    require_whole("settle_turns", settle_turns, 0)
    require_whole("turns", turns, 1)
    if slices is not None:
        require_whole("slices", slices, 1)
    free = scene.drive.initial() is not None
    require(not free, "scene", "have a shaft of constant speed", scene.drive)
    method = integration(scene, rtol, solver, None, None, None, 1e-5)
    return _section(scene, settle_turns, turns, slices, state, method)


@eqx.filter_jit
def _section(
    scene: Scene, settle_turns: int, turns: int, slices: int | None, state, method: Integration
) -> Section:
    start, unravel = ravel_pytree(scene.formulation.initial(scene))
    state = start if state is None else jnp.asarray(state, dtype=float)

    def flow(state, angle, span):
        after, outcome = advance(scene, unravel(state), angle, span, method)
        return ravel_pytree(after)[0], outcome

    def turn(carry, _):
        state, before = carry
        after, outcome = flow(state, jnp.zeros(()), 2 * jnp.pi)
        outcome = _first_failure(before, outcome, 2 * jnp.pi)
        return (after, outcome), after

    def sliced_turn(carry, _):
        count = slices or 1
        span = 2 * jnp.pi / count

        def one(carry, angle):
            state, before = carry

            def after(state):
                end, outcome = flow(state, angle, span)
                return end, (end, outcome)

            jacobian, (end, outcome) = jax.jacfwd(after, has_aux=True)(state)
            return (end, _first_failure(before, outcome, span)), jacobian

        carry, jacobians = jax.lax.scan(one, carry, span * jnp.arange(count))
        return carry, (carry[0], jacobians)

    fine = Outcome(RESULTS.promote(diffrax.RESULTS.successful), jnp.zeros(()))
    carry = (state, fine)
    if settle_turns:
        carry, _ = jax.lax.scan(turn, carry, length=settle_turns)
    if slices is None:
        (_, outcome), states = jax.lax.scan(turn, carry, length=turns)
        return Section(states, None, outcome)
    (_, outcome), (states, jacobians) = jax.lax.scan(sliced_turn, carry, length=turns)
    return Section(states, jacobians.reshape(-1, *jacobians.shape[2:]), outcome)


def _first_failure(before: Outcome, outcome: Outcome, span: float) -> Outcome:
    """The outcome of two consecutive pieces; a NaN state makes the second fail at once."""
    reached = before.reached + jnp.where(before.success, outcome.reached, 0)
    return Outcome(RESULTS.where(before.success, outcome.result, before.result), reached)
