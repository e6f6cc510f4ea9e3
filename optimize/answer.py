"""The answer of a search. Fields of a stage that has not run are None or empty.

Numbers are in SI units, objectives in their own. `optimize.tell.result` makes result.json.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from jaxcrusher.crusher.capacity import throughput
from jaxcrusher.joint.validity import Validity
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.sheets.load_sheet import Row
from optimize.ask.constraints import may_be_stable
from optimize.ask.problem import DesignProblem


@dataclass(frozen=True)
class Orbit:
    """The periodic orbit of a design, with the objective on the orbit and its slopes."""

    solution: PeriodicOrbit
    objective: float  # NaN where there is no orbit
    slopes: dict[str, float]  # of the objective, per unit of each free parameter
    slopes_apart: dict[str, float]  # deviations of finite differences from the slopes

    @property
    def found(self) -> bool:
        """Whether an orbit was found."""
        return bool(self.solution.success)

    @property
    def stable(self) -> bool:
        """Whether disturbances of the orbit are known to decay."""
        return bool(self.solution.stable)

    @property
    def undecided(self) -> bool:
        """Whether the stability of the orbit is not known."""
        return bool(self.solution.undecided)


@dataclass(frozen=True)
class Coexisting:
    """A stable orbit of a design, and the share of random starts that converge to it."""

    share: float
    solution: PeriodicOrbit
    objective: float


@dataclass(frozen=True)
class Runs:
    """Independent long runs of a design from one start."""

    objective_mean: float
    objective_half_width: float  # of the mean's confidence interval, from the scatter of the runs
    validity: Validity  # of the first run
    state: np.ndarray  # at the end of the first run, as in `Section`
    by_run: dict[str, np.ndarray]  # each variable, shape (runs,); the first start is not shifted
    settles: bool  # the design has a stable orbit, and no run lost contact

    @property
    def count(self) -> int:
        """The number of runs."""
        return len(self.by_run["objective"])

    def first(self, name: str) -> Any:
        """Return a variable of the first run, whose start is not shifted."""
        return self.by_run[name][0].item()


@dataclass(frozen=True)
class Crushing:
    """Capacity and stroke of a design that is a crusher."""

    clearance: float  # m, of the main bearing
    capacity: float  # m3/h
    stroke: float  # m, at the discharge
    stroke_ratio: float  # vertical part over horizontal part of the stroke


@dataclass(frozen=True)
class Confirmed:
    """A design with its long runs. Its objective is that of its worst motion.

    A start whose oscillation decays in contact is judged by the orbit, any other start by the mean
    of its runs. If random starts converge to a worse orbit, that orbit decides.
    """

    values: dict[str, float]  # of the free parameters
    objective: float  # NaN if a run failed, whirled or broke a constraint
    half_width: float  # estimated error on the orbit, or half of the mean's interval
    worse_start: str
    speed: float
    forces: dict[
        str, float
    ]  # `DesignProblem.forces` of the orbit, or the means of the worse start's runs
    ideal_rms: float  # the first of these forces, with ideal joints
    crushing: Crushing | None  # None for a linkage that is not a crusher
    orbit: Orbit | None  # None if orbits of the scene cannot be solved for
    transient: dict[str, Runs]  # by start
    coexisting: tuple[Coexisting, ...] = ()  # of random starts, the most frequent first
    follows: dict[str, float] = field(default_factory=dict)  # numbers that depend on free ones

    @property
    def counts(self) -> bool:
        """Whether the design may be chosen."""
        return self.objective == self.objective

    @property
    def averaged(self) -> bool:
        """Whether the objective is a mean of long runs, not the value on an orbit."""
        by_orbit = any(one.objective == self.objective for one in self.coexisting)
        return not (by_orbit or self.transient[self.worse_start].settles)

    @property
    def settles(self) -> bool:
        """Whether the motion converges to the periodic orbit from every start."""
        return all(runs.settles for runs in self.transient.values())


@dataclass(frozen=True)
class Refinement:
    """A local search, and its objective at both ends."""

    by: str  # "gradient" on the periodic orbit, or "fits" to motions from random starts
    path: dict[str, np.ndarray]  # of the free parameters, shape (points,)
    first: float
    last: float
    evaluations: int  # of the objective; a search by gradients counts each with its gradient
    gradient: dict[str, float]  # at the end, per unit of each parameter; NaN by fits


@dataclass(frozen=True)
class Active:
    """An active constraint at the optimum: without this constraint the objective would fall."""

    parameter: str  # or the constrained quantity: "capacity", or the statistic of a limit
    limit: str  # "lowest", "highest" or "capacity"
    multiplier: float  # by how much the objective would fall per unit
    unit: str = ""  # of a constrained quantity that is not a parameter


@dataclass(frozen=True)
class OpenPoint:
    """A point of the map without a stable orbit of one turn, with the result of its runs."""

    values: dict[str, float]  # of the free parameters
    motion: str  # the reason why there is no such orbit
    least: float  # least lower end of the 95 % intervals of the objective, over the starts
    place: int  # index of the point in the map


@dataclass(frozen=True)
class Bound:
    """A bound of how far below the optimum the least objective of the box may lie."""

    within: float | None  # in the objective's unit; None if not known
    curvature: float | None  # the part of `within` due to second derivatives inside a cell
    open_points: int  # how many points of the map the bound does not cover
    gain: float  # how far the optimum lies below the best point of the map
    statement: str
    by_runs: tuple[OpenPoint, ...] = ()  # points that long runs judge


@dataclass(frozen=True)
class Front:
    """A Pareto front of the objective and another number: no point is better in both.

    Points are ordered by increasing objective. In a front of one point both numbers are best.
    """

    of: str  # the other number: "capacity" or a statistic
    unit: str
    meaning: str
    objective: np.ndarray  # (points,)
    other: np.ndarray  # (points,)
    values: dict[str, np.ndarray]  # of the free parameters, (points,)
    forces: dict[str, np.ndarray]  # `DesignProblem.forces` of the orbits, (points,)


@dataclass(frozen=True)
class Check:
    """A check of the answer, with its result."""

    name: str
    passed: bool
    detail: str

    @property
    def verdict(self) -> str:
        """The result in a word."""
        return "ok" if self.passed else "failed"


@dataclass(frozen=True, eq=False)
class Maps:
    """Maps of the whole box: the landscape of both starts, and the periodic orbits."""

    cells: np.ndarray  # of the landscape, points (cells, n) of the unit box
    landscape: xr.Dataset
    points: np.ndarray  # of the map of orbits, (points, n)
    orbits: xr.Dataset | None  # None if orbits cannot be solved for
    contact: bool = True  # whether any design keeps contact from a start
    reference: Orbit | None = None  # orbit of the design to compare with

    @property
    def stable_orbits(self) -> int | None:
        """The number of points with an orbit that may be stable; None without a map of orbits."""
        return None if self.orbits is None else int(may_be_stable(self.orbits).sum())

    @property
    def counting_orbits(self) -> xr.Dataset | None:
        """The map of orbits if one of the orbits counts, else None."""
        return None if self.orbits is None or not self.orbits.counts.any() else self.orbits


@dataclass(frozen=True, eq=False)
class Answer:
    """The complete answer of a search, with its problem and its cost."""

    problem: DesignProblem
    command: str
    versions: Mapping[str, str]
    status: str = "interrupted"
    seconds: Mapping[str, float] = field(default_factory=dict)  # by stage
    steps: Mapping[str, int] = field(default_factory=dict)  # of integrations, by stage
    maps: Maps | None = None
    refinement: tuple[Refinement, ...] = ()
    ends: np.ndarray | None = None  # of the descents, points of the unit box to be confirmed
    candidates: tuple[Confirmed, ...] = ()
    optimum: Confirmed | None = None
    reference: Confirmed | None = None  # the design that the optimum is compared with
    empty: str = ""  # why no design may be chosen; empty if one may be chosen
    active: tuple[Active, ...] = ()  # constraints at the optimum
    free_slopes: Mapping[str, float] = field(default_factory=dict)  # not balanced by constraints
    bound: Bound | None = None
    load_sheets: Mapping[str, list[Row]] = field(default_factory=dict)  # of designs with an orbit
    fronts: tuple[Front, ...] = ()
    checks: tuple[Check, ...] = ()
    remark: str = ""

    @property
    def finished(self) -> bool:
        """Whether every stage has finished."""
        return self.status == "finished"

    @property
    def designs(self) -> dict[str, Confirmed]:
        """Return the designs to show that the search has reached, by title."""
        titled = {"optimum": self.optimum, self.problem.compared_with: self.reference}
        return {title: design for title, design in titled.items() if design is not None}

    @property
    def throughput(self) -> dict[str, float]:
        """Return the capacity (t/h) of each crusher to show; empty without a bulk density."""
        density = self.problem.bulk_density
        if density is None:
            return {}
        return {
            title: throughput(one.crushing.capacity, density)
            for title, one in self.designs.items()
            if one.crushing is not None
        }
