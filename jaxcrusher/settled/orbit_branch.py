"""The settled motions of a crusher over one parameter, followed round their folds."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jax.scipy.linalg import lu_factor
from jaxtyping import Array, ArrayLike, Float, Scalar

from jaxcrusher.basics.checks import (
    require,
    require_positive,
    require_untraced,
    require_whole,
    require_x64,
)
from jaxcrusher.crusher.scene import Scene, require_maker
from jaxcrusher.motion.statistic import STATISTIC
from jaxcrusher.settled import forced
from jaxcrusher.settled.branch import ENDS, follow, special_points
from jaxcrusher.settled.collocation import System
from jaxcrusher.settled.newton import RESULTS, Root
from jaxcrusher.settled.periodic_orbit import INSTANTS, described, periodic_orbit
from jaxcrusher.settled.result import PeriodicOrbit
from jaxcrusher.settled.trigonometric import resample

# Nodes a turn: near a fold an orbit and its multipliers want more than elsewhere.
NODES = 192
# First and longest step, with the parameter's scale for a unit.
STEP, LONGEST = 0.01, 0.1
# An orbit whose RMS is known no better, as a share, is not followed.
UNRESOLVED = 1e-3
# Name -> unit and meaning of what a point holds besides some statistics.
VARIABLES = {
    "error": ("1", "estimated error of the RMS, as a share of it"),
    "least_penetration": ("1", "least penetration / clearance"),
    "largest_multiplier": ("1", "largest modulus of the Floquet multipliers"),
}
HELD = ("foundation_rms", "foundation_mean", "foundation_peak")


def orbit_branch(
    scene: Callable[[Scalar], Scene],
    start: float,
    bounds: tuple[float, float],
    *,
    upwards: bool = True,
    scale: float | None = None,
    period: int = 1,
    nodes: int = NODES,
    points: int = 200,
    guess: PeriodicOrbit | Float[ArrayLike, "n 2"] | None = None,
) -> xr.Dataset:
    """The branch of settled motions through the one at a value of a parameter.

    **Arguments:**

    - `scene`: makes a scene that `jaxcrusher.periodic_orbit` takes from a value, which is traced.
    - `start`, `bounds`: where the branch begins, and between what it is followed.
    - `upwards`: whether the parameter grows at first.
    - `scale`: what a change of the parameter is small against, > 0; None is a thirtieth of
      `start`. Steps are a tenth of it at most.
    - `period`, `nodes`: turns, and an even number of nodes a turn.
    - `points`: at most.
    - `guess`: of the first motion, as in `periodic_orbit`.

    **Returns:** an `xarray.Dataset`. With the dimension `point`, in the order of the branch, where
    a parameter may occur more than once: `parameter`, `foundation_rms`, `foundation_mean`,
    `foundation_peak` (N), `error` (of the RMS, a share of it: where it is large the nodes do not
    resolve the motion, and its multipliers mean nothing), `least_penetration` (clearances),
    `largest_multiplier`, `stable`. With the dimension `special`: `special_kind` ("fold", "period
    doubling", "Neimark-Sacker", "contact lost"), `special_parameter`, and `special_error` as
    `error`. The attribute `ended` says why it ends.

    Raises ValueError for arguments out of range, and where there is no motion to begin with.
    """
    require_x64()
    require_whole("points", points, 2)
    require_whole("nodes", nodes, 4)
    require_maker(scene)
    require_untraced("start", (start, bounds), "orbit_branch", "jaxcrusher.periodic_orbit")
    low, high = bounds
    require(low <= start <= high, "start", f"lie in the bounds [{low:g}, {high:g}]", start)
    scale = abs(start) / 30 if scale is None else scale
    require_positive("scale", scale, "")
    first = periodic_orbit(scene(jnp.asarray(start)), period=period, nodes=nodes, guess=guess)
    require(bool(first.success), "start", "have a settled motion", f"{start}: {first.failure}")
    require(first.eccentricity is not None, "scene", "have a clearance joint", "an ideal one")
    assert first.eccentricity is not None
    family = eqx.Partial(_family, scene=scene, period=period)
    branch = follow(
        family,
        first.eccentricity,
        jnp.asarray(start),
        scale=scale,
        bounds=(low, high),
        step=STEP if upwards else -STEP,
        longest=LONGEST,
        points=points,
        monitor=_least_penetration,
    )
    along = _looked_at(family, branch.parameter, branch.x, period)
    count, ended = int(branch.count), ENDS[int(branch.result)]
    good = np.asarray(along.error[:count]) <= UNRESOLVED
    if not good.all():
        count, ended = int(np.argmin(good)), "These nodes do not resolve the motion any further."
        branch = eqx.tree_at(lambda b: b.count, branch, jnp.array(count))
    special = special_points(family, branch, scale=scale, monitor=_least_penetration)
    data = {"parameter": ("point", np.asarray(branch.parameter[:count]), {})}
    meanings = {name: (STATISTIC[name].unit, STATISTIC[name].meaning) for name in HELD} | VARIABLES
    for name, (unit, meaning) in meanings.items():
        labels = {"units": unit, "long_name": meaning}
        data[name] = "point", np.asarray(getattr(along, name)[:count]), labels
    stable = data["largest_multiplier"][1] < 1
    data["stable"] = "point", stable, {"units": "1", "long_name": "disturbances die"}
    kinds = [{"monitor": "contact lost"}.get(one.kind, one.kind) for one in special]
    data["special_kind"] = "special", np.array(kinds, object), {}
    data["special_parameter"] = "special", np.array([one.parameter for one in special]), {}
    return xr.Dataset(data, attrs={"ended": ended, "period": period})


def _family(value: Scalar, *, scene: Callable[[Scalar], Scene], period: int) -> System:
    return System(forced.acceleration, jnp.asarray(2 * np.pi * period), scene(value))


def _least_penetration(x: Float[Array, "nodes 2"]) -> Scalar:
    """In clearances."""
    return jnp.min(jnp.linalg.norm(resample(x, INSTANTS), axis=1)) - 1


@eqx.filter_jit
def _looked_at(
    family: Callable[[Scalar], System], values: Array, x: Array, period: int
) -> PeriodicOrbit:
    """The orbits of a branch."""
    return jax.lax.map(lambda one: _described(family, one[0], one[1], period), (values, x))


def _described(
    family: Callable[[Scalar], System], value: Scalar, x: Array, period: int
) -> PeriodicOrbit:
    system = family(value)
    factors = lu_factor(system.linearised(x)[1].reshape(x.size, x.size))
    root = Root(x.ravel(), (factors[0], factors[1]), jnp.array(0), RESULTS.successful)
    return described(system, period, x, root)
