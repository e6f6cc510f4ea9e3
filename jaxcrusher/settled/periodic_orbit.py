"""The motion that a crusher settles on, solved for instead of waited for."""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import lu_solve
from jaxtyping import Array, ArrayLike, Bool, Complex, Float, PyTree, Scalar

from jaxcrusher.basics.checks import (
    concrete,
    require,
    require_choice,
    require_double,
    require_whole,
    require_x64,
)
from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher.formulations import ClosedLinkage, EccentricityFormulation
from jaxcrusher.crusher.formulations.eccentricity import EccentricityState
from jaxcrusher.crusher.observables import OBSERVABLES, foundation_force
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.crusher.snapshot import Snapshot
from jaxcrusher.crusher.starts import resting
from jaxcrusher.joint.validity import Validity, validity
from jaxcrusher.motion.section import poincare_section
from jaxcrusher.settled import newton
from jaxcrusher.settled.collocation import System, collocate
from jaxcrusher.settled.multipliers import multipliers
from jaxcrusher.settled.newton import Factors
from jaxcrusher.settled.trigonometric import (
    differentiation,
    evaluate,
    resample,
    summit,
)
from jaxcrusher.settled.trigonometric import nodes as places

# Nodes a turn to begin with, and the most that doubling leads to.
NODES, MOST_NODES = 96, 384
# Where values are known, nodes are doubled until the RMS is known this well; an orbit known no
# better than the second is none.
SETTLED, UNRESOLVED = 1e-8, 1e-4
# Instants a turn at which forces are looked at: the length of a reaction that passes near zero
# bends more sharply than the motion does.
INSTANTS = 1024
# Refinements of the first guess: each adds what the last one's acceleration asks of the contact.
REFINEMENTS = 2
# Of the orbit integrated once round, in clearances and m/s, and the tolerance of doing so.
CLOSURE, RTOL = 1e-6, 1e-11


# What is seen of a snapshot.
Look = Callable[[Snapshot, Scene], PyTree[Scalar]]


class RESULTS(newton.RESULTS):  # pyright: ignore
    """Those of Newton's method, and what a root may fail to be."""

    contact_lost = "The motion loses contact, which these nodes do not resolve."
    unresolved = "The motion is not resolved by these nodes."
    open = "The motion does not repeat when it is integrated over its period."


class PeriodicOrbit(eqx.Module):
    """A motion that repeats after `period` turns; forces in N.

    A failed search has `success` False, NaN in every number, and says why in `failure`. The
    multipliers have no slopes.
    """

    scene: Scene
    period: int = eqx.field(static=True)  # turns
    eccentricity: Float[Array, "nodes 2"] | None  # e / c at equal steps of shaft angle
    result: RESULTS
    steps: Array  # Newton's
    foundation_rms: Scalar  # of |R_O| + |R_C|
    foundation_mean: Scalar
    foundation_peak: Scalar
    error: Scalar  # estimated, of the RMS as a share of it
    least_penetration: Scalar  # least delta / c: contact is kept if it is > 0
    penetration_ratio: Scalar  # largest delta / c
    impact_speed: Scalar  # fastest approach of pin and bore, m/s
    multipliers: Complex[Array, " 4"]  # of a disturbance, in one period; none if ideal
    multipliers_error: Scalar  # estimated
    validity: Validity | None

    @property
    def success(self) -> Bool[Array, ""]:
        """Whether this is an orbit."""
        return self.result == RESULTS.successful

    @property
    def failure(self) -> str:
        """Why there is none, or nothing (concrete values only)."""
        return "" if bool(self.success) else " ".join(str(RESULTS[self.result]).split())

    @property
    def largest_multiplier(self) -> Scalar:
        """The largest modulus."""
        return jnp.max(jnp.abs(self.multipliers), axis=-1, initial=0.0)

    @property
    def stable(self) -> Bool[Array, ""]:
        """Whether disturbances die."""
        return self.success & (self.largest_multiplier < 1)

    @property
    def settling_turns(self) -> Scalar:
        """Turns in which a disturbance falls to 1/e in the end; infinite if it grows."""
        largest = self.largest_multiplier
        return jnp.where(largest < 1, -self.period / jnp.log(jnp.minimum(largest, 1.0)), jnp.inf)

    def state(self, angle: ArrayLike = 0.0) -> EccentricityState:
        """Where the motion is at a shaft angle (rad); it may be handed to a formulation."""
        require(self.eccentricity is not None, "scene", "have a clearance joint", "an ideal one")
        assert self.eccentricity is not None
        place = jnp.asarray(angle) / (2 * np.pi * self.period)
        rate = evaluate(self.eccentricity, place, 1) / self.period
        return _state(evaluate(self.eccentricity, place), rate, self.scene)

    def motion(
        self, angles: Float[ArrayLike, " n"], outputs: tuple[str, ...] = tuple(OBSERVABLES)
    ) -> dict[str, Array]:
        """Observables at any shaft angles (rad), by name, shape (n,) or (n, 2).

        Raises ValueError for a name that `jaxcrusher.crusher.observables.OBSERVABLES` lacks.
        """
        for name in outputs:
            require_choice("outputs", name, tuple(OBSERVABLES))

        def look(angle: Scalar) -> dict[str, Array]:
            state = None if self.eccentricity is None else self.state(angle)
            time = angle / self.scene.drive.speed
            snapshot = self.scene.formulation.snapshot(time, state, self.scene)
            return {name: OBSERVABLES[name](snapshot, self.scene) for name in outputs}

        return jax.vmap(look)(jnp.asarray(angles, dtype=float))


def periodic_orbit(
    scene: Scene,
    *,
    period: int = 1,
    nodes: int | None = None,
    guess: PeriodicOrbit | Float[ArrayLike, "n 2"] | None = None,
) -> PeriodicOrbit:
    """The motion of `scene` that repeats after `period` turns, by Fourier collocation.

    **Arguments:**

    - `scene`: by eccentricity or with an ideal joint, at constant speed, without a tracked impact
      velocity. Its start does not matter. Its numbers may be traced: works under `jax.jit`,
      `jax.vmap`, `jax.grad`, `jax.jacfwd` and `jax.jvp`; slopes by the implicit function theorem.
    - `period`: turns of the shaft, >= 1.
    - `nodes`: even number of shaft angles a turn. None is 96, doubled up to 384 where values are
      known until the RMS stands to 1e-8 of itself.
    - `guess`: a neighbour, or e / c at equally spaced angles of the whole period; None is the pin
      resting in its bore under the ideal joint's force.

    **Returns:** a `PeriodicOrbit`, stable or not: look at `success` and `stable`. Where values are
    known the orbit has been integrated once round its period, and closes.

    Raises ValueError for a period or nodes that are not such numbers, and in one line for a scene
    that is not one of these.
    """
    require_x64()
    require_double("scene", scene)
    require_whole("period", period, 1)
    if nodes is not None:
        require_whole("nodes", nodes, 4)
        require(nodes % 2 == 0, "nodes", "be even", nodes)
    if refused := refusal(scene):
        raise ValueError(f"Argument `scene` must {refused}.")
    if isinstance(guess, PeriodicOrbit):
        guess = guess.eccentricity
    first = None if guess is None else jnp.asarray(guess, dtype=float)
    known = all(concrete(leaf) is not None for leaf in jax.tree.leaves((scene, first)))
    if not known:
        return _solved(scene, first, period, nodes or NODES)
    count = nodes or NODES
    orbit = _solved(scene, first, period, count)
    while nodes is None and not float(orbit.error) <= SETTLED and count < MOST_NODES:
        count *= 2
        near = orbit.eccentricity if bool(orbit.success) else first
        orbit = _solved(scene, near, period, count)
    if bool(orbit.success) and scene.joint is not None and not _closes(orbit):
        return _judged(orbit, RESULTS.open)
    return orbit


def refusal(scene: Scene) -> str:
    """What a scene must be for collocation in the eccentricity and is not, or nothing."""
    if not isinstance(scene.formulation, EccentricityFormulation | ClosedLinkage):
        return "be written by eccentricity, but is written by multipliers"
    if scene.drive.initial() is not None:
        return "turn at constant speed, but its shaft is free: it repeats at a speed not given"
    if scene.joint is None or scene.joint.normal.impact_velocity.initial() is None:
        return ""
    return "have a constant impact velocity, but tracks it: in contact any value repeats itself"


def _state(x: Array, rate: Array, scene: Scene) -> EccentricityState:
    """From e / c and its derivative by the shaft angle."""
    assert scene.joint is not None
    speed = scene.drive.speed * scene.joint.clearance
    return EccentricityState(Vector(x[0], x[1]), Vector(*(speed * rate)), None, None)


def acceleration(
    angle: Scalar, x: Float[Array, "2"], rate: Float[Array, "2"], scene: Scene
) -> Float[Array, "2"]:
    """The second derivative of e / c by the shaft angle."""
    assert scene.joint is not None
    state = _state(x, rate, scene)
    snapshot = scene.formulation.snapshot(angle / scene.drive.speed, state, scene)
    change = scene.formulation.rate(snapshot, state, scene)
    return change.rate.array() / (scene.joint.clearance * scene.drive.speed**2)


def _quasi_static(scene: Scene, period: int, count: int) -> Float[Array, "count 2"]:
    """The pin resting under the force of a motion that its own depth corrects."""
    assert scene.joint is not None
    pace = scene.drive.speed / period
    first, second = (pace**k * matrix for k, matrix in enumerate(differentiation(count), start=1))
    times = 2 * jnp.pi * jnp.asarray(places(count)) / pace
    e = Vector(jnp.zeros(count), jnp.zeros(count))
    along = jax.vmap(resting, in_axes=(0, 0, 0, 0, None))
    for _ in range(1 + REFINEMENTS):
        rate, curvature = (Vector(m @ e.x, m @ e.y) for m in (first, second))
        e = along(times, e, rate, curvature, scene)
    return jnp.stack([e.x, e.y], axis=1) / scene.joint.clearance


@eqx.filter_jit
def _solved(scene: Scene, guess: Array | None, period: int, count: int) -> PeriodicOrbit:
    """The orbit with `count` nodes a turn, as far as one set of nodes can tell."""
    if scene.joint is None:
        return _ideal(scene, period)
    count *= period
    still = jax.lax.stop_gradient(scene)
    start = _quasi_static(still, period, count) if guess is None else resample(guess, count)
    system = System(acceleration, jnp.asarray(2 * np.pi * period), scene)
    x, root = collocate(system, start)
    instants = INSTANTS * period

    def look(snapshot: Snapshot, scene: Scene) -> tuple[Scalar, Scalar, Scalar]:
        assert snapshot.contact is not None and scene.joint is not None
        depth = snapshot.contact.penetration / scene.joint.clearance
        return foundation_force(snapshot, scene), depth, snapshot.contact.penetration_rate

    seen = jax.vmap(lambda *instant: _seen(look, system, *instant))(*system.at(x, instants))
    force, depth, approach = seen
    mean_square = jnp.mean(force**2)
    coarser = jnp.mean(force[::2] ** 2)
    missed = _missed(*jax.lax.stop_gradient((system, x, root.factors)))
    error = (jnp.abs(missed) + jnp.abs(mean_square - coarser)) / (2 * mean_square)
    least = -summit(-depth)
    result = RESULTS.promote(root.result)
    blurred = ~(error <= UNRESOLVED)
    reason = RESULTS.where(least > 0, RESULTS.unresolved, RESULTS.contact_lost)
    result = RESULTS.where((result == RESULTS.successful) & blurred, reason, result)
    found = multipliers(system, x)
    ratio, fastest = summit(depth), summit(approach)
    orbit = PeriodicOrbit(
        scene,
        period,
        x,
        result,
        root.steps,
        jnp.sqrt(mean_square),
        jnp.mean(force),
        summit(force),
        jax.lax.stop_gradient(error),
        least,
        ratio,
        fastest,
        found.values,
        found.error,
        validity(scene.joint, ratio, fastest),
    )
    return _judged(orbit, result)


def _ideal(scene: Scene, period: int) -> PeriodicOrbit:
    """Kinematics alone: a sum over a turn."""
    times = 2 * jnp.pi * jnp.asarray(places(INSTANTS)) / scene.drive.speed

    def force(time: Scalar) -> Scalar:
        return foundation_force(scene.formulation.snapshot(time, None, scene), scene)

    seen = jax.vmap(force)(times)
    mean_square, coarser = jnp.mean(seen**2), jnp.mean(seen[::2] ** 2)
    zero = jnp.zeros_like(mean_square)
    return PeriodicOrbit(
        scene,
        period,
        None,
        RESULTS.promote(newton.RESULTS.successful),
        jnp.array(0),
        jnp.sqrt(mean_square),
        jnp.mean(seen),
        summit(seen),
        jnp.abs(coarser / mean_square - 1) / 2,
        zero,
        zero,
        zero,
        jnp.zeros(0, complex),
        zero,
        None,
    )


def _seen(look: Look, system: System, angle: Scalar, x: Array, rate: Array) -> PyTree[Scalar]:
    """What `look` sees of the snapshot at an instant of the orbit."""
    scene, state = system.args, _state(x, rate, system.args)
    return look(scene.formulation.snapshot(angle / scene.drive.speed, state, scene), scene)


def _missed(system: System, x: Float[Array, "nodes 2"], factors: Factors) -> Scalar:
    """What the nodes miss of the mean square of the force, estimated.

    The defect, zero at the nodes, is what the polynomial cannot follow between them; the dual of
    the mean square says what it matters (Becker and Rannacher, Acta Numerica 10, 2001).
    """

    def square(instant: tuple[Array, Array, Array]) -> tuple[Array, Array]:
        def of(x: Array, rate: Array) -> Scalar:
            return _seen(foundation_force, system, instant[0], x, rate) ** 2

        return jax.jacfwd(of, argnums=(0, 1))(*instant[1:])

    points, pace = 2 * len(x), 2 * np.pi / system.period
    # One by one, as the slopes of the acceleration.
    by_x, by_rate = jax.lax.map(square, system.at(x, len(x)))
    weights = by_x + pace * differentiation(len(x))[0].T @ by_rate
    dual = lu_solve(factors, weights.ravel(), trans=1).reshape(x.shape)
    times, between, rate = system.at(x, points)
    along = jax.vmap(system.acceleration, in_axes=(0, 0, 0, None))
    second = pace**2 * resample(x, points, order=2)
    defect = along(times, between, rate, system.args) - second
    return jnp.mean(jnp.sum(resample(dual, points) * defect, axis=1))


def _closes(orbit: PeriodicOrbit) -> bool:
    """Whether the integrator comes back to where it set out (concrete values only)."""
    start = orbit.state()
    entries = [start.relative_eccentricity.array(), start.rate.array()]
    state = jnp.concatenate(entries)
    end = poincare_section(orbit.scene, 0, orbit.period, state=state, rtol=RTOL)
    return bool(end.outcome.success) and float(jnp.max(jnp.abs(end.states[-1] - state))) < CLOSURE


def _judged(orbit: PeriodicOrbit, result: RESULTS) -> PeriodicOrbit:
    """With its result, and NaN in every number unless that is a success."""

    def number(leaf: Array) -> Array:
        return jnp.where(result == RESULTS.successful, leaf, jnp.nan)

    bare = dataclasses.replace(orbit, scene=None, steps=None)
    masked = jax.tree.map(lambda leaf: number(leaf) if eqx.is_inexact_array(leaf) else leaf, bare)
    return dataclasses.replace(masked, scene=orbit.scene, steps=orbit.steps, result=result)
