"""Options of the design search. This module imports no JAX."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from jaxcrusher.files.results import run_folder

Range = Annotated[tuple[str, str], tyro.conf.arg(metavar="LOW HIGH")]


@dataclass(frozen=True)
class Effort:
    """The effort of a search."""

    cells: tuple[int, int] = (31, 19)
    """Points of the map of periodic orbits along the first and the second parameter."""
    within: float | None = None
    """The map is refined until no other design of the box can be better than the optimum by more
    than this, in the unit of the objective. By default 3e-5 of the optimum."""
    grid: tuple[int, int] = (16, 10)
    """Points of the landscape of both starts along the first and the second parameter."""
    samples: int = 256
    """Points of map and landscape for more than two parameters (Sobol sequence), a power of two."""
    settle: int = 40
    """Turns of the shaft before statistics start."""
    turns: int = 40
    """Turns of the shaft that statistics cover."""
    steps: int = 40
    """Largest number of gradient steps of each descent."""
    starts: int = 32
    """Descents on orbits, in lock-step: half of them start at the best points of the map, half at
    random points."""
    refine: int = 3
    """Number of best ends of descents that are polished and confirmed. With constraints besides
    bounds, or without orbits: numbers of best points and of random points where descents start."""
    runs: int = 5
    """Independent long runs from each start that confirm a candidate."""
    seed: int = 0
    """Seed of the random starts of descents and of the long runs."""


@dataclass(frozen=True)
class Options(Effort):
    """Options of the design search: the problem and the effort."""

    seconds: float | None = None
    """Seconds after which the search stops and writes partial results. The same command continues
    it."""
    name: str = "default"
    """Name of the run: results go to OUT/NAME/."""
    out: Path = Path("results")
    """Folder of all results."""
    scheduler: str | None = None
    """Address of a Dask scheduler, as tcp://host:8786, or a number of local worker processes, for
    map, landscape and long runs. By default this process computes."""
    objective: str | None = None
    """The quantity to minimise. For a crusher rms (the default), peak, smooth_peak, mean: of the
    foundation force |R_O| + |R_C|; shaking_rms, shaking_peak: of the shaking force on the ground;
    expected_rms: under a rough feed (a scene with load_scatter); excess: RMS minus the RMS of the
    ideal joint; joint_peak: in the bearing (all N); shaking_moment_rms: on the ground (N m); wear,
    energy: sliding work and drive energy per volume crushed (J/m3). For a frame on supports
    transmitted_rms, transmitted_peak: of the varying force on the ground (N);
    frame_displacement_peak (m), frame_velocity_rms (m/s). For crushers and linkages any statistic,
    such as shaking_rms (a linkage's default) or B_force_peak. Or module:NAME, an
    `optimize.ask.objectives.Objective` of your own."""
    speed: Range = ("25", "40rad/s")
    """Lowest and highest driving speed, the first in the unit of the second."""
    clearance: Range = ("0.03", "0.12mm")
    """Smallest and largest radial clearance, the first in the unit of the second."""
    design: Annotated[
        tuple[tuple[str, ...], ...],
        tyro.conf.UseAppendAction,
        tyro.conf.arg(metavar="NAME LOW HIGH|SET"),
    ] = ()
    """A free parameter with its bounds, instead of speed and clearance; may be repeated. Names and
    units are as in a scene file: --design counterweight.mass 0 "50 kg". Or a set of parameters at
    equal stroke: balance (9: counterweight, the jaw's mass centre, links) or machine (21: masses,
    inertias, load and bearing as well). NAME LOW HIGH beside a set replaces its bounds."""
    scene: Path | None = None
    """TOML scene file of a linkage, or with the crusher's other numbers; the options below replace
    its values."""
    overrides: Annotated[
        tuple[tuple[str, str], ...],
        tyro.conf.UseAppendAction,
        tyro.conf.arg(name="set", metavar="KEY VALUE"),
    ] = ()
    """A key of the scene file and its value with unit, which replaces the file's value, as in
    --set jaw.mass "480 kg". May be repeated."""
    capacity_floor: float | None = None
    """Least crushing capacity, m3/h; by default the capacity at the lowest speed over 1.67, as in
    the paper: 9.41 / 1.67."""
    bulk_density: str | None = None
    """Bulk density of the crushed rock, as in "1.6 t/m3", for a capacity in t/h beside m3/h."""
    limit: Annotated[
        tuple[tuple[str, str], ...],
        tyro.conf.UseAppendAction,
        tyro.conf.arg(metavar="STATISTIC MOST"),
    ] = ()
    """Upper limit of a statistic of a design's motion, with its unit, as in
    --limit frame_displacement_peak "0.2 mm". May be repeated."""
    inside_model: bool = False
    """Refuse designs whose motion leaves the contact model (wide contact, hard impacts)."""
    slip: str | None = None
    """Definition of the slip speed in the friction law, by its name in a scene file."""
    friction: float | None = None
    """Friction coefficient; 0 means no friction."""
    load_law: str | None = None
    """Law of the crushing load on the jaw, by its name in a scene file; by_angle needs
    --set load_curve FILE."""
    impact_velocity: str | None = None
    """Impact velocity of the contact law, such as 0.5m/s, or the word tracked."""

    @property
    def folder(self) -> Path:
        """The folder of this run."""
        return run_folder(self.out, self.name)
