"""The answer of a search: filled stage by stage, with None or nothing where a stage did not come.

Numbers are in SI units, objectives in their own. `dataclasses.asdict` makes result.json of it.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

import jaxcrusher as jc


@dataclass(frozen=True)
class Runs:
    """Independent long runs of a design from one start."""

    objective_mean: float
    objective_half_width: float  # of the mean's confidence interval, from the scatter of the runs
    validity: jc.Validity  # of the first run
    state: np.ndarray  # at the end of the first run, as in `jaxcrusher.Section`
    by_run: dict[str, np.ndarray]  # every variable, shape (runs,); the first start is not shifted

    @property
    def count(self) -> int:
        """How many."""
        return len(self.by_run["objective"])

    def first(self, name: str) -> Any:
        """A variable of the run whose start is not shifted."""
        return self.by_run[name][0].item()


@dataclass(frozen=True)
class Confirmed:
    """A design and what it is judged by: the mean objective of the worse start's runs."""

    values: dict[str, float]  # of the free parameters
    objective: float  # NaN if a run failed, whirled or broke a constraint
    half_width: float
    worse_start: str
    speed: float
    clearance: float
    foundation_rms: float  # mean of the runs, larger of both starts
    ideal_rms: float  # the same machine's with an ideal joint
    capacity: float  # m3/h
    runs: dict[str, Runs]  # by start
    regime: dict[str, jc.Regime] = field(default_factory=dict)  # by start


@dataclass(frozen=True)
class Refinement:
    """A local search, and its objective at both ends."""

    by: str  # "gradient" of the quiet motion, or "fits" to motions from random starts
    exponent: float  # the largest of the landscape's point next to its start, a turn
    path: dict[str, np.ndarray]  # of the free parameters, shape (points,)
    first: float
    last: float
    gradient: dict[str, float]  # at the end; nothing by fits


@dataclass(frozen=True)
class Claim:
    """How far the optimum is the box's."""

    confidence: float
    half_width: float
    bound: float | None  # of the objective's change within half a cell; None without a grid
    gain: float  # of the descents, on the landscape's best point
    gain_half_width: float
    words: str


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
    candidates: tuple[Confirmed, ...] = ()  # the landscape's best point first
    optimum: Confirmed | None = None
    seed_choice: Confirmed | None = None  # the paper's
    claim: Claim | None = None
    gradient_report: jc.GradientReport | None = None
    checks: tuple[Check, ...] = ()
    remark: str = ""

    @property
    def finished(self) -> bool:
        """Every stage came to its end."""
        return self.status == "finished"

    @property
    def designs(self) -> dict[str, Confirmed]:
        """Those to show, by title, as far as the search came."""
        titled = {"optimum": self.optimum, "paper's choice": self.seed_choice}
        return {title: design for title, design in titled.items() if design is not None}
