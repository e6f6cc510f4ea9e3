"""Follow the periodic orbits of a crusher over one parameter, round their folds."""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, ArrayLike, Float, Scalar

from jaxcrusher.basics.checks import (
    require,
    require_positive,
    require_untraced,
    require_whole,
)
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.basics.traced import traced
from jaxcrusher.crusher.rough_feed import steady
from jaxcrusher.crusher.scene import Scene, require_maker
from jaxcrusher.files.table import COLUMNS, dataset
from jaxcrusher.motion.statistic import chosen, columns
from jaxcrusher.orbits import forced
from jaxcrusher.orbits.branch import Special, follow, origin, special_points
from jaxcrusher.orbits.collocation import System
from jaxcrusher.orbits.periodic_orbit import periodic_orbit
from jaxcrusher.orbits.problem import Collocation
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.orbits.shooting import Shooting

# Nodes a turn: near a fold an orbit and its multipliers want more than elsewhere.
NODES = 192
# Joint -> kind of the special point where its pin leaves its bore.
LOST = {
    "main": "contact lost",
    "elbow": "contact lost at the elbow",
    "pivot": "contact lost at the pivot",
}
# What a point holds: statistics, and further numbers of its orbit.
HELD = ("foundation_rms", "foundation_mean", "foundation_peak")
FURTHER = ("error", "least_penetration", "largest_multiplier", "stable")


def orbit_branch(
    scene: Callable[[Scalar], Scene],
    start: float,
    bounds: tuple[float, float],
    *,
    upwards: bool = True,
    scale: float | None = None,
    period: int | None = None,
    nodes: int = NODES,
    points: int = 200,
    guess: PeriodicOrbit | Float[ArrayLike, "n dims"] | None = None,
) -> xr.Dataset:
    """Return the branch of periodic orbits through the one at a value of a parameter.

    By collocation while contact is kept, to where it is lost. The branch of a first motion that
    the nodes do not resolve, such as one that loses contact, is followed by shooting, through gain
    and loss of contact. A point of it takes some two seconds.

    **Arguments:**

    - `scene`: makes a scene that `jaxcrusher.periodic_orbit` takes from a value, which is traced.
    - `start`, `bounds`: where the branch begins, and between what it is followed.
    - `upwards`: whether the parameter grows at first.
    - `scale`: what a change of the parameter is small against, > 0; None is a thirtieth of
      `start`. Steps are a tenth of it at most.
    - `period`, `nodes`: turns, and an even number of nodes a turn, unless it is shot for.
    - `points`: at most.
    - `guess`: of the first motion, as in `periodic_orbit`.

    **Returns:** an `xarray.Dataset`. With the dimension `point`, in the order of the branch, where
    a parameter may occur more than once: `parameter`, `foundation_rms`, `foundation_mean`,
    `foundation_peak` (N), `error` (of the RMS, a share of it: where it is large the nodes do not
    resolve the motion, and its multipliers mean nothing), `least_penetration` (clearances),
    `largest_multiplier`, `stable`. With the dimension `special`: `special_kind` ("fold", "period
    doubling", "Neimark-Sacker"; by collocation "contact lost", also "at the elbow" and "at the
    pivot") and `special_parameter`, NaN where a change is seen but not located. A branch may end in
    the doubling that it came from.
    The attribute `ended` says why it ends.

    Raises ValueError for arguments out of range, and where there is no motion to begin with.
    """
    require_set_up()
    require_whole("points", points, 2)
    require_whole("nodes", nodes, 4)
    require_maker(scene)
    require_untraced("start", (start, bounds), "orbit_branch", "jaxcrusher.periodic_orbit")
    low, high = bounds
    require(low <= start <= high, "start", f"lie in the bounds [{low:g}, {high:g}]", start)
    scale = abs(start) / 30 if scale is None else scale
    require_positive("scale", scale, "")
    scene = traced(scene, jnp.asarray(start, float))
    if isinstance(guess, PeriodicOrbit):
        period = guess.period if period is None else period
        require(period == guess.period, "period", f"be the guess's {guess.period}", period)
    begin = scene(jnp.asarray(start))
    first = found = periodic_orbit(begin, period=period, nodes=nodes, guess=guess)
    require(first.eccentricity is not None, "scene", "have a clearance joint", "an ideal one")
    if not bool(first.success):
        found = periodic_orbit(begin, period=period, guess=guess)
        require(bool(found.success), "start", "have a periodic orbit", f"{start}: {found.failure}")
        first = periodic_orbit(begin, nodes=nodes, guess=found)
    if bool(first.success):
        family = eqx.Partial(_family, scene=scene, period=found.period)
        watched, outputs = tuple(LOST[joint] for joint, _ in begin.joints.present()), first.values
        problem = Collocation(
            family=family, period=found.period, watched=watched, outputs=chosen(outputs)
        )
        unknowns = first.eccentricity
    else:
        problem = Shooting(build=eqx.Partial(_made, scene=scene), period=found.period)
        unknowns = found.section
    branch = follow(
        problem,
        np.asarray(unknowns),
        start,
        scale=scale,
        bounds=(low, high),
        upwards=upwards,
        points=points,
    )
    require(bool(branch.points), "guess", "lead to an orbit that repeats", "one that does not")
    orbits, ended = [], branch.ended
    for place, point in zip(branch.parameter, branch.points, strict=True):
        orbit = problem.orbit(jnp.asarray(point.u), jnp.asarray(place), point.seen)
        if not bool(orbit.success):
            ended = "These nodes do not resolve the motion any further."
            break
        orbits.append(orbit)
    special = special_points(dataclasses.replace(branch, points=branch.points[: len(orbits)]))
    if branch.parent is not None:
        special.append(origin(branch, branch.parent))
    return _labelled(branch.parameter[: len(orbits)], orbits, special, ended, found.period)


def _labelled(
    parameter: Float[np.ndarray, " points"],
    orbits: list[PeriodicOrbit],
    special: list[Special],
    ended: str,
    period: int,
) -> xr.Dataset:
    kept = columns(HELD) | {name: COLUMNS[name] for name in FURTHER}
    values = {
        name: np.array([column.kind(getattr(orbit, name)) for orbit in orbits], column.kind)
        for name, column in kept.items()
    }
    found = dataset(("point",), values, kept, {}, {"ended": ended, "period": period})
    return found.assign(
        parameter=("point", parameter),
        special_kind=("special", np.array([one.kind for one in special], object)),
        special_parameter=("special", np.array([one.parameter for one in special], float)),
    )


def _family(value: Scalar, *, scene: Callable[[Scalar], Scene], period: int) -> System:
    return forced.system(steady(scene(value)), period)


def _made(point: Float[Array, "1"], scene: Callable[[Scalar], Scene]) -> Scene:
    return steady(scene(point[0]))
