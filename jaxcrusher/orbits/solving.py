"""Orbits by collocation, in pure JAX: an eager call and a traced one run the same programs.

Nodes are solved for without slopes; statistics follow from nodes that move with the scene.
"""

import dataclasses
import functools
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.custom_batching import sequential_vmap
from jaxtyping import Array, ArrayLike, Bool, Float, Int, Scalar

from jaxcrusher.basics.checks import is_concrete
from jaxcrusher.basics.loops import design_by_design, one_by_one
from jaxcrusher.mechanism.reductions import SAMPLES, AbstractMean, Chosen, of_slices
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.snapshot import Snapshot
from jaxcrusher.motion.flow import flat
from jaxcrusher.orbits import forced
from jaxcrusher.orbits.damping_homotopy import continued_in_damping
from jaxcrusher.orbits.result import RESULTS, WAYS, PeriodicOrbit, built
from jaxcrusher.periodic import newton
from jaxcrusher.periodic.collocation import Unfactored, attached, collocate
from jaxcrusher.periodic.collocation_problem import MOST_NODES
from jaxcrusher.periodic.multipliers import (
    MORE_STEPS,
    STEPS,
    UNSURE,
    Multipliers,
    undecided,
)
from jaxcrusher.periodic.newton import Factors
from jaxcrusher.periodic.node_errors import Family, NodeErrors, between, dual_error, passed_on
from jaxcrusher.periodic.system import System
from jaxcrusher.periodic.trigonometric import resample

# Nodes a turn to begin with.
NODES = 96
# Nodes are added until the RMS is known this well. Slopes by the clearance, a millionth of the RMS
# for a clearance that grows by all of itself, then have two digits and more.
SETTLED = 1e-8
# An orbit whose RMS is known no better, as a share of it, is none.
UNRESOLVED = 1e-3
# Instants between two of these at which the trigonometric polynomial through them is searched for
# peaks.
FINER = 8
# Steps a period of the multipliers, more of them where the error of the last ones is too large.
COUNTS = (STEPS, *MORE_STEPS)


class Nodes(eqx.Module):
    """Where Newton's method ended, and what is known there without slopes."""

    x: Float[Array, "nodes dims"]
    result: newton.RESULTS
    steps: Int[Array, ""]
    multipliers: Multipliers
    node_errors: NodeErrors
    # Of a motion that begins on the nodes: by what it misses its beginning after a period, in
    # clearances and m/s, and a frame in the units of its state; estimated.
    closure: Scalar
    way: WAYS

    @property
    def multipliers_error(self) -> Scalar:
        """Return the error that steps and nodes leave."""
        return self.multipliers.error + self.node_errors.multipliers

    @property
    def doubted(self) -> Bool[Array, ""]:
        """Whether the error of the nodes alone leaves open if disturbances die."""
        values = self.multipliers.values
        by_steps = undecided(values, self.multipliers.error)
        return undecided(values, self.multipliers_error) & ~by_steps


def of_nodes(
    system: System,
    x: Float[Array, "nodes dims"],
    factors: Factors | None,
    way: WAYS,
    result: newton.RESULTS = newton.RESULTS.successful,
    steps: ArrayLike = 0,
    family: Family | None = None,
    counts: tuple[int, ...] = COUNTS,
) -> Nodes:
    """Return what is known of the orbit through `x`, which may lie on a branch of a `family`.

    `factors` are those of its equations, for the dual that tells the error of the RMS where nothing
    else does; None leaves that unknown. Multipliers take the first of `counts` of steps, and the
    next ones as long as their error is too large.
    """
    scene, solved_for = system.args, result == newton.RESULTS.successful
    look = eqx.Partial(passed_on, observed=forced.acceleration_and_force, family=family)
    found, errors, seen = look(system, x, steps=counts[0])
    known = found, errors

    def resolved(system: System, x: Array, known: tuple, needed: Array) -> tuple:
        for steps in counts[1:]:
            known = jax.lax.cond(
                needed & ~(known[0].error <= UNSURE),
                lambda _, steps=steps: look(system, x, steps=steps)[:2],
                lambda known: known,
                known,
            )
        return known

    # One design after the other, on a GPU too: few need more steps. No branch is one of a batch.
    again = sequential_vmap(resolved) if family is None else resolved
    found, errors = again(system, x, known, solved_for)
    if factors is not None:
        rms = jax.lax.cond(
            jnp.isfinite(errors.rms),
            lambda: errors.rms,
            lambda: dual_error(system, x, factors, seen),
        )
        errors = errors._replace(rms=rms)
    missed, change = jnp.split(found.closure, 2)
    closure = jnp.max(jnp.abs(flat(forced.state(missed, change, scene))))
    return Nodes(x, result, jnp.asarray(steps), found, errors, closure, way)


def orbit_nodes(
    scene: Scene, guess: Float[Array, "angles dims"] | None, period: int, nodes: int
) -> tuple[Nodes, Factors]:
    """Return the orbit near a guess, and the factors for its slopes.

    Without a guess, or with one of NaN, it starts from the pins at rest, then by continuation in a
    damping. One program serves values and slopes; under `jax.vmap` it takes one design after the
    other, since few need the damping. Where values are known, multipliers by more steps and the
    dual, which few orbits need, are further programs, which others do not compile.
    """
    if not is_concrete((scene, guess)):
        return _orbit_nodes(scene, guess, period, nodes, COUNTS)
    found, factors = _orbit_nodes(scene, guess, period, nodes, COUNTS[:1])
    if bool(found.result == newton.RESULTS.successful):
        for steps in COUNTS[1:]:
            if not bool(found.multipliers.error <= UNSURE):
                found = _looked_at_again(scene, found, period, steps)
        if not bool(jnp.isfinite(found.node_errors.rms)):
            rms = _dual_error(scene, found.x, factors, period)
            errors = found.node_errors._replace(rms=rms)
            found = dataclasses.replace(found, node_errors=errors)
    return found, factors


@eqx.filter_jit
def _orbit_nodes(
    scene: Scene, guess: Array | None, period: int, nodes: int, counts: tuple[int, ...]
) -> tuple[Nodes, Factors]:
    @design_by_design
    def found(scene: Scene, guess: Array | None) -> tuple[Nodes, Factors]:
        rest, at_rest = forced.quasi_static(scene, period, nodes), jnp.array(True)
        if guess is not None:
            at_rest = ~jnp.all(jnp.isfinite(guess))
            rest = jnp.where(at_rest, rest, resample(guess, nodes))
        root = continued_in_damping(scene, period, rest, at_rest)
        way = WAYS.where(root.by_damping, WAYS.damping, WAYS.where(at_rest, WAYS.rest, WAYS.guess))
        system, result = forced.system(scene, period), root.result
        factors = root.factors if counts == COUNTS else None
        orbit = of_nodes(system, root.x, factors, way, result, root.steps, counts=counts)
        return orbit, root.factors

    return found(scene, guess)


def _looked_at_again(scene: Scene, found: Nodes, period: int, steps: int) -> Nodes:
    """Return nodes with what more steps tell of them, by one program for all numbers of nodes."""
    seen = _seen_finely(scene, _finely(found.x, period), period, steps)
    best = jnp.where(
        jnp.isfinite(seen.node_errors.rms), seen.node_errors.rms, found.node_errors.rms
    )
    errors = seen.node_errors._replace(rms=best)
    return dataclasses.replace(
        found, multipliers=seen.multipliers, node_errors=errors, closure=seen.closure
    )


@eqx.filter_jit
def _dual_error(scene: Scene, x: Array, factors: Factors, period: int) -> Scalar:
    system = forced.system(scene, period)
    return dual_error(system, x, factors, between(system, x, forced.acceleration_and_force))


@eqx.filter_jit
def _seen_finely(scene: Scene, x: Array, period: int, steps: int) -> Nodes:
    return of_nodes(forced.system(scene, period), x, None, WAYS.guess, counts=(steps,))


def with_statistics(scene: Scene, found: Nodes, factors: Factors, period: int) -> PeriodicOrbit:
    """Return the orbit with the statistics that the table has now.

    Where values are known, one program serves all numbers of nodes.
    """
    outputs = scene.entries()
    if not is_concrete((scene, found)):
        return _with_statistics(scene, found, factors, period, outputs)
    fine = dataclasses.replace(found, x=_finely(found.x, period))
    orbit = _with_statistics(scene, fine, Unfactored(jnp.array(False)), period, outputs)
    return dataclasses.replace(orbit, eccentricity=found.x)


@functools.partial(jax.jit, static_argnums=1)  # one by one its operations take longer
def _finely(x: Float[Array, "nodes dims"], period: int) -> Float[Array, "finer dims"]:
    """Return the most nodes of the polynomial through `x`."""
    return resample(x, max(MOST_NODES * period, len(x)))


@eqx.filter_jit
def _with_statistics(
    scene: Scene, found: Nodes, factors: Factors | Unfactored, period: int, outputs: Chosen
) -> PeriodicOrbit:
    system = forced.system(scene, period)
    return orbit_of_nodes(system, found, attached(system, found.x, factors), period, outputs)


def refined_orbit(scene: Scene, still: Scene, guess: Array | None, period: int) -> PeriodicOrbit:
    """Return the orbit with 96 nodes a turn, or with 384 where these leave the RMS unsettled.

    `still` is the scene without slopes.
    """
    found = _refined(still, guess, period)
    return _refined_orbit_with_slopes(scene, found, period, scene.entries())


class _Refined(eqx.Module):
    """An orbit with many nodes, and the few that it is made of where these settle the RMS."""

    orbit: Nodes
    settled: Bool[Array, ""]  # by the few
    few: Float[Array, "nodes dims"]
    factors: Factors  # of the few


@eqx.filter_jit
def _refined(scene: Scene, guess: Array | None, period: int) -> _Refined:
    """Solve for the orbit; under `jax.vmap` on a CPU one after the other: few need many nodes."""

    @design_by_design
    def found(scene: Scene, guess: Array | None) -> _Refined:
        few, factors = _orbit_nodes(scene, guess, period, NODES * period, COUNTS[:1])
        # Where Newton's method fails more nodes are of no use.
        failed = few.result != newton.RESULTS.successful
        settled = (few.node_errors.rms <= SETTLED) & ~few.doubted
        settled = failed | (settled & (few.multipliers.error <= UNSURE))
        start, system = resample(few.x, MOST_NODES * period), forced.system(scene, period)

        def more() -> Nodes:
            x, root = collocate(system, start)
            told = root.factors, few.way, root.result, root.steps
            return of_nodes(system, x, *told, counts=COUNTS[1:])

        orbit = jax.lax.cond(settled, lambda: dataclasses.replace(few, x=start), more)
        return _Refined(orbit, settled, few.x, factors)

    return found(scene, guess)


@eqx.filter_jit
def _refined_orbit_with_slopes(
    scene: Scene, found: _Refined, period: int, outputs: Chosen
) -> PeriodicOrbit:
    """Return the orbit, with slopes by the equations of the nodes that settled it."""
    system = forced.system(scene, period)
    x = jax.lax.cond(
        found.settled,
        lambda system: resample(attached(system, found.few, found.factors), len(found.orbit.x)),
        lambda system: attached(system, found.orbit.x, Unfactored(~found.settled)),
        system,
    )
    return orbit_of_nodes(system, found.orbit, x, period, outputs)


def orbit_of_nodes(
    system: System, found: Nodes, x: Float[Array, "nodes dims"], period: int, outputs: Chosen
) -> PeriodicOrbit:
    """Return the orbit through `x`: the nodes found, moving with the numbers of `system`."""
    scene, instants = system.args, system.at(x, SAMPLES * period)
    values, error, least = _statistics(forced.snapshot, instants, scene, outputs)
    error += found.node_errors.rms
    result = RESULTS.promote(found.result)
    unresolved = (result == RESULTS.successful) & ~(error <= UNRESOLVED)
    why = RESULTS.where(least > 0, RESULTS.unresolved, RESULTS.contact_lost)
    _, place, rate = (part[0] for part in system.at(x, len(x)))
    return built(
        scene,
        period,
        x,
        flat(forced.state(place, rate, scene)),
        values,
        result=RESULTS.where(unresolved, why, result),
        error=error,
        least_penetration=least,
        multipliers=found.multipliers.values,
        multipliers_error=found.multipliers_error,
        closure=found.closure,
        steps=found.steps,
        way=found.way,
    )


@eqx.filter_jit
def kinematic(scene: Scene, period: int, outputs: Chosen) -> PeriodicOrbit:
    """Return the orbit of ideal joints in a clamped frame: a sum over turns."""
    still = scene.formulation.initial(scene)
    phases = 2 * jnp.pi * jnp.arange(SAMPLES * period, dtype=float) / SAMPLES
    values, error, _ = _statistics(
        lambda time, scene: scene.formulation.snapshot(time, still, scene),
        (phases / scene.drive.speed,),
        scene,
        outputs,
    )
    zero = jnp.zeros(())
    return built(
        scene,
        period,
        None,
        jnp.zeros(0),
        values,
        result=RESULTS.promote(newton.RESULTS.successful),
        error=error,
        least_penetration=jnp.asarray(jnp.inf),
        multipliers=jnp.zeros(0),
        multipliers_error=zero,
        way=WAYS.sum,
    )


def _statistics(
    snapshot: Callable[..., Snapshot],
    instants: tuple[Array, ...],
    scene: Scene,
    outputs: Chosen,
) -> tuple[dict[str, Scalar], Scalar, Scalar]:
    """Reduce snapshots at equal steps to statistics, and to the least penetration.

    Between them comes what half of the snapshots make of the RMS. Means are sums over the
    instants, peaks those of the trigonometric polynomial through them.
    """
    statistics = dict(outputs)
    quantities = dict.fromkeys(statistic.quantity for statistic in statistics.values())

    def look(*instant) -> list[Array]:
        seen = snapshot(*instant)
        return [quantity(seen, scene) for quantity in quantities]

    samples = dict(zip(quantities, one_by_one(look, instants, scene), strict=True))
    turns = len(instants[0]) // SAMPLES

    def reduce(name: str, step: int = 1) -> Scalar:
        how, q = statistics[name].reduction, samples[statistics[name].quantity][::step]
        if isinstance(how, AbstractMean):
            return of_slices(how, how.integrands(q), turns)
        by_turn = jnp.reshape(_finer(q), (turns, -1, *q.shape[1:]))
        return how.of_pieces(jax.vmap(how.of_samples)(by_turn))

    values = {name: reduce(name) for name in statistics}
    error = jnp.abs(reduce(scene.headline, 2) / values[scene.headline] - 1)
    joints = [scene.joints.names[i] for i in scene.dry]
    names = [f"{scene.prefix(joint)}penetration_ratio" for joint in joints]
    depths = [jnp.min(_finer(samples[statistics[name].quantity])) for name in names]
    least = jnp.min(jnp.stack([*depths, jnp.asarray(jnp.inf)]))
    return values, jax.lax.stop_gradient(error), least


def _finer(samples: Float[Array, "n ..."]) -> Float[Array, "m ..."]:
    return resample(samples, FINER * len(samples))
