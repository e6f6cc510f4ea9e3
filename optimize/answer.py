"""The answer of a search: filled stage by stage, with None or nothing where a stage did not come.

Numbers are in SI units, objectives in their own. `dataclasses.asdict` makes result.json of it.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

import jaxcrusher as jc


@dataclass(frozen=True)
class Settled:
    """The motion that repeats every turn, solved for; NaN in every number where it is not."""

    failure: str  # why there is none, or nothing
    objective: float
    foundation_rms: float
    foundation_peak: float
    shaking_rms: float
    shaking_peak: float
    error: float  # estimated, of the RMS as a share of it
    multipliers: list[list[float]]  # of a disturbance, a turn: real and imaginary parts
    largest_multiplier: float
    settling_turns: float  # in which a disturbance falls to 1/e; infinite if it grows
    least_penetration: float  # in clearances
    section: np.ndarray  # where the pins are as a turn begins, (2 a joint,) in clearances
    state: np.ndarray  # as a turn begins, as in `jaxcrusher.Section`
    validity: jc.Validity
    slopes: dict[str, float]  # of the objective, per unit of each free parameter
    slopes_apart: dict[str, float]  # how far differences of settled motions are from them

    @property
    def stable(self) -> bool:
        """Whether a motion beside it comes to it."""
        return not self.failure and self.largest_multiplier < 1


@dataclass(frozen=True)
class Companion:
    """A stable motion of a design, and the share of random starts that comes to it."""

    share: float
    period: int  # turns
    objective: float
    foundation_rms: float
    foundation_peak: float
    shaking_rms: float
    least_penetration: float  # in clearances
    settling_turns: float


@dataclass(frozen=True)
class Decay:
    """How a swing about the settled motion dies after the long runs."""

    first: float  # in clearances, RMS over the first turns looked at
    last: float  # over the last ones
    rate: float  # share by which it falls in a turn
    error: float  # standard error of the rate
    floor: float  # what the integration leaves of the settled motion itself, in clearances


@dataclass(frozen=True)
class Runs:
    """Independent long runs of a design from one start, which show how far it has settled."""

    objective_mean: float
    objective_half_width: float  # of the mean's confidence interval, from the scatter of the runs
    validity: jc.Validity  # of the first run
    state: np.ndarray  # at the end of the first run, as in `jaxcrusher.Section`
    by_run: dict[str, np.ndarray]  # every variable, shape (runs,); the first start is not shifted
    settles: bool  # there is a stable settled motion, and no run ever lost contact
    decay: Decay | None = None  # of the run whose start is not shifted, if it settles

    @property
    def count(self) -> int:
        """How many."""
        return len(self.by_run["objective"])

    def first(self, name: str) -> Any:
        """A variable of the run whose start is not shifted."""
        return self.by_run[name][0].item()


@dataclass(frozen=True)
class Confirmed:
    """A design and what it is judged by: the motion that its worse start comes to.

    That is the settled motion if the start's swing dies in contact, else the mean of its runs; or
    a worse one that random starts come to.
    """

    values: dict[str, float]  # of the free parameters
    objective: float  # NaN if a run failed, whirled or broke a constraint
    half_width: float  # estimated error of the settled motion's, or of the mean's interval
    worse_start: str
    speed: float
    clearance: float
    foundation_rms: float  # of the settled motion, or the mean of the worse start's runs
    shaking_rms: float  # likewise
    ideal_rms: float  # the same machine's with an ideal joint
    capacity: float  # m3/h
    multipliers: list[list[float]]  # of the settled motion; none where there is none
    settled: Settled | None  # None: a scene whose orbits cannot be solved for
    transient: dict[str, Runs]  # by start
    regime: dict[str, jc.Regime] = field(default_factory=dict)  # of starts that do not settle
    companions: tuple[Companion, ...] = ()  # of random starts, the most frequent first

    @property
    def counts(self) -> bool:
        """Whether it may be chosen."""
        return self.objective == self.objective

    @property
    def settles(self) -> bool:
        """Whether it comes to its settled motion from every start."""
        return all(runs.settles for runs in self.transient.values())


@dataclass(frozen=True)
class Refinement:
    """A local search, and its objective at both ends."""

    by: str  # "gradient" of the settled motion, or "fits" to motions from random starts
    path: dict[str, np.ndarray]  # of the free parameters, shape (points,)
    first: float
    last: float
    evaluations: int  # of the objective, with gradients if by them
    gradient: dict[str, float]  # at the end, per unit of the parameter; nothing by fits


@dataclass(frozen=True)
class Held:
    """A limit that holds the optimum: without it the objective would fall."""

    parameter: str  # or "capacity" itself, where the links are free
    limit: str  # "lowest", "highest" or "capacity"
    multiplier: float  # what the objective would gain per unit of the parameter


@dataclass(frozen=True)
class Claim:
    """How far the optimum is the box's."""

    within: float | None  # of the least in the box, in the objective's unit; None: not known
    curvature: float | None  # what second derivatives can hide in a cell: a part of `within`
    open_cells: int  # of the map, without a stable settled motion: nothing is said of them
    gain: float  # of the descents, on the map's best point
    words: str


@dataclass(frozen=True)
class Front:
    """What cannot be had together with the least objective: no point gains in both.

    Points in the order of a rising objective; of a single one there is nothing to trade.
    """

    of: str  # the other number: "capacity" or an objective
    unit: str
    objective: np.ndarray  # (points,)
    other: np.ndarray  # (points,)
    values: dict[str, np.ndarray]  # of the free parameters, (points,)
    forces: dict[str, np.ndarray]  # the RMS of both forces of the settled motions, (points,)


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


@dataclass(frozen=True)
class Sought:
    """What is to be small."""

    name: str
    unit: str
    meaning: str


@dataclass(frozen=True)
class Box:
    """Where it is searched."""

    bounds: dict[str, tuple[float, float]]
    capacity_floor: float  # m3/h
    derived_speed: tuple[float, float]  # rad/s, by the equations of capacity
    units: dict[str, str] = field(default_factory=dict)  # that numbers were given in, where known


@dataclass(frozen=True)
class Answer:
    """All that a search found, and how."""

    command: str
    versions: dict[str, str]
    objective: Sought
    box: Box
    fixed: dict[str, Any]  # of the crusher's description
    seed: int
    status: str = "interrupted"
    seconds: dict[str, float] = field(default_factory=dict)  # by stage
    steps: dict[str, int] = field(default_factory=dict)  # of integrations, by stage
    refinement: tuple[Refinement, ...] = ()
    candidates: tuple[Confirmed, ...] = ()
    settle_turns: int = 0  # of the long runs, before their statistics began
    compared_with: str = "paper's choice"  # or the scene file's
    optimum: Confirmed | None = None
    seed_choice: Confirmed | None = None  # what the optimum is compared with
    empty: str = ""  # why no design may be chosen, or nothing
    orbits: int | None = None  # stable ones of the map; None: there are none to solve for
    ideal: float | None = None  # RMS of the optimum's machine with an ideal joint, N
    held: tuple[Held, ...] = ()  # by what limits the optimum is held; the other slopes vanish
    unheld: dict[str, float] = field(default_factory=dict)  # these slopes; limits have their part
    claim: Claim | None = None
    fronts: tuple[Front, ...] = ()
    gradient_report: jc.GradientReport | None = None  # where the optimum has no settled motion
    checks: tuple[Check, ...] = ()
    remark: str = ""

    @property
    def finished(self) -> bool:
        """Every stage came to its end."""
        return self.status == "finished"

    @property
    def designs(self) -> dict[str, Confirmed]:
        """Those to show, by title, as far as the search came."""
        titled = {"optimum": self.optimum, self.compared_with: self.seed_choice}
        return {title: design for title, design in titled.items() if design is not None}
