"""Follow an event on branches of orbits, such as a fold, over two parameters of a machine."""

from collections.abc import Callable
from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from jaxcrusher.basics.checks import (
    require,
    require_positive,
    require_untraced,
    require_whole,
    require_within,
)
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.basics.traced import traced
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.orbits.orbit_branch import Event, OrbitBranch, tabulated, with_orbits
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.orbits.scene_problems import lost, problem_of
from jaxcrusher.periodic.branch import LOOP, Branch, follow
from jaxcrusher.periodic.collocation_problem import CollocationProblem
from jaxcrusher.periodic.event_curve import curve_of, cusps
from jaxcrusher.periodic.events import DOUBLING, FOLD, PAIR, as_on
from jaxcrusher.scenes.earlier import unnamed
from jaxcrusher.scenes.machine import Machine, machine_of


@unnamed("first", "second")
def bifurcation_curve(
    machine: Machine | Callable[..., Scene],
    names: tuple[str, str],
    event: Event,
    second: float,
    bounds: tuple[tuple[float, float], tuple[float, float]],
    *,
    scales: tuple[float, float] | None = None,
    points: int = 200,
) -> OrbitBranch:
    """Return the curve of an event over two parameters, both ways from where it was located.

    The second parameter takes the place of the one that a branch is followed over, and the event's
    equation says what the first one must be.

    **Arguments:**

    - `machine`: as in `jaxcrusher.orbit_branch`.
    - `names`: of the two numbers, such as ("speed", "clearance").
    - `event`: a fold, a period doubling, a Neimark-Sacker point or a loss of contact on the branch
      that `jaxcrusher.orbit_branch` followed over the first parameter.
    - `second`: the second parameter's value on that branch.
    - `bounds`: of the first and of the second parameter.
    - `scales`: of the parameters, > 0, against which changes are small; None is a thirtieth of the
      values at the event. Steps are three tenths of them at most.
    - `points`: the most points, each way.

    **Returns:** an `OrbitBranch`, whose `table` has the columns `parameter` (the first) and
    `second` beside those of `orbit_branch`. Its events are the cusps of a curve of folds, whose
    `parameter` is the second one's value. `ended` says why it ends, first downwards, then upwards.
    A closed curve is followed once.

    Raises ValueError for arguments out of range, and for an event that is not followed.
    """
    require_set_up()
    require_whole("points", points, 2)
    require_untraced("second", (second, bounds), "bifurcation_curve", "jaxcrusher.periodic_orbit")
    at = (event.parameter, second)
    over = machine_of(machine).over(*names)
    known = (FOLD, DOUBLING, PAIR, *map(lost, over(jnp.asarray(at, float)).joints.names))
    good = event.kind in known and event.point is not None
    require(good, "event", f"be one of {known} that is located", event.kind)
    assert event.point is not None
    for name, one, (low, high) in zip(("event", "second"), at, bounds, strict=True):
        require_within(name, one, low, high)
    scales = (abs(at[0]) / 30, abs(at[1]) / 30) if scales is None else scales
    for scale in scales:
        require_positive("scales", scale, "")
    pair = traced(over, jnp.asarray(at, float))
    nodal = isinstance(event.branch.problem, CollocationProblem)
    u = as_on(event.branch, event.point.u)
    base = problem_of(pair, jnp.asarray(at, float), event.point.turns, nodal)
    curve = curve_of(base, event.kind, u.shape, scales[0], bounds[0])

    def way(upwards: bool) -> tuple[Branch, tuple[PeriodicOrbit, ...]]:
        start, more = curve.joined(u, at[0]), {"scale": scales[1], "bounds": bounds[1]}
        return with_orbits(follow(curve, start, second, upwards=upwards, points=points, **more))

    down, before = way(False)
    require(bool(before), "event", "lie on a curve over both parameters", "on none")
    backwards = [replace(point, tangent=-point.tangent) for point in down.points[::-1]]
    joined, orbits, ended = replace(down, points=backwards), before[::-1], down.ended
    if ended != LOOP:  # a closed curve is the same one the other way
        up, after = way(True)
        joined = replace(up, points=[*backwards[:-1], *up.points])
        orbits, ended = (*before[:0:-1], *after), f"{down.ended} {up.ended}"
    special = cusps(joined) if event.kind == FOLD else []
    firsts = np.array([float(curve.split(point.u, 0.0)[1][0]) for point in joined.points])
    table = tabulated(orbits, {"parameter": firsts, "second": joined.parameter})
    events = tuple(Event(one.kind, one.parameter, one.error, joined, one.point) for one in special)
    return OrbitBranch(table, orbits, events, ended, (joined,))
