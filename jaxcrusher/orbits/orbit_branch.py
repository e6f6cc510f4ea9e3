"""Follow the periodic orbits of a machine over one parameter, round their folds, to other branches.

`orbit_branch` returns the orbits and the events between them. From an event the branch that leaves
there may be followed; `jaxcrusher.orbits.bifurcation_curve` follows the event over two parameters.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, ArrayLike, Float
from typing_extensions import override

from jaxcrusher.basics.checks import (
    require,
    require_positive,
    require_untraced,
    require_whole,
    require_within,
)
from jaxcrusher.basics.setup import require_set_up, warn_once
from jaxcrusher.basics.traced import traced
from jaxcrusher.crusher.template import STATISTIC
from jaxcrusher.files import svg
from jaxcrusher.files.summary import Row, Summarised, Summary, value_text
from jaxcrusher.files.table import COLUMNS, columns_of, dataset
from jaxcrusher.files.text import measured
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.orbits.forced import unrepeatable
from jaxcrusher.orbits.periodic_orbit import periodic_orbit
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.orbits.scene_problems import orbit_of, problem_of
from jaxcrusher.orbits.solving import orbit_nodes, with_statistics
from jaxcrusher.periodic.branch import OUTSIDE, Branch, Point, follow
from jaxcrusher.periodic.event_curve import EventCurve
from jaxcrusher.periodic.events import (
    CROSSING,
    DOUBLING,
    Special,
    origin,
    other_branch,
    sharp_points,
)
from jaxcrusher.periodic.shooting_problem import ShootingProblem
from jaxcrusher.periodic.trigonometric import resample
from jaxcrusher.scenes.earlier import unnamed
from jaxcrusher.scenes.machine import Machine, machine_of

# Nodes a turn: near a fold an orbit and its multipliers want more than elsewhere.
BRANCH_NODES = 192
# What a point holds: statistics, and further numbers of its orbit.
HELD = ("foundation_rms", "foundation_mean", "foundation_peak")
HELD_OF_LINKAGES = ("shaking_rms", "shaking_peak")
FURTHER = (
    "error",
    "least_penetration",
    "largest_multiplier",
    "multipliers_error",
    "stable",
    "undecided",
)


@dataclass(frozen=True)
class BranchSwitch:
    """A place where a branch leaves another one; `orbit_branch` may start there."""

    period: int
    parameter: float
    unknowns: np.ndarray = field(repr=False)  # (nodes, dims), or where slices begin, in one row
    # of the unknowns and the parameter; None: the parameter's
    direction: np.ndarray | None = field(repr=False)

    def with_nodes(self, nodes: int) -> "BranchSwitch":
        """Return the same place with so many nodes a turn; states of shooting have no nodes."""
        if self.unknowns.ndim == 1:
            return self
        shape, count = self.unknowns.shape, nodes * self.period
        u, way = self.unknowns, self.direction
        if way is not None:
            across = resample(jnp.asarray(way[:-1].reshape(shape)), count)
            way = np.append(np.ravel(across), way[-1])
        return replace(self, unknowns=np.asarray(resample(jnp.asarray(u), count)), direction=way)


@dataclass(frozen=True)
class Event:
    """A change along a branch: its kind, and the value of the parameter, NaN if not located.

    `error` is the error of the value. By collocation it is located again with twice as many nodes,
    up to 384 a turn, until it moves by less than 1e-8 of the scale. By shooting it is the change of
    the value by a tolerance 100 times as large. For a cusp it is NaN: no other equations are solved
    there.

    `kind` is "fold", "branch point", "period doubling", "Neimark-Sacker", "contact lost", "contact
    lost at the elbow", "contact lost at the pivot" or, on a curve of folds, "cusp".
    "unresolved" stands before it if more nodes do not find it, or if no multiplier is 1 (-1 at a
    period doubling) within the error of the matrix.
    """

    kind: str
    parameter: float
    error: float
    branch: Branch = field(repr=False)
    point: Point | None = field(repr=False)

    def orbit(self) -> PeriodicOrbit:
        """Return the orbit at the event."""
        return orbit_of(self.branch, self._located())

    def other_branch(self) -> BranchSwitch:
        """Return where another branch leaves: of twice the turns at a period doubling."""
        known = (DOUBLING, CROSSING)
        require(self.kind in known, "kind", f"be one of {known} for another branch", self.kind)
        special = Special(self.kind, self.parameter, self._located())
        problem, u, direction = other_branch(self.branch, special)
        return BranchSwitch(problem.period, self.parameter, u, direction)

    def _located(self) -> Point:
        require(self.point is not None, "event", "be located", f"a {self.kind} that is only seen")
        assert self.point is not None
        return self.point


@dataclass(frozen=True, repr=False)
class OrbitBranch(Summarised):
    """Periodic orbits along a branch, and the events between them.

    `table` has a row for each orbit, in the order of the branch.
    """

    table: xr.Dataset
    orbits: tuple[PeriodicOrbit, ...]
    events: tuple[Event, ...]
    ended: str  # says why the branch ends
    branches: tuple[Branch, ...]

    @property
    def found(self) -> str:
        """Say by which equations the orbits were found, and of how many unknowns."""
        problem, shape = self.branches[0].problem, self.branches[0].points[0].u.shape
        if isinstance(problem, EventCurve):
            problem, shape = problem.base, problem.shape
        if isinstance(problem, ShootingProblem):
            return f"by shooting from {problem.slices} states a turn"
        return f"by collocation with {shape[0] // problem.period} nodes a turn"

    @property
    def _headline(self) -> str:
        return self.orbits[0].scene.headline

    @override
    def _summary(self) -> Summary:
        headline, stable = self._headline, self.table["stable"].values
        unit = self.orbits[0].scene.statistics[headline].unit
        rows = [
            Row(name, value_text(self.table[name].values, "1"))
            for name in ("parameter", "second")
            if name in self.table
        ]
        rows += [
            Row(headline, value_text(self.table[headline].values, unit)),
            Row("stable", f"{stable.sum()} of {stable.size}"),
            *(
                Row(one.kind, f"at {measured(one.parameter, '1', one.error)}")
                for one in self.events
            ),
        ]
        period = self.orbits[0].period
        title = f"OrbitBranch: {len(self.orbits)} orbits of period {period}, "
        title += f"{len(self.events)} events between them"
        return Summary(title, rows, (self.ended, f"Found {self.found}."))

    @override
    def _picture(self) -> str:
        headline = self._headline
        values = self.table["parameter"].values, self.table[headline].values
        return svg.curve(*values, f"{headline} over the parameter")


@unnamed("value")
def orbit_branch(
    machine: Machine | Callable[..., Scene],
    name: str,
    start: float | BranchSwitch,
    bounds: tuple[float, float],
    *,
    upwards: bool = True,
    scale: float | None = None,
    period: int | None = None,
    nodes: int | None = None,
    points: int = 200,
    guess: PeriodicOrbit | Float[ArrayLike, "n dims"] | None = None,
) -> OrbitBranch:
    """Return the branch of periodic orbits through the one at a value of a parameter.

    Collocation follows the branch while contact is kept, to where it is lost. If nodes do not
    resolve the first motion, as when it loses contact, shooting follows the branch through gain and
    loss of contact, some two seconds a point. A warning and the result's `found` say so.

    **Arguments:**

    - `machine`: one whose scenes `jaxcrusher.periodic_orbit` takes, such as
      `jaxcrusher.paper_machine(start="contact")`, or a function of your own that makes them.
    - `name`: of the number that varies, such as "speed".
    - `start`, `bounds`: where the branch begins, and the values between which it is followed, to a
      last point on one of them. A `BranchSwitch`, as `Event.other_branch` gives it, begins a branch
      that leaves another one of the same `machine`.
    - `upwards`: whether the parameter grows at first; of a branch switch, to which of two sides.
    - `scale`: of the parameter, > 0, against which its changes are small; None is a thirtieth of
      `start`. Steps are a tenth of it at most, by shooting four tenths, and shorter where
      multipliers move fast.
    - `period`, `nodes`: turns, and an even number of nodes a turn for collocation. None is the
      guess's period or 1, and 192 or those of a branch switch. Where the branch wiggles within the
      error of its nodes, it is followed again with twice as many, up to 384.
    - `points`: the most points.
    - `guess`: of the first motion, as in `periodic_orbit`. Neither it nor `period` is used with
      a branch switch.

    **Returns:** an `OrbitBranch`. Its `table` has the dimension `point`, in the order of the
    branch, where a parameter may occur more than once: `parameter`, `foundation_rms`,
    `foundation_mean`, `foundation_peak` (N), `error` (of the RMS, a share of it: where it is large
    the nodes do not resolve the motion, and its multipliers mean nothing), `least_penetration`
    (clearances), `largest_multiplier`, `multipliers_error`, `stable`, `undecided` (the largest
    multiplier is 1 within its error), `unstable` (how many multipliers are outside of the unit
    circle), `multiplier_real`, `multiplier_imag` (with a dimension `multiplier`).
    A branch may end in the doubling that it came from.

    Raises ValueError for arguments out of range, and where there is no motion to begin with.
    """
    require_set_up()
    require_whole("points", points, 2)
    if nodes is not None:
        require_whole("nodes", nodes, 4)
        require(nodes % 2 == 0, "nodes", "be even", nodes)
    require_untraced("start", (start, bounds), "orbit_branch", "jaxcrusher.periodic_orbit")
    value, (low, high) = start.parameter if isinstance(start, BranchSwitch) else start, bounds
    require_within("start", value, low, high)
    scale = abs(value) / 30 if scale is None else scale
    require_positive("scale", scale, "")
    scene = traced(machine_of(machine).over(name), jnp.asarray(value, float))
    if refused := unrepeatable(scene(jnp.asarray(value, float))):
        raise ValueError(f"Argument `machine` must {refused}.")
    if isinstance(start, BranchSwitch):
        begin = start if nodes is None else start.with_nodes(nodes)
    else:
        begin = _first(scene, start, period, BRANCH_NODES if nodes is None else nodes, guess)
    problem = problem_of(scene, jnp.asarray(value, float), begin.period, begin.unknowns.ndim > 1)
    unknowns = begin.unknowns
    if isinstance(problem, ShootingProblem) and not isinstance(start, BranchSwitch):
        unknowns = problem.unknowns_from(unknowns, value)
    branch = follow(
        problem,
        unknowns,
        value,
        scale=scale,
        bounds=bounds,
        upwards=upwards,
        off=begin.direction,
        points=points,
    )
    within = bool(branch.points) or branch.ended != OUTSIDE
    require(within, "bounds", "leave room on the side to which the branch leaves", bounds)
    require(bool(branch.points), "guess", "lead to an orbit that repeats", "one that does not")
    branch, orbits = with_orbits(branch)
    special = sharp_points(branch)
    if branch.parent is not None:
        special.append(origin(branch, branch.parent))
    events = tuple(Event(one.kind, one.parameter, one.error, branch, one.point) for one in special)
    table = tabulated(orbits, {"parameter": branch.parameter})
    return OrbitBranch(table, orbits, events, branch.ended, (branch,))


def _first(
    scene: Callable[[Array], Scene],
    value: float,
    period: int | None,
    nodes: int,
    guess: PeriodicOrbit | Float[ArrayLike, "n dims"] | None,
) -> BranchSwitch:
    """Return the orbit at a value: its nodes, or its section point if they do not resolve it.

    They do if they know the RMS, as along the branch: a motion that begins on them need not close.
    """
    if isinstance(guess, PeriodicOrbit):
        period = guess.period if period is None else period
        require(period == guess.period, "period", f"be the guess's {guess.period}", period)
    begin = scene(jnp.asarray(value, float))
    first = found = periodic_orbit(begin, period=period, nodes=nodes, guess=guess)
    require(first.eccentricity is not None, "scene", "have a clearance joint", "an ideal one")
    if not bool(first.success):
        found = periodic_orbit(begin, period=period, guess=guess, effort="thorough")
        given = f"{value}. {found.failure}".removesuffix(".")
        require(bool(found.success), "start", "have a periodic orbit", given)
        path = found.eccentricity
        if path is not None and found.least_penetration > 0:
            still = begin.steady()
            near = resample(path, nodes * found.period)
            first = with_statistics(
                still, *orbit_nodes(still, near, found.period, len(near)), found.period
            )
    if bool(first.success):
        return BranchSwitch(found.period, value, np.asarray(first.eccentricity), None)
    text = (
        f"The branch from {value} on is followed by shooting, some two seconds a point, for "
        f"{nodes} nodes a turn do not serve there. {first.failure}"
    )
    warn_once(text, text)
    return BranchSwitch(found.period, value, np.asarray(found.section), None)


def with_orbits(branch: Branch) -> tuple[Branch, tuple[PeriodicOrbit, ...]]:
    """Return a branch as far as its nodes resolve the motion, and the orbits on it."""
    orbits = []
    for point in branch.points:
        orbit = orbit_of(branch, point)
        if not bool(orbit.success):
            ended = "These nodes do not resolve the motion any further."
            branch = replace(branch, points=branch.points[: len(orbits)], ended=ended, parent=None)
            break
        orbits.append(orbit)
    return branch, tuple(orbits)


def tabulated(
    orbits: Sequence[PeriodicOrbit], parameters: dict[str, Float[np.ndarray, " points"]]
) -> xr.Dataset:
    """Return a table with a row for each orbit."""
    names = (*FURTHER, "unstable", "multiplier_real", "multiplier_imag")
    table = orbits[0].scene.statistics if orbits else STATISTIC
    held = tuple(name for name in HELD if name in table) or HELD_OF_LINKAGES
    kept = columns_of(table, held) | {name: COLUMNS[name] for name in names}
    values = {
        name: np.array([kept[name].kind(getattr(orbit, name)) for orbit in orbits], kept[name].kind)
        for name in (*held, *FURTHER)
    }
    multipliers = np.array([orbit.multipliers for orbit in orbits], complex)
    values["unstable"] = np.sum(np.abs(multipliers) > 1, axis=1)
    values |= {"multiplier_real": np.real(multipliers), "multiplier_imag": np.imag(multipliers)}
    period = {"period": orbits[0].period} if orbits else {}
    found = dataset(("point",), values, kept, {}, period)
    return found.assign({name: ("point", column) for name, column in parameters.items()})
