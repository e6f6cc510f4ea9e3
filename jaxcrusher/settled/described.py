"""What is known of an orbit through nodes: its statistics, its multipliers, and their errors."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, Scalar

from jaxcrusher.crusher.joints import before
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.crusher.snapshot import Snapshot
from jaxcrusher.joint.validity import validity
from jaxcrusher.motion.flow import flat
from jaxcrusher.motion.statistic import Chosen, PowerMean
from jaxcrusher.motion.statistics import limits_of
from jaxcrusher.settled import forced, newton
from jaxcrusher.settled.collocation import System, one_by_one
from jaxcrusher.settled.multipliers import LOOKS, Multipliers, of_slopes
from jaxcrusher.settled.newton import Factors
from jaxcrusher.settled.result import RESULTS, PeriodicOrbit
from jaxcrusher.settled.trigonometric import resample

# An orbit whose RMS is known no better, as a share of it, is none.
UNRESOLVED = 1e-3
# Instants a turn at which forces are looked at: the length of a reaction that passes near zero
# bends more sharply than the motion does.
INSTANTS = 1024
# Instants between two of these at which the trigonometric polynomial through them is searched for
# peaks.
FINER = 8


class Nodes(eqx.Module):
    """Where Newton's method ended, and what is known there without slopes."""

    x: Float[Array, "nodes dims"]
    result: newton.RESULTS
    steps: Int[Array, ""]
    missed: Scalar  # of the RMS of the force, as a share of it; estimated
    multipliers: Multipliers


def of_nodes(
    system: System, x: Float[Array, "nodes dims"], root: newton.Root
) -> tuple[Nodes, Factors]:
    """What is known of the orbit through `x`, and the factors that its slopes take."""
    slopes, accelerations = system.slopes(*system.at(x, max(LOOKS, 2 * len(x))))
    missed = forced.missed(system, x, root.factors, accelerations)
    multipliers = of_slopes(slopes, system.period)
    return Nodes(x, root.result, root.steps, missed, multipliers), root.factors


def described(
    system: System, found: Nodes, x: Float[Array, "nodes dims"], period: int, outputs: Chosen
) -> PeriodicOrbit:
    """The orbit through `x`: the nodes found, moving with the numbers of `system`."""
    scene, instants = system.args, system.at(x, INSTANTS * period)
    values, error, least = _statistics(forced.snapshot, instants, scene, outputs)
    error += found.missed
    reason = RESULTS.where(least > 0, RESULTS.unresolved, RESULTS.contact_lost)
    result = RESULTS.promote(found.result)
    blurred = (result == RESULTS.successful) & ~(error <= UNRESOLVED)
    result = RESULTS.where(blurred, reason, result)
    limits, multipliers = limits_of(scene, values), found.multipliers
    assert limits is not None
    _, place, rate = (part[0] for part in system.at(x, len(x)))
    section = flat(forced.state(place, rate, scene), scene)
    numbers = values, error, least, multipliers.values, multipliers.error, limits
    return PeriodicOrbit(scene, period, x, section, result, found.steps, *numbers)


@eqx.filter_jit
def kinematic(scene: Scene, period: int, outputs: Chosen) -> PeriodicOrbit:
    """That of ideal joints: a sum over turns."""
    zero, angles = jnp.zeros(()), 2 * jnp.pi * jnp.arange(INSTANTS * period) / INSTANTS
    values, error, _ = _statistics(
        lambda time, scene: scene.formulation.snapshot(time, None, scene),
        (angles / scene.drive.speed,),
        scene,
        outputs,
    )
    result, limits = RESULTS.promote(newton.RESULTS.successful), validity(None, zero, zero)
    none = jnp.zeros(0, complex)
    numbers = jnp.array(0), values, error, zero, none, zero, limits
    return PeriodicOrbit(scene, period, None, jnp.zeros(0), result, *numbers)


def _statistics(
    snapshot: Callable[..., Snapshot], instants: tuple[Array, ...], scene: Scene, outputs: Chosen
) -> tuple[dict[str, Scalar], Scalar, Scalar]:
    """Of snapshots at equal steps; what half of them make of the RMS, and the least penetration.

    Means are sums over the instants, peaks those of the trigonometric polynomial through them.
    """
    statistics = dict(outputs)
    quantities = dict.fromkeys(statistic.quantity for statistic in statistics.values())

    def look(*instant) -> list[Scalar]:
        seen = snapshot(*instant)
        return [quantity(seen, scene) for quantity in quantities]

    samples = dict(zip(quantities, one_by_one(look, instants, scene), strict=True))

    def reduce(name: str, step: int = 1) -> Scalar:
        how, q = statistics[name].reduction, samples[statistics[name].quantity][::step]
        if isinstance(how, PowerMean):
            return how.root(jnp.mean(q**how.power))
        return how.of_samples(_finer(q))

    values = {name: reduce(name) for name in statistics}
    error = jnp.abs(reduce("foundation_rms", 2) / values["foundation_rms"] - 1)
    names = [f"{before(joint)}penetration_ratio" for joint, _ in scene.joints.present()]
    depths = [samples[statistics[name].quantity] for name in names or ["penetration_ratio"]]
    least = jnp.min(jnp.stack([jnp.min(_finer(depth)) for depth in depths]))
    return values, jax.lax.stop_gradient(error), least


def _finer(samples: Float[Array, " n"]) -> Float[Array, " m"]:
    return resample(samples, FINER * len(samples))
