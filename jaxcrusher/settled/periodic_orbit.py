"""The motion that a crusher settles on, solved for instead of waited for."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxcrusher.basics.checks import (
    concrete,
    require,
    require_whole,
    require_x64,
)
from jaxcrusher.crusher.scene import Scene, require_scene
from jaxcrusher.crusher.starts import Centred
from jaxcrusher.motion.flow import flat
from jaxcrusher.motion.section import poincare_section
from jaxcrusher.motion.statistic import Chosen, chosen, statistics_of
from jaxcrusher.settled import forced
from jaxcrusher.settled.collocation import collocate
from jaxcrusher.settled.described import Nodes, described, kinematic, of_nodes
from jaxcrusher.settled.result import RESULTS, PeriodicOrbit, judged
from jaxcrusher.settled.shooting import shoot
from jaxcrusher.settled.trigonometric import resample

# Nodes a turn to begin with, and the most that doubling leads to.
NODES, MOST_NODES = 96, 384
# Where values are known, nodes are doubled until the RMS is known this well.
SETTLED = 1e-8
# Of the orbit integrated once round, in clearances and m/s, and the tolerance of doing so.
CLOSURE, RTOL = 1e-6, 1e-11


def periodic_orbit(
    scene: Scene,
    *,
    period: int = 1,
    nodes: int | None = None,
    guess: PeriodicOrbit | Float[ArrayLike, "n 2"] | None = None,
) -> PeriodicOrbit:
    """The motion of `scene` that repeats after `period` turns.

    By Fourier collocation; where that finds contact lost, from there on by shooting.

    **Arguments:**

    - `scene`: by eccentricity or with an ideal joint, at constant speed, without a tracked impact
      velocity. Its start does not matter. Its numbers may be traced: works under `jax.jit`,
      `jax.vmap`, `jax.grad`, `jax.jacfwd` and `jax.jvp`; slopes by the implicit function theorem.
    - `period`: turns of the shaft, >= 1.
    - `nodes`: even number of shaft angles a turn. None is 96, doubled up to 384 where values are
      known until the RMS stands to 1e-8 of itself; only then a motion is shot for.
    - `guess`: a neighbour, or e / c at equally spaced angles of the whole period; None is the pin
      resting in its bore under the ideal joint's force.

    **Returns:** a `PeriodicOrbit`, stable or not: look at `success` and `stable`. Where values are
    known the orbit has been integrated once round its period and closes, with `nodes` given too.
    Where they are traced, as in `jaxcrusher.orbit_map`, nothing is integrated: a success is then an
    orbit of 96 nodes, or as many as given, whose RMS is estimated to be right to 1e-4.

    Raises ValueError for a period or nodes that are not such numbers, and in one line for a scene
    that is not one of these.
    """
    require_x64()
    require_scene(scene)
    require_whole("period", period, 1)
    if nodes is not None:
        require_whole("nodes", nodes, 4)
        require(nodes % 2 == 0, "nodes", "be even", nodes)
    if refused := forced.refusal(scene):
        raise ValueError(f"Argument `scene` must {refused}.")
    if isinstance(guess, PeriodicOrbit):
        guess = guess.eccentricity
    first = None if guess is None else _guess(guess, scene)
    known = all(concrete(leaf) is not None for leaf in jax.tree.leaves((scene, first)))
    count = nodes or NODES
    # Of all starts, which do not matter, one: a program serves all.
    alike = scene if scene.start is None else eqx.tree_at(lambda s: s.start, scene, Centred())

    def solved(guess: Array | None, count: int) -> PeriodicOrbit:
        return dataclasses.replace(_solved(alike, guess, period, count), scene=scene)

    orbit = solved(first, count)
    if not known:
        return judged(orbit, orbit.result)
    is_open = _open(orbit)
    while nodes is None and count < MOST_NODES and (is_open or _blurred(orbit)):
        count *= 2
        orbit = solved(orbit.eccentricity, count)
        is_open = _open(orbit)
    if is_open:
        return judged(orbit, RESULTS.open)
    if nodes is None and bool(_coarse(orbit)):
        found = shoot(scene, flat(orbit.state(), scene), period)
        orbit = found if bool(found.success) else orbit
    return judged(orbit, orbit.result)


def _guess(guess: ArrayLike, scene: Scene) -> Array:
    """Checked: a row of x and y of each joint with clearance at each of some angles."""
    dims, shape = 2 * len(list(scene.joints.present())), np.shape(guess)
    good = len(shape) == 2 and shape[1] == dims and shape[0] > 0
    is_text = np.asarray(guess).dtype.kind in "US" if concrete(guess) is not None else False
    given = repr(guess) if is_text else f"of shape {shape}"
    require(good, "guess", f"be a PeriodicOrbit, or e / c of shape (n, {dims})", given)
    return jnp.asarray(guess, dtype=float)


def _coarse(orbit: PeriodicOrbit) -> Array:
    """Whether Newton's method converged to what the nodes do not resolve."""
    return (orbit.result == RESULTS.contact_lost) | (orbit.result == RESULTS.unresolved)


def _blurred(orbit: PeriodicOrbit) -> bool:
    """Whether more nodes may help (concrete values only)."""
    return bool(_coarse(orbit)) or (bool(orbit.success) and not float(orbit.error) <= SETTLED)


def _solved(scene: Scene, guess: Array | None, period: int, count: int) -> PeriodicOrbit:
    """The orbit with `count` nodes a turn, as far as one set of nodes can tell."""
    outputs = chosen(statistics_of(scene))
    if scene.is_ideal:
        return kinematic(scene, period, outputs)
    # A program of its own, which serves values and slopes.
    found = _found(jax.lax.stop_gradient(scene), guess, period, count * period)
    return _described(scene, found, period, outputs)


@eqx.filter_jit
def _found(scene: Scene, guess: Array | None, period: int, nodes: int) -> Nodes:
    start = forced.quasi_static(scene, period, nodes) if guess is None else resample(guess, nodes)
    system = forced.system(scene, period)
    return of_nodes(system, *collocate(system, start))


@eqx.filter_jit
def _described(scene: Scene, found: Nodes, period: int, outputs: Chosen) -> PeriodicOrbit:
    return described(forced.system(scene, period), found, period, outputs)


def _open(orbit: PeriodicOrbit) -> bool:
    """Whether the integrator does not come back to where it set out (concrete values only)."""
    if not bool(orbit.success) or orbit.scene.is_ideal:
        return False
    start = orbit.state()
    state = flat(start, orbit.scene)
    end = poincare_section(orbit.scene, 0, orbit.period, state=state, rtol=RTOL)
    apart = np.max(np.abs(np.asarray(end.states)[-1] - np.asarray(state)))
    return not (bool(end.success) and apart < CLOSURE)
