"""Options of the design search. This module imports no JAX."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from jaxcrusher.files.results import run_folder

Range = Annotated[tuple[str, str], tyro.conf.arg(metavar="LOW HIGH")]


@dataclass(frozen=True)
class Effort:
    """How hard to search."""

    cells: tuple[int, int] = (31, 19)
    """Points of the map of periodic orbits along the first and the second parameter."""
    within: float | None = None
    """How far below the optimum the box may hold another design, in the unit of the objective: the
    map is refined until it is bounded so. By default 3e-5 of the optimum."""
    grid: tuple[int, int] = (16, 10)
    """Points of the landscape, where both starts are run, along the first and the second one."""
    samples: int = 256
    """Points of map and landscape of more than two parameters, a Sobol sequence: a power of two."""
    settle: int = 40
    """Turns of the shaft before statistics start."""
    turns: int = 40
    """Turns of the shaft that statistics cover."""
    steps: int = 40
    """Most gradient steps of each refinement."""
    starts: int = 32
    """Descents on orbits, in lock-step: half of them from the best points of the map, the others
    from random ones."""
    refine: int = 3
    """Best ends of descents that are polished and confirmed. With limits that are no bounds, and
    where there are no orbits: best points to refine from; as many random ones are refined too."""
    runs: int = 5
    """Independent long runs from each start that confirm a candidate."""
    seed: int = 0
    """Seed of the random refinement points and of the confirmation's starts."""


@dataclass(frozen=True)
class Options(Effort):
    """Options of the design search: the problem and the effort."""

    seconds: float | None = None
    """Seconds after which the search ends with what there is. The same command goes on from
    there."""
    name: str = "default"
    """Name of the run: results go to OUT/NAME/."""
    out: Path = Path("results")
    """Folder of all results."""
    scheduler: str | None = None
    """Address of a Dask scheduler, as tcp://host:8786, or a number of local worker processes, for
    map, landscape and long runs; this process without."""
    objective: str | None = None
    """What to make small. Of a crusher rms (without another), peak, smooth_peak, mean: of the
    foundation force |R_O| + |R_C|; shaking_rms, shaking_peak: of what moves of the force on the
    ground; expected_rms under a rough feed (of a scene with load_scatter); excess: the RMS's over
    the ideal joint; joint_peak in the bearing (all N); shaking_moment_rms on the ground (N m);
    wear, energy: sliding work and drive energy per volume crushed (J/m3). Of a frame on supports
    transmitted_rms, transmitted_peak: of what moves of the force that they pass to the ground (N);
    frame_displacement_peak (m) and frame_velocity_rms (m/s). Of a linkage any statistic, such as
    shaking_rms (without another) or B_force_peak; so of a crusher too. Or module:NAME, an
    `optimize.ask.objectives.Objective` of your own."""
    speed: Range = ("25", "40rad/s")
    """Lowest and highest driving speed, the first in the unit of the second."""
    clearance: Range = ("0.03", "0.12mm")
    """Smallest and largest radial clearance, likewise."""
    design: Annotated[
        tuple[tuple[str, ...], ...],
        tyro.conf.UseAppendAction,
        tyro.conf.arg(metavar="NAME LOW HIGH|SET"),
    ] = ()
    """A free parameter with its bounds, instead of speed and clearance, as often as needed.
    Names and units as in a scene file: --design counterweight.mass 0 "50 kg". Or a set of them at
    equal stroke: balance (9: counterweight, the jaw's mass centre, links) or machine (21: masses,
    inertias, load and bearing as well); a line NAME LOW HIGH beside it gives a number other
    bounds."""
    scene: Path | None = None
    """TOML scene file with the crusher's other numbers, or of a linkage; the options below go
    before it."""
    overrides: Annotated[
        tuple[tuple[str, str], ...],
        tyro.conf.UseAppendAction,
        tyro.conf.arg(name="set", metavar="KEY VALUE"),
    ] = ()
    """A key of the scene file and its value with its unit, over the file's, as in
    --set jaw.mass "480 kg". May be repeated."""
    capacity_floor: float | None = None
    """Least crushing capacity, m3/h; by default that at the lowest speed over 1.67, as in the
    paper: 9.41 / 1.67."""
    bulk_density: str | None = None
    """Bulk density of the crushed rock, as in "1.6 t/m3", for a capacity in t/h beside m3/h."""
    limit: Annotated[
        tuple[tuple[str, str], ...],
        tyro.conf.UseAppendAction,
        tyro.conf.arg(metavar="STATISTIC MOST"),
    ] = ()
    """The most that a statistic of a design's motion may be, with its unit, as in
    --limit frame_displacement_peak "0.2 mm". May be repeated."""
    inside_model: bool = False
    """Refuse designs whose motion leaves the contact model (wide contact, hard impacts)."""
    slip: str | None = None
    """Reading of the slip speed in the friction law, by its name in a scene file."""
    friction: float | None = None
    """Friction coefficient; 0 leaves friction out."""
    load_law: str | None = None
    """Law of the crushing load on the jaw, by its name in a scene file; by_angle comes with
    --set load_curve FILE."""
    impact_velocity: str | None = None
    """Impact velocity of the contact law, such as 0.5m/s, or tracked."""

    @property
    def folder(self) -> Path:
        """The folder of this run."""
        return run_folder(self.out, self.name)
