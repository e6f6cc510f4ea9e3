"""What a rough feed makes of a periodic orbit, by its linear response and to second order."""

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.stats import norm as gauss
from jaxtyping import Array, Float, Scalar
from typing_extensions import override

from jaxcrusher.basics.checks import nan_unless, primal, require, require_kind, require_own_process
from jaxcrusher.basics.loops import one_by_one
from jaxcrusher.files import svg
from jaxcrusher.files.summary import Row, Summarised, Summary, value_text
from jaxcrusher.mechanism.acting import Multiplied, RoughFeed
from jaxcrusher.mechanism.drives import ConstantSpeed
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.orbits import forced
from jaxcrusher.orbits.result import PeriodicOrbit, require_one
from jaxcrusher.periodic.multipliers import of_slopes
from jaxcrusher.periodic.random_forcing import LEAST, Modes, band, mean_variance, modes
from jaxcrusher.periodic.system import System, jacobian
from jaxcrusher.periodic.trigonometric import resample

# Nodes a turn: the response follows the feed up to its bandwidth.
RESPONSE_NODES = 192
# The highest order of a feed: one program serves all bandwidths.
WIDEST = 40.0
# Contact is called lost where it is lost once in so many turns.
TURNS = 1000.0
# A force that rises by more deviations of its rate does not fall: its density underflows.
STEEPEST = 30.0
# Bisections of the logarithm of the scatter there, over this range on either side of a guess.
BISECTIONS, RANGE = 50, math.log(30.0)


class FeedResponse(Summarised, eqx.Module):
    """An orbit under a rough feed: standard deviations by angle, and how often contact is lost.

    Linear in the scatter, but for `expected_rms`. NaN where the orbit is not stable or loses
    contact, and where a multiplier is below 1e-9.
    """

    angle: Float[Array, " nodes"]  # the phase, rad, over the period
    eccentricity: Float[Array, "nodes dims"]  # standard deviations, as `PeriodicOrbit.eccentricity`
    force: Float[Array, " nodes"]  # standard deviation of the headline force, N
    rms: Scalar  # standard deviation of the RMS of one period, N
    expected_rms: Scalar  # RMS over very many turns, to second order in the scatter, N
    losses: Scalar  # times a turn that any joint is expected to lose contact
    losing_scatter: Scalar  # the scatter with which that is once in 1000 turns

    @property
    def chance(self) -> Scalar:
        """Return the chance that a turn loses contact, as if losses came independently."""
        return -jnp.expm1(-self.losses)

    @override
    def _summary(self) -> Summary:
        known = bool(np.all(np.isfinite(self.rms)))
        none = "FAILED: the orbit is not stable, or loses contact under the mean load"
        return Summary(
            f"FeedResponse: {'what a rough feed adds to an orbit' if known else none}",
            [
                Row("rms", value_text(self.rms, "N"), "standard deviation of the RMS of a period"),
                Row("expected_rms", value_text(self.expected_rms, "N"), "RMS over very many turns"),
                Row(
                    "force", value_text(self.force, "N"), "standard deviation of the force by angle"
                ),
                Row("losses", value_text(self.losses, "a turn"), "times that contact is lost"),
                Row(
                    "losing_scatter", value_text(self.losing_scatter, "1"), "loses it in 1000 turns"
                ),
            ],
        )

    @override
    def _picture(self) -> str:
        return svg.curve(self.angle, self.force, "standard deviation of the force by angle")


def feed_response(orbit: PeriodicOrbit) -> FeedResponse:
    """Return the linear response of an orbit to the rough feed of its scene.

    Floquet's modes (`jaxcrusher.periodic.random_forcing`) give the covariance of the
    motion by angle, and Rice's formula how often the elastic force at a joint crosses zero. That
    force, unlike the penetration, is nearly linear in the load. The feed is taken to have
    infinitely many cosines, so that the response is the mean over seeds.

    **Arguments:**

    - `orbit`: by collocation, of a scene with a `load_scatter`: `jaxcrusher.periodic_orbit` finds
      it under the mean load. It may be traced, and slopes are like the orbit's.

    **Returns:** a `FeedResponse`; NaN where the orbit is not found or not stable. An orbit that
    loses contact under the mean load has none.

    Raises ValueError for a scene without scatter or without a clearance, for a shaft whose speed is
    not constant, and for a batch.
    """
    require_own_process()
    require_kind("orbit", orbit, PeriodicOrbit, "jaxcrusher.periodic_orbit(scene)")
    require_one(orbit)
    feeds = _feeds(orbit.scene)
    must = "be of a scene with a load_scatter"
    require(len(feeds) > 0, "orbit", must, "of one whose load repeats")
    require(len(feeds) == 1, "orbit", "be of a scene with one rough feed", f"of {len(feeds)}")
    loose = orbit.eccentricity is not None and not orbit.scene.is_ideal
    require(loose, "orbit", "be of a scene with a clearance joint", "of an ideal one")
    # The feed is random over the shaft's angle, and the response to it is that over the phase.
    even = isinstance(orbit.scene.drive, ConstantSpeed)
    require(even, "orbit", "be of a shaft at constant speed", "of an uneven one")
    known = primal(feeds[0][1].bandwidth)
    narrow = known is None or bool(known <= WIDEST)
    require(narrow, "orbit", f"be of a load_bandwidth of {WIDEST:g} at most", known)
    return _response(orbit)


def _feeds(scene: Scene) -> list[tuple[int, RoughFeed]]:
    """Return the rough feeds of a scene, each with its place among the pushes."""
    return [(i, one) for i, one in enumerate(scene.pushes) if isinstance(one, RoughFeed)]


class _Seen(eqx.Module):
    """Value, slope and second derivative of a quantity by z = (x, x', w) at the nodes."""

    value: Array  # (nodes, ...)
    slope: Array  # (nodes, ..., states)
    hessian: Array  # (nodes, ..., states, states)


@eqx.filter_jit
def _response(orbit: PeriodicOrbit) -> FeedResponse:
    ((_, feed),), period = _feeds(orbit.scene), orbit.period
    about = linearised_about(orbit)
    system, free, multipliers = about.system, about.modes, about.multipliers
    motion, force, depth = about.motion, about.force, about.depth
    count, dims = motion.value.shape
    square = jnp.mean(force.value**2)
    root = jnp.sqrt(square)
    bandwidth = period * feed.bandwidth
    unit = resample(free.covariance(bandwidth), count)
    over = band(bandwidth, period * WIDEST, multipliers)
    by_state = resample(force.value[:, None] * force.slope / root, len(free.excited))
    of_rms = mean_variance(free, over, by_state)
    of_force = jnp.einsum("ia,iab,ib->i", force.slope, unit, force.slope)

    # The mean shifts by what the curvature makes of the variance.
    curved = jnp.einsum("icab,iab->ic", motion.hessian, unit) / 2
    size = count * dims
    matrices = system.matrices(count)
    matrix = jacobian(*about.slopes, matrices).reshape(size, size)
    shift = jnp.linalg.solve(matrix, -curved.ravel()).reshape(count, dims)
    first = matrices[0]
    shifts = jnp.concatenate([shift, first @ shift, jnp.zeros((count, 1))], axis=1)
    shifted = jnp.sum(force.slope * shifts, axis=1)
    shifted += jnp.einsum("iab,iab->i", force.hessian, unit) / 2
    added = jnp.mean(of_force + 2 * force.value * shifted)

    contacts = _crossing(depth, first, unit, dims)
    scatter = feed.scatter
    found = FeedResponse(
        about.angle,
        scatter * jnp.sqrt(jnp.diagonal(unit[:, :dims, :dims], axis1=1, axis2=2)),
        scatter * jnp.sqrt(of_force),
        scatter * jnp.sqrt(of_rms),
        jnp.sqrt(square + scatter**2 * added),
        jnp.exp(contacts.log_losses(jnp.log(scatter))),
        _losing_scatter(contacts),
    )
    known = jnp.all(jnp.abs(multipliers) > LEAST) & (orbit.least_penetration > 0)
    return nan_unless(orbit.stable & known, found)


class Linearised(eqx.Module):
    """The equations about an orbit, with the load's factor 1 + w as a state, and its modes."""

    system: System
    angle: Float[Array, " nodes"]
    motion: _Seen  # x''
    force: _Seen  # the headline one: of a crusher |R_O| + |R_C|
    depth: _Seen  # elastic force of each joint
    slopes: tuple[Array, Array]  # df/dx and df/dx' at the nodes
    multipliers: Array
    modes: Modes


def linearised_about(orbit: PeriodicOrbit) -> Linearised:
    """Return the equations about an orbit under a rough feed."""
    assert orbit.eccentricity is not None
    count = RESPONSE_NODES * orbit.period
    system = forced.system(orbit.scene.steady(), orbit.period)
    x = resample(orbit.eccentricity, count)
    angle, place, rate = system.at(x, count)
    states = jnp.concatenate([place, rate, jnp.zeros((count, 1))], axis=1)
    ((place_of_feed, _),) = _feeds(orbit.scene)
    motion, force, depth = _observed_along(system, angle, states, place_of_feed)
    by_x, by_rate = jnp.split(motion.slope[:, :, :-1], 2, axis=2)
    slopes = by_x, by_rate
    multipliers = of_slopes(slopes, system.period).values  # the orbit's, with slopes
    free = modes(slopes, motion.slope[:, :, -1], system.period, multipliers)
    return Linearised(system, angle, motion, force, depth, slopes, multipliers, free)


def _observed_along(
    system: System, angle: Float[Array, " nodes"], states: Float[Array, "nodes states"], feed: int
) -> tuple[_Seen, _Seen, _Seen]:
    """Return x'', the headline force, and the elastic force of each joint.

    `feed` is the place of the rough feed among the pushes.
    """
    dims = states.shape[1] // 2
    headline = system.args.statistics[system.args.headline].quantity

    def seen(angle: Scalar, state: Array, scene: Scene) -> Array:
        place, rate, factor = state[:dims], state[dims:-1], 1 + state[-1]
        pushes = list(scene.pushes)
        pushes[feed] = Multiplied(pushes[feed], factor)
        scene = dataclasses.replace(scene, pushes=tuple(pushes))
        snapshot = forced.snapshot(angle, place, rate, scene)
        elastic = scene.joints.map(
            lambda joint, contact: joint.normal.elastic_force(contact.penetration),
            snapshot.contacts,
        )
        forces = headline(snapshot, scene), *elastic.values
        return jnp.append(forced.acceleration(angle, place, rate, scene), jnp.stack(forces))

    def along(angle: Scalar, state: Array, one: Array, other: Array, scene: Scene) -> _Seen:
        def slope(state: Array) -> tuple[Array, Array]:
            return jax.jvp(lambda state: seen(angle, state, scene), (state,), (one,))

        (value, sloped), (_, curved) = jax.jvp(slope, (state,), (other,))
        return _Seen(value, sloped, curved)

    # Pair by pair of directions: all at once, in reverse, take XLA ten minutes to compile.
    size = states.shape[1]
    first, second = np.triu_indices(size)
    pair = np.zeros((size, size), int)
    pair[first, second] = pair[second, first] = np.arange(len(first))
    at = [jnp.repeat(part, len(first), axis=0) for part in (angle, states)]
    towards = [jnp.tile(np.eye(size)[which], (len(angle), 1)) for which in (first, second)]
    every = one_by_one(along, (*at, *towards), system.args)
    every = jax.tree.map(lambda leaf: leaf.reshape(len(angle), len(first), -1), every)
    found = _Seen(
        every.value[:, 0],
        jnp.moveaxis(every.slope[:, np.diagonal(pair)], 1, 2),
        jnp.moveaxis(every.hessian[:, pair], 3, 1),
    )
    parts = slice(dims), dims, slice(dims + 1, None)
    return tuple(jax.tree.map(lambda leaf, part=part: leaf[:, part], found) for part in parts)


class _Crossing(eqx.Module):
    """Elastic forces of joints and of their rates by angle, at a scatter of one."""

    mean: Float[Array, "nodes joints"]
    mean_rate: Float[Array, "nodes joints"]
    variance: Float[Array, "nodes joints"]
    both: Float[Array, "nodes joints"]  # covariance of force and rate
    rate_variance: Float[Array, "nodes joints"]

    def log_losses(self, log_scatter: Scalar) -> Scalar:
        """Return the logarithm of the expected downward crossings of zero a turn.

        Rice's, by the rate given a force of zero (Cramer and Leadbetter 1967, chapter 13).
        """
        scatter, deviation = jnp.exp(log_scatter), jnp.sqrt(self.variance)
        depth = self.mean / (scatter * deviation)
        drift = self.mean_rate - self.both / self.variance * self.mean
        spread = scatter * jnp.sqrt(self.rate_variance - self.both**2 / self.variance)
        z = jnp.minimum(drift / spread, STEEPEST)
        # A mean that falls fast is E max(-rate, 0) = spread (phi(z) - z Phi(-z)).
        falls = spread * (gauss.pdf(z) - z * gauss.cdf(-z))
        logs = gauss.logpdf(depth) + jnp.log(falls / (scatter * deviation))
        return jax.nn.logsumexp(logs) + jnp.log(2 * np.pi / len(logs))


def _crossing(depth: _Seen, first: Array, unit: Array, dims: int) -> _Crossing:
    """Return what Rice's formula takes; the elastic force depends on x alone."""
    by_x = depth.slope[:, :, :dims]
    turning = jnp.einsum("ij,jca->ica", first, by_x)
    rate = jnp.concatenate([turning, by_x], axis=2)
    force = jnp.zeros_like(rate).at[:, :, :dims].set(by_x)
    of = unit[:, : 2 * dims, : 2 * dims]

    def product(one: Array, other: Array) -> Array:
        return jnp.einsum("ica,iab,icb->ic", one, of, other)

    return _Crossing(
        depth.value,
        first @ depth.value,
        product(force, force),
        product(force, rate),
        product(rate, rate),
    )


def _losing_scatter(contacts: _Crossing) -> Scalar:
    """Return the scatter with which contact is lost once in `TURNS`, with slopes."""
    wanted, still = -math.log(TURNS), jax.lax.stop_gradient(contacts)
    # Where the shallowest force is as many deviations deep as a turn in so many is.
    least = jnp.min(still.mean / jnp.sqrt(still.variance))
    middle = jnp.log(least / math.sqrt(2 * math.log(TURNS)))

    def halved(_, ends: tuple[Array, Array]) -> tuple[Array, Array]:
        low, high = ends
        mid = (low + high) / 2
        more = still.log_losses(mid) < wanted
        return jnp.where(more, mid, low), jnp.where(more, high, mid)

    low, high = jax.lax.fori_loop(0, BISECTIONS, halved, (middle - RANGE, middle + RANGE))
    root = (low + high) / 2
    # A step of Newton's, whose slopes are those of the implicit function.
    steep = jax.grad(still.log_losses)(root)
    return jnp.exp(root - (contacts.log_losses(root) - wanted) / steep)
