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
)
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.basics.traced import traced
from jaxcrusher.crusher.scene import Scene, require_maker
from jaxcrusher.motion.statistic import STATISTIC, Chosen, chosen
from jaxcrusher.settled import forced, shooting
from jaxcrusher.settled.branch import ENDS, follow, special_points
from jaxcrusher.settled.collocation import System, attached
from jaxcrusher.settled.described import INSTANTS, described, of_nodes
from jaxcrusher.settled.newton import RESULTS, Root
from jaxcrusher.settled.periodic_orbit import periodic_orbit
from jaxcrusher.settled.result import PeriodicOrbit
from jaxcrusher.settled.section_branch import DOUBLING, SectionBranches
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
    period: int | None = None,
    nodes: int = NODES,
    points: int = 200,
    guess: PeriodicOrbit | Float[ArrayLike, "n dims"] | None = None,
) -> xr.Dataset:
    """The branch of settled motions through the one at a value of a parameter.

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
    doubling", "Neimark-Sacker"; by collocation "contact lost") and `special_parameter`, by shooting
    NaN where a change is seen but not located; a branch may end in the doubling that it came from.
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
    first = periodic_orbit(begin, period=period, nodes=nodes, guess=guess)
    require(first.eccentricity is not None, "scene", "have a clearance joint", "an ideal one")
    if not bool(first.success):
        found = periodic_orbit(begin, period=period, guess=guess)
        require(bool(found.success), "start", "have a settled motion", f"{start}: {found.failure}")
        first = periodic_orbit(begin, nodes=nodes, guess=found)
        if not bool(first.success):
            return _by_sections(scene, found, start, bounds, upwards, scale, points)
    period = first.period
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
    along = _looked_at(family, branch.parameter, branch.x, period, chosen(first.values))
    count, ended = int(branch.count), ENDS[int(branch.result)]
    good = np.asarray(along.error[:count]) <= UNRESOLVED
    if not good.all():
        count, ended = int(np.argmin(good)), "These nodes do not resolve the motion any further."
        branch = eqx.tree_at(lambda b: b.count, branch, jnp.array(count))
    special = special_points(family, branch, scale=scale, monitor=_least_penetration)
    values = {name: np.asarray(getattr(along, name)[:count]) for name in (*HELD, *VARIABLES)}
    values["parameter"] = np.asarray(branch.parameter[:count])
    kinds = [{"monitor": "contact lost"}.get(one.kind, one.kind) for one in special]
    places = [one.parameter for one in special]
    return _labelled(values, kinds, places, ended, period)


def _by_sections(
    scene: Callable[[Scalar], Scene],
    orbit: PeriodicOrbit,
    start: float,
    bounds: tuple[float, float],
    upwards: bool,
    scale: float,
    points: int,
) -> xr.Dataset:
    """The branch through an orbit that loses contact."""
    sections = SectionBranches(eqx.Partial(_made, scene=scene), orbit.period, scale)
    state = np.asarray(orbit.section)
    branch, ended = sections.follow(state, start, bounds, upwards=upwards, points=points)
    require(bool(branch), "guess", "lead to an orbit that repeats", "one that does not")
    special = sections.special_points(branch)
    if branch[-1].turns < orbit.period:
        special.append((DOUBLING, sections.origin(branch)[1]))
        branch = branch[:-1]
    seen = [
        shooting.described(
            scene(jnp.asarray(scale * one.value)), one.state, orbit.period, one.multipliers, np.nan
        )
        for one in branch
    ]
    values = {
        name: np.array([float(getattr(one, name)) for one in seen]) for name in (*HELD, *VARIABLES)
    }
    values["parameter"] = np.array([scale * one.value for one in branch])
    places = [np.nan if one is None else scale * one.value for _, one in special]
    return _labelled(values, [kind for kind, _ in special], places, ended, orbit.period)


def _made(point: Float[Array, "1"], scene: Callable[[Scalar], Scene]) -> Scene:
    return scene(point[0])


def _labelled(
    values: dict[str, np.ndarray], kinds: list[str], places: list[float], ended: str, period: int
) -> xr.Dataset:
    meanings = {name: (STATISTIC[name].unit, STATISTIC[name].meaning) for name in HELD} | VARIABLES
    data = {"parameter": ("point", values["parameter"], {})}
    for name, (unit, meaning) in meanings.items():
        data[name] = "point", values[name], {"units": unit, "long_name": meaning}
    stable = values["largest_multiplier"] < 1
    data["stable"] = "point", stable, {"units": "1", "long_name": "disturbances die"}
    data["special_kind"] = "special", np.array(kinds, object), {}
    data["special_parameter"] = "special", np.array(places, float), {}
    return xr.Dataset(data, attrs={"ended": ended, "period": period})


def _family(value: Scalar, *, scene: Callable[[Scalar], Scene], period: int) -> System:
    return forced.system(scene(value), period)


def _least_penetration(x: Float[Array, "nodes dims"]) -> Scalar:
    """The least over the period and over all joints, in clearances."""
    by_joint = resample(x, INSTANTS).reshape(INSTANTS, -1, 2)
    return jnp.min(jnp.linalg.norm(by_joint, axis=2)) - 1


@eqx.filter_jit
def _looked_at(
    family: Callable[[Scalar], System], values: Array, x: Array, period: int, outputs: Chosen
) -> PeriodicOrbit:
    """The orbits of a branch."""

    def one(place: tuple[Scalar, Array]) -> PeriodicOrbit:
        return _described(family, place[0], place[1], period, outputs)

    return jax.lax.map(one, (values, x))


def _described(
    family: Callable[[Scalar], System], value: Scalar, x: Array, period: int, outputs: Chosen
) -> PeriodicOrbit:
    system = family(value)
    matrix = system.linearised(x)[1].reshape(x.size, x.size)
    lower, rows = lu_factor(matrix)
    root = Root(x.ravel(), (lower, rows), jnp.array(0), RESULTS.successful)
    found, factors = of_nodes(system, x, root)
    return described(system, found, attached(system, x, factors), period, outputs)
