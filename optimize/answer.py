"""The answer of a search; a stage that did not come leaves None or nothing in its place.

Numbers are in SI units, objectives in their own. `optimize.tell.result` makes result.json of it.
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
    """The periodic orbit of a design, with the objective on it and its slopes."""

    solution: PeriodicOrbit
    objective: float  # NaN where there is no orbit
    slopes: dict[str, float]  # of the objective, per unit of each free parameter
    slopes_apart: dict[str, float]  # how far differences of orbits are from them

    @property
    def found(self) -> bool:
        """Whether there is an orbit."""
        return bool(self.solution.success)

    @property
    def stable(self) -> bool:
        """Whether disturbances of it are known to die."""
        return bool(self.solution.stable)

    @property
    def undecided(self) -> bool:
        """Whether it is not known if they do."""
        return bool(self.solution.undecided)


@dataclass(frozen=True)
class Coexisting:
    """A stable orbit of a design, and the share of random starts that come to it."""

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
    by_run: dict[str, np.ndarray]  # every variable, shape (runs,); the first start is not shifted
    settles: bool  # the design has a stable orbit, and no run ever lost contact

    @property
    def count(self) -> int:
        """How many."""
        return len(self.by_run["objective"])

    def first(self, name: str) -> Any:
        """A variable of the run whose start is not shifted."""
        return self.by_run[name][0].item()


@dataclass(frozen=True)
class Crushing:
    """What a design is as a crusher."""

    clearance: float  # m, of the main bearing
    capacity: float  # m3/h
    stroke: float  # m, at the discharge
    stroke_ratio: float  # of its vertical over its horizontal part


@dataclass(frozen=True)
class Confirmed:
    """A design with its long runs; the objective is that of its worst motion.

    A start whose oscillation decays in contact counts by the orbit, another one by the mean of its
    runs. A worse orbit that random starts come to replaces both.
    """

    values: dict[str, float]  # of the free parameters
    objective: float  # NaN if a run failed, whirled or broke a constraint
    half_width: float  # estimated error of the orbit's, or of the mean's interval
    worse_start: str
    speed: float
    forces: dict[
        str, float
    ]  # `DesignProblem.forces` of the orbit, or the means of the worse start's runs
    ideal_rms: float  # the first of them, of the same machine with ideal joints
    crushing: Crushing | None  # None of a linkage that is no crusher
    orbit: Orbit | None  # None: a scene whose orbits cannot be solved for
    transient: dict[str, Runs]  # by start
    coexisting: tuple[Coexisting, ...] = ()  # of random starts, the most frequent first
    follows: dict[str, float] = field(default_factory=dict)  # from the free parameters

    @property
    def counts(self) -> bool:
        """Whether it may be chosen."""
        return self.objective == self.objective

    @property
    def averaged(self) -> bool:
        """Whether the objective is a mean of long runs, and not that of an orbit."""
        by_orbit = any(one.objective == self.objective for one in self.coexisting)
        return not (by_orbit or self.transient[self.worse_start].settles)

    @property
    def settles(self) -> bool:
        """Whether it comes to its periodic orbit from every start."""
        return all(runs.settles for runs in self.transient.values())


@dataclass(frozen=True)
class Refinement:
    """A local search, and its objective at both ends."""

    by: str  # "gradient" of the periodic orbit, or "fits" to motions from random starts
    path: dict[str, np.ndarray]  # of the free parameters, shape (points,)
    first: float
    last: float
    evaluations: int  # of the objective, with gradients if by them
    gradient: dict[str, float]  # at the end, per unit of the parameter; nothing by fits


@dataclass(frozen=True)
class Active:
    """An active constraint at the optimum: without it the objective would fall."""

    parameter: str  # or what is constrained itself: "capacity", a statistic of a limit
    limit: str  # "lowest", "highest" or "capacity"
    multiplier: float  # by how much the objective would fall per unit
    unit: str = ""  # of a constraint that is no parameter


@dataclass(frozen=True)
class OpenPoint:
    """A point of the map without a stable orbit of one turn, and what runs say of it."""

    values: dict[str, float]  # of the free parameters
    motion: str  # why there is no such orbit
    least: float  # objective of the runs of a start, less half of its 95 % interval
    place: int  # of the map's points, one after the other


@dataclass(frozen=True)
class Bound:
    """A bound of how far below the optimum the least objective of the box may lie."""

    within: float | None  # in the objective's unit; None: not known
    curvature: float | None  # what second derivatives can hide in a cell: a part of `within`
    open_points: int  # of the map, without a stable orbit that counts: nothing is said of them
    gain: float  # of the descents, on the map's best point
    statement: str
    by_runs: tuple[OpenPoint, ...] = ()  # points that long runs speak for


@dataclass(frozen=True)
class Front:
    """A Pareto front of the objective and another number: no point gains in both.

    Points stand in the order of a rising objective. A front of one point offers nothing to trade.
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
    """Something that was checked of the answer."""

    name: str
    passed: bool
    detail: str

    @property
    def verdict(self) -> str:
        """In a word."""
        return "ok" if self.passed else "failed"


@dataclass(frozen=True, eq=False)
class Maps:
    """What is known of the whole box: the landscape of both starts, and the periodic orbits."""

    cells: np.ndarray  # of the landscape, points (cells, n) of the unit box
    landscape: xr.Dataset
    points: np.ndarray  # of the map of orbits, (points, n)
    orbits: xr.Dataset | None  # None: there are none to solve for
    contact: bool = True  # whether any design keeps contact from a start
    reference: Orbit | None = None  # of the design to compare with, which is searched for beside

    @property
    def stable_orbits(self) -> int | None:
        """How many points have an orbit that may be stable, None where none is solved for."""
        return None if self.orbits is None else int(may_be_stable(self.orbits).sum())

    @property
    def counting_orbits(self) -> xr.Dataset | None:
        """The map of orbits, if one of them counts."""
        return None if self.orbits is None or not self.orbits.counts.any() else self.orbits


@dataclass(frozen=True, eq=False)
class Answer:
    """All that a search found, and how."""

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
    reference: Confirmed | None = None  # what the optimum is compared with
    empty: str = ""  # why no design may be chosen, or nothing
    active: tuple[Active, ...] = ()  # constraints at the optimum
    free_slopes: Mapping[str, float] = field(default_factory=dict)  # that no constraint balances
    bound: Bound | None = None
    load_sheets: Mapping[str, list[Row]] = field(default_factory=dict)  # of designs with an orbit
    fronts: tuple[Front, ...] = ()
    checks: tuple[Check, ...] = ()
    remark: str = ""

    @property
    def finished(self) -> bool:
        """Every stage came to its end."""
        return self.status == "finished"

    @property
    def designs(self) -> dict[str, Confirmed]:
        """Return the designs to show, by title, as far as the search came."""
        titled = {"optimum": self.optimum, self.problem.compared_with: self.reference}
        return {title: design for title, design in titled.items() if design is not None}

    @property
    def throughput(self) -> dict[str, float]:
        """Return the capacity in t/h of each design to show, nothing without a bulk density."""
        density = self.problem.bulk_density
        if density is None:
            return {}
        return {
            title: throughput(one.crushing.capacity, density)
            for title, one in self.designs.items()
            if one.crushing is not None
        }
