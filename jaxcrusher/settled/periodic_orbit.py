"""The motion that a crusher settles on, solved for instead of waited for."""

import dataclasses
import itertools
from collections.abc import Iterator

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_batching import sequential_vmap
from jaxtyping import Array, ArrayLike, Bool, Float

from jaxcrusher.basics.checks import (
    concrete,
    primal,
    require,
    require_whole,
)
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.crusher.scene import Scene, require_scene
from jaxcrusher.crusher.starts import Centred
from jaxcrusher.motion.section import poincare_section
from jaxcrusher.motion.statistic import Chosen, chosen, statistics_of
from jaxcrusher.settled import forced, newton
from jaxcrusher.settled.collocation import Unfactored, attached, collocate
from jaxcrusher.settled.described import Nodes, described, kinematic, of_nodes
from jaxcrusher.settled.result import RESULTS, PeriodicOrbit, finished, without_slopes
from jaxcrusher.settled.shooting import shoot
from jaxcrusher.settled.transient import guesses
from jaxcrusher.settled.trigonometric import resample

# Nodes a turn to begin with, and the most that doubling leads to.
NODES, MOST_NODES = 96, 384
# Nodes are added until the RMS is known this well. Slopes by the clearance, a millionth of the RMS
# for a clearance that grows by all of itself, then have two digits and more.
SETTLED = 1e-8
# Of the orbit integrated once round, in clearances and m/s, and the tolerance of doing so.
CLOSURE, RTOL = 1e-6, 1e-11

_Found = tuple[Nodes, newton.Factors]


def periodic_orbit(
    scene: Scene,
    *,
    period: int | None = None,
    nodes: int | None = None,
    guess: PeriodicOrbit | Float[ArrayLike, "n dims"] | None = None,
) -> PeriodicOrbit:
    """The motion of `scene` that repeats after `period` turns.

    By Fourier collocation. Where values are known, a motion that collocation does not find is
    waited for over some hundred turns and solved for from there, by shooting if it loses contact.

    **Arguments:**

    - `scene`: by eccentricity or with an ideal joint, at constant speed, without a tracked impact
      velocity. Its start does not matter. Its numbers may be traced: works under `jax.jit`,
      `jax.vmap`, `jax.grad`, `jax.jacfwd` and `jax.jvp`; slopes by the implicit function theorem.
    - `period`: turns of the shaft, >= 1; None is the guess's, or 1.
    - `nodes`: even number of shaft angles a turn. None is 96, and more, up to 384, until the RMS
      stands to 1e-8 of itself. With a number given nothing is waited for.
    - `guess`: a neighbour, or e / c at equally spaced angles of the whole period; None is the pin
      resting in its bore under the ideal joint's force.

    **Returns:** a `PeriodicOrbit`, stable or not: look at `success` and `stable`. An orbit whose
    RMS is not known to 1e-4 is a failure.

    Values are known outside of `jax.jit` and `jax.vmap`, and inside of `jax.grad` alone. The orbit
    has then been integrated once round its period and closes. Under `jax.jit` and `jax.vmap`
    nothing is integrated: collocation has 96 nodes a turn, or 384 where these do not settle the
    RMS. Slopes of an orbit found by shooting are NaN, as are those of multipliers and of failures.

    Raises ValueError for a period or nodes that are not such numbers, and in one line for a scene
    that is not one of these.
    """
    require_set_up()
    require_scene(scene)
    if period is None:
        period = guess.period if isinstance(guess, PeriodicOrbit) else 1
    require_whole("period", period, 1)
    if nodes is not None:
        require_whole("nodes", nodes, 4)
        require(nodes % 2 == 0, "nodes", "be even", nodes)
    if refused := forced.refusal(scene):
        raise ValueError(f"Argument `scene` must {refused}.")
    first, begin = None, None
    if isinstance(guess, PeriodicOrbit):
        first, begin = _guess(guess.eccentricity, scene), guess.section
    elif guess is not None:
        first = _guess(guess, scene)
    # The start does not matter: with the same for all, one program serves all.
    alike = scene if scene.start is None else eqx.tree_at(lambda s: s.start, scene, Centred())
    still, first, begin = jax.lax.stop_gradient((alike, first, begin))
    known = all(primal(leaf) is not None for leaf in jax.tree.leaves((still, first, begin)))
    if scene.is_ideal:
        orbit = kinematic(alike, period, chosen(statistics_of(scene)))
    elif nodes is not None and not known:
        orbit = _described(alike, *_found(still, first, period, nodes * period), period)
    elif not known:
        outputs = chosen(statistics_of(scene))
        orbit = _refined_described(alike, _refined(still, first, period), period, outputs)
    else:
        orbit = _searched(alike, still, first, begin, period, nodes)
    return finished(dataclasses.replace(orbit, scene=scene))


def _guess(guess: ArrayLike | None, scene: Scene) -> Array:
    """Checked: a row of x and y of each joint with clearance at each of some angles."""
    dims, shape = 2 * len(list(scene.joints.present())), np.shape(guess)  # pyright: ignore
    good = len(shape) == 2 and shape[1] == dims and shape[0] > 0
    is_text = np.asarray(guess).dtype.kind in "US" if concrete(guess) is not None else False
    given = repr(guess) if is_text else f"of shape {shape}"
    require(good, "guess", f"be a PeriodicOrbit, or e / c of shape (n, {dims})", given)
    return jnp.asarray(guess, dtype=float)


def _searched(
    scene: Scene,
    still: Scene,
    guess: Array | None,
    begin: Array | None,
    period: int,
    nodes: int | None,
) -> PeriodicOrbit:
    """Search for the orbit of a scene whose values `still` are known.

    `begin` is the section point of a guess, which may lose contact. Where all tries fail, the
    first one says why.
    """
    first = _collocated(still, guess, period, nodes)
    tries = itertools.chain([first], _further(still, first[1], begin, period) if not nodes else ())
    found, orbit = next((one for one in tries if bool(one[1].success)), first)
    if not any(concrete(leaf) is None for leaf in jax.tree.leaves(scene)):
        return orbit
    if found is None or not bool(orbit.success):
        return without_slopes(orbit, scene)
    return _described(scene, *found, period)


def _further(
    scene: Scene, failed: PeriodicOrbit, begin: Array | None, period: int
) -> Iterator[tuple[_Found | None, PeriodicOrbit]]:
    """Try what is left where collocation fails: shooting, and a motion that is waited for."""
    if begin is not None:
        yield None, shoot(scene, begin, period)
    if _is_coarse(failed):
        # What Newton's method converged to is near the orbit that loses contact.
        yield None, shoot(scene, failed.section, period)
    for mean, seen in guesses(scene, period):
        yield _collocated(scene, seen, period, None)
        yield None, shoot(scene, mean, period)


def _collocated(
    scene: Scene, guess: Array | None, period: int, nodes: int | None
) -> tuple[_Found, PeriodicOrbit]:
    """The orbit with as many nodes as it needs, or as are given; known values only."""
    count = nodes or NODES

    def solved(guess: Array | None, count: int) -> tuple[_Found, PeriodicOrbit, bool]:
        found = _found(scene, guess, period, count * period)
        orbit = _described(scene, *found, period)
        return found, orbit, _is_open(orbit)

    found, orbit, is_open = solved(guess, count)
    while nodes is None and count < MOST_NODES and (is_open or _is_blurred(orbit)):
        count *= 2
        found, orbit, is_open = solved(orbit.eccentricity, count)
    if is_open:
        orbit = dataclasses.replace(orbit, result=RESULTS.open)
    return found, orbit


def _is_coarse(orbit: PeriodicOrbit) -> bool:
    """Whether Newton's method converged to what the nodes do not resolve."""
    return bool((orbit.result == RESULTS.contact_lost) | (orbit.result == RESULTS.unresolved))


def _is_blurred(orbit: PeriodicOrbit) -> bool:
    """Whether more nodes may help."""
    return _is_coarse(orbit) or (bool(orbit.success) and not float(orbit.error) <= SETTLED)


def _is_open(orbit: PeriodicOrbit) -> bool:
    """Whether the integrator does not come back to where it set out."""
    if not bool(orbit.success):
        return False
    state = orbit.section
    end = poincare_section(orbit.scene, 0, orbit.period, state=state, rtol=RTOL)
    apart = np.max(np.abs(np.asarray(end.states)[-1] - np.asarray(state)))
    return not (bool(end.success) and apart < CLOSURE)


@eqx.filter_jit
def _found(
    scene: Scene, guess: Array | None, period: int, nodes: int
) -> tuple[Nodes, newton.Factors]:
    """The orbit near a guess; a program of its own, which serves values and slopes."""
    start = forced.quasi_static(scene, period, nodes) if guess is None else resample(guess, nodes)
    system = forced.system(scene, period)
    return of_nodes(system, *collocate(system, start))


@eqx.filter_jit
def _with_statistics(
    scene: Scene, found: Nodes, factors: newton.Factors, period: int, outputs: Chosen
) -> PeriodicOrbit:
    system = forced.system(scene, period)
    return described(system, found, attached(system, found.x, factors), period, outputs)


def _described(scene: Scene, found: Nodes, factors: newton.Factors, period: int) -> PeriodicOrbit:
    """The orbit with the statistics that the table has now."""
    return _with_statistics(scene, found, factors, period, chosen(statistics_of(scene)))


class _Refined(eqx.Module):
    """An orbit with many nodes, and the few that it is made of where these settle the RMS."""

    orbit: Nodes
    settled: Bool[Array, ""]  # by the few
    few: Float[Array, "nodes dims"]
    factors: newton.Factors  # of the few


@eqx.filter_jit
def _refined(scene: Scene, guess: Array | None, period: int) -> _Refined:
    """The orbit with 96 nodes a turn, or with 384 where these leave the RMS unsettled.

    Under `jax.vmap` one design after the other, for few of them need the many nodes.
    """

    @sequential_vmap
    def found(scene: Scene, guess: Array | None) -> _Refined:
        few, factors = _found(scene, guess, period, NODES * period)
        # Where Newton's method fails more nodes are of no use.
        failed = few.result != newton.RESULTS.successful
        settled = failed | (few.missed <= SETTLED)
        start = resample(few.x, MOST_NODES * period)
        orbit = jax.lax.cond(
            settled,
            lambda: dataclasses.replace(few, x=start),
            lambda: _found(scene, start, period, MOST_NODES * period)[0],
        )
        return _Refined(orbit, settled, few.x, factors)

    return found(scene, guess)


@eqx.filter_jit
def _refined_described(
    scene: Scene, found: _Refined, period: int, outputs: Chosen
) -> PeriodicOrbit:
    """The orbit, with slopes by the equations of the nodes that settled it."""
    system = forced.system(scene, period)
    x = jax.lax.cond(
        found.settled,
        lambda system: resample(attached(system, found.few, found.factors), len(found.orbit.x)),
        lambda system: attached(system, found.orbit.x, Unfactored(~found.settled)),
        system,
    )
    return described(system, found.orbit, x, period, outputs)
