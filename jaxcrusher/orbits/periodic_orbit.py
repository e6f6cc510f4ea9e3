"""The motion that a machine settles on, solved for without its transient."""

import dataclasses
from collections.abc import Callable
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxcrusher.basics.checks import (
    concrete,
    primal,
    require,
    require_choice,
    require_whole,
    without_slopes,
)
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.mechanism.scene import Scene, require_scene
from jaxcrusher.mechanism.starts import Centred
from jaxcrusher.orbits import forced
from jaxcrusher.orbits.effort import Budget
from jaxcrusher.orbits.impact_velocities import held, settled_velocities
from jaxcrusher.orbits.result import RESULTS, PeriodicOrbit, finished, missing
from jaxcrusher.orbits.search import Attempt, OrbitSearch, searched, shot_for, shot_once
from jaxcrusher.orbits.solving import kinematic, orbit_nodes, refined_orbit, with_statistics
from jaxcrusher.orbits.transient import Lone


def periodic_orbit(
    scene: Scene,
    *,
    period: int | None = None,
    nodes: int | None = None,
    guess: PeriodicOrbit | Float[ArrayLike, "n dims"] | Float[ArrayLike, " states"] | None = None,
    method: Literal["shooting"] | None = None,
    effort: Literal["quick", "usual", "thorough"] = "usual",
) -> PeriodicOrbit:
    """Return the motion of `scene` that repeats after `period` turns.

    Fourier collocation begins from the pins at rest, or by continuation in a damping that is
    lowered to zero. Where values are known, further ways are tried until an orbit is stable
    (`jaxcrusher.orbits.search`): the transient is integrated over up to 1920 turns, and the orbit
    solved for from there, by shooting if it loses contact.

    **Arguments:**

    - `scene`: by eccentricity or with an ideal joint, at constant speed. Its start matters only for
      a tracked impact velocity, which is held at its final value from there; the scene's values
      must then be known. With a rough feed the orbit is that under the mean load: see
      `jaxcrusher.feed_response`. Numbers may be traced by `jax.jit`, `jax.vmap`, `jax.grad`,
      `jax.jacfwd` and `jax.jvp`; slopes by the implicit function theorem.
    - `period`: turns of the shaft, >= 1. None is the guess's period, or 1; or 2 to 4, with the
      effort "thorough" up to 12, where the integrated motion repeats so.
    - `nodes`: even number of nodes a turn. None is 96, and more, up to 384, until the error of the
      RMS is 1e-8 of it. With a number given no transient is integrated.
    - `guess`: a neighbouring orbit, or e / c at equally spaced phases of the whole period; None, or
      NaN, is the pin resting in its bore under the ideal joint's force. For shooting, a
      neighbouring orbit or a section point, shape (states,); None is the mean of turns of the
      transient.
    - `method`: "shooting" solves for the section point by the integrator alone, which an impact
      does not disturb, also under `jax.jit`. None is collocation and the further ways above, or
      shooting where a bearing has a memory, as bristles do.
    - `effort`: "quick" takes 96 nodes only, integrates 480 turns at most and does no shooting.
      "usual" tries all ways, cheap ones first, and ends after four million steps of the integrator
      (`jaxcrusher.orbits.effort`): an answer takes seconds, besides compilation, also where there
      is no orbit. "thorough" has no such bound, and integrates up to 7680 turns. It does not matter
      where a `method` is given; where `nodes` are given it bounds the integration of multipliers
      alone. Ctrl-C ends a search with a KeyboardInterrupt that says what is known.

    **Returns:** a `PeriodicOrbit`, stable or not: look at `success` and `stable`. `found` says by
    which way it was found, and `failure` what the motion does if it has no orbit. An orbit whose
    RMS is not known to 1e-3 is a failure. One whose largest multiplier is 1 within its estimated
    error is not called stable, but `undecided`.

    Values are known outside of `jax.jit` and `jax.vmap`, and inside of `jax.grad` alone. A motion
    that begins on the orbit then comes back to its beginning within 1e-6 clearances and m/s. The
    variational equations check this from the defect between the nodes; where they leave a doubt,
    the motion is integrated over one period. Under `jax.jit` and `jax.vmap` only collocation is
    used, with 96 nodes a turn or 384 where these do not settle the RMS, unless shooting is asked
    for. An orbit that loses contact has slopes too; slopes of multipliers and of failures are NaN.

    Raises ValueError for an invalid period, nodes or method, and in one line for a scene that is
    not as above.
    """
    return orbit_by(
        Lone(), scene, period=period, nodes=nodes, guess=guess, method=method, effort=effort
    )


def orbit_by(
    runs: Lone,
    scene: Scene,
    *,
    period: int | None = None,
    nodes: int | None = None,
    guess: PeriodicOrbit | ArrayLike | None = None,
    method: Literal["shooting"] | None = None,
    effort: str = "usual",
    first: Callable[[OrbitSearch], Attempt] | None = None,
) -> PeriodicOrbit:
    """Return the orbit as `periodic_orbit` does, with turns by `runs`.

    The `first` try may be known. None is Newton's method from the guess, or from the pins at rest.
    """
    require_set_up()
    require_scene(scene)
    if period is None and isinstance(guess, PeriodicOrbit):
        period = guess.period
    turns = 1 if period is None else period
    require_whole("period", turns, 1)
    if nodes is not None:
        require_whole("nodes", nodes, 4)
        require(nodes % 2 == 0, "nodes", "be even", nodes)
    is_known = all(primal(leaf) is not None for leaf in jax.tree.leaves(scene))
    # A tracked velocity is held where values are known, at whatever it comes to.
    somehow = scene
    if is_known and forced.tracks(scene):
        somehow = held(scene, dict.fromkeys(forced.tracking(scene), 1.0))
    if refused := forced.unrepeatable(somehow):
        raise ValueError(f"Argument `scene` must {refused}.")
    # Shooting that is asked for is not bounded, and nodes that are given wait for nothing.
    velocities, budget = None, Budget(effort if method is None else "thorough")
    if forced.remembers(somehow):
        must = "be None for a bearing that remembers, whose orbits are shot for"
        require(nodes is None, "nodes", must, nodes)
        method = "shooting"
    if forced.tracks(scene):
        velocities = settled_velocities(jax.lax.stop_gradient(scene.steady()), budget)
        if velocities is None:
            none = missing(scene, turns, RESULTS.impacts)
            return finished(dataclasses.replace(none, tried=str(budget)), scene)
        scene = held(scene, velocities)
    if method is not None:
        require_choice("method", method, ("shooting",))
        require(nodes is None, "nodes", 'be None with method="shooting"', nodes)
        require(not scene.is_ideal, "scene", "have a clearance joint to shoot for", "an ideal one")
    path, begin = None, None
    if isinstance(guess, PeriodicOrbit):
        path, begin = _guess(guess.eccentricity, scene), guess.section
    elif guess is not None and method is not None:
        begin = _section(guess, scene)
    elif guess is not None:
        path = _guess(guess, scene)
    # The start does not matter: with the same for all, one program serves all.
    alike = scene.steady()
    if not isinstance(scene.start, Centred | None):
        alike = dataclasses.replace(alike, start=Centred())
    still, path, begin = without_slopes((alike, path, begin))
    known = all(primal(leaf) is not None for leaf in jax.tree.leaves((still, path, begin)))
    if not scene.has_unknowns:
        orbit = kinematic(alike, turns, scene.entries())
    elif known:
        search = OrbitSearch(alike, still, path, begin, period, budget, runs)
        if first is not None:
            search = search._replace(first=first(search))
        # Tries that fail are NaN; what comes out of all of them is looked at below.
        with jax.debug_nans(False):
            orbit = searched(search, nodes) if method is None else shot_for(search)
    elif method is not None:
        orbit = shot_once(alike, still, begin, turns)
    elif nodes is not None:
        orbit = with_statistics(alike, *orbit_nodes(still, path, turns, nodes * turns), turns)
    else:
        orbit = refined_orbit(alike, still, path, turns)
    return finished(orbit, scene, velocities)


def _section(guess: ArrayLike, scene: Scene) -> Array:
    """Check a section point that is to be shot from."""
    states, shape = (forced.states(scene),), np.shape(guess)  # pyright: ignore
    required = f"be a PeriodicOrbit, or a section point of shape {states}"
    require(shape == states, "guess", required, f"of shape {shape}")
    return jnp.asarray(guess, dtype=float)


def _guess(guess: ArrayLike | None, scene: Scene) -> Array:
    """Check a guess: a row of all unknowns at each of some phases."""
    dims, shape = forced.unknowns(scene), np.shape(guess)  # pyright: ignore
    good = len(shape) == 2 and shape[1] == dims and shape[0] > 0
    is_text = np.asarray(guess).dtype.kind in "US" if concrete(guess) is not None else False
    given = repr(guess) if is_text else f"of shape {shape}"
    require(good, "guess", f"be a PeriodicOrbit, or e / c of shape (n, {dims})", given)
    return jnp.asarray(guess, dtype=float)
