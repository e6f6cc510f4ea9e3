"""The motion that a crusher settles on, solved for instead of waited for."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxcrusher.basics.checks import (
    concrete,
    primal,
    require,
    require_whole,
)
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.crusher.rough_feed import steady
from jaxcrusher.crusher.scene import Scene, require_scene
from jaxcrusher.crusher.starts import Centred
from jaxcrusher.motion.statistic import chosen, statistics_of
from jaxcrusher.orbits import forced
from jaxcrusher.orbits.refining import refined
from jaxcrusher.orbits.result import PeriodicOrbit, finished
from jaxcrusher.orbits.solving import kinematic, solved, solved_as_needed, with_statistics


def periodic_orbit(
    scene: Scene,
    *,
    period: int | None = None,
    nodes: int | None = None,
    guess: PeriodicOrbit | Float[ArrayLike, "n dims"] | None = None,
) -> PeriodicOrbit:
    """Return the motion of `scene` that repeats after `period` turns.

    By Fourier collocation. Where values are known, a motion that collocation does not find is
    waited for over some hundred turns and solved for from there, by shooting if it loses contact.

    **Arguments:**

    - `scene`: by eccentricity or with an ideal joint, at constant speed, without a tracked impact
      velocity. Its start does not matter. Of a rough feed it is the orbit under the mean load: see
      `jaxcrusher.feed_response`. Its numbers may be traced: works under `jax.jit`,
      `jax.vmap`, `jax.grad`, `jax.jacfwd` and `jax.jvp`; slopes by the implicit function theorem.
    - `period`: turns of the shaft, >= 1; None is the guess's, or 1.
    - `nodes`: even number of shaft angles a turn. None is 96, and more, up to 384, until the RMS
      stands to 1e-8 of itself. With a number given nothing is waited for.
    - `guess`: a neighbour, or e / c at equally spaced angles of the whole period; None is the pin
      resting in its bore under the ideal joint's force.

    **Returns:** a `PeriodicOrbit`, stable or not: look at `success` and `stable`. An orbit whose
    RMS is not known to 1e-3 is a failure. One whose largest multiplier is 1 within its estimated
    error is not called stable.

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
    alike = steady(scene)
    alike = alike if scene.start is None else eqx.tree_at(lambda s: s.start, alike, Centred())
    still, first, begin = jax.lax.stop_gradient((alike, first, begin))
    known = all(primal(leaf) is not None for leaf in jax.tree.leaves((still, first, begin)))
    if forced.unknowns(scene) == 0:
        orbit = kinematic(alike, period, chosen(statistics_of(scene)))
    elif nodes is not None and not known:
        orbit = with_statistics(alike, *solved(still, first, period, nodes * period), period)
    elif not known:
        orbit = solved_as_needed(alike, still, first, period)
    else:
        orbit = refined(alike, still, first, begin, period, nodes)
    return finished(dataclasses.replace(orbit, scene=scene))


def _guess(guess: ArrayLike | None, scene: Scene) -> Array:
    """Check a guess: a row of all unknowns at each of some angles."""
    dims, shape = forced.unknowns(scene), np.shape(guess)  # pyright: ignore
    good = len(shape) == 2 and shape[1] == dims and shape[0] > 0
    is_text = np.asarray(guess).dtype.kind in "US" if concrete(guess) is not None else False
    given = repr(guess) if is_text else f"of shape {shape}"
    require(good, "guess", f"be a PeriodicOrbit, or e / c of shape (n, {dims})", given)
    return jnp.asarray(guess, dtype=float)
