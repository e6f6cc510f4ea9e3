"""The command line of `python -m jaxcrusher`: what each command can be told. Imports no JAX."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from jaxcrusher.files.results import run_folder

# Repeated options: KEY VALUE pairs, NAME LOW HIGH COUNT, and whole designs.
Pairs = Annotated[
    tuple[tuple[str, str], ...],
    tyro.conf.UseAppendAction,
    tyro.conf.arg(name="set", metavar="KEY VALUE"),
]
Ranges = Annotated[
    tuple[tuple[str, ...], ...],
    tyro.conf.UseAppendAction,
    tyro.conf.arg(metavar="NAME LOW HIGH COUNT"),
]
Priors = Annotated[
    tuple[tuple[str, str, str], ...],
    tyro.conf.UseAppendAction,
    tyro.conf.arg(metavar="NAME MEAN SIGMA"),
]
Designs = Annotated[
    tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="KEY=VALUE,...")
]


@dataclass(frozen=True)
class Crusher:
    """Which crusher."""

    scene: Path | None = None
    """TOML file of the crusher; what it leaves out is the PE250x400's. With kind = "linkage" it is
    of any linkage."""
    overrides: Pairs = ()
    """A key of the scene file and its value with its unit, over the file's, as in
    --set clearance 0.06mm --set speed "286 rpm" --set friction 0.05. May be repeated."""


@dataclass(frozen=True)
class Results:
    """Where results go."""

    name: str
    """Name of the run: results go to OUT/NAME/."""
    out: Path = Path("results")
    """Folder of all results."""

    @property
    def folder(self) -> Path:
        """The folder of this run."""
        return run_folder(self.out, self.name)


@dataclass(frozen=True)
class Simulate:
    """Simulate one crusher.

    Writes OUT/NAME/motion.nc (forces, positions, powers and energies over time) and motion.png
    (orbit of the pin and force on the foundation, the last two turns, with the ideal joint's).
    Ten turns take about 10 s, most of it compilation.
    """

    crusher: Crusher = field(default_factory=Crusher)
    turns: float | None = None
    """Time span in turns of the shaft; 10 without --seconds."""
    seconds: float | None = None
    """Time span in s, in place of --turns."""
    samples: int = 10_001
    """Instants written, evenly over the time span."""
    settle: int | None = None
    """Turns before the closing line's statistics start; half of the time span."""
    rtol: float = 1e-11
    """Tolerance of a step, in clearances and m/s: tighter than for statistics, since impacts
    multiply errors of a history."""
    csv: bool = False
    """Also write OUT/NAME/motion.csv, a row an instant."""
    mat: bool = False
    """Also write OUT/NAME/motion.mat for MATLAB."""
    results: Results = field(default_factory=lambda: Results("simulate"))


@dataclass(frozen=True)
class Sweep:
    """Statistics over a grid of crushers, kept chunk by chunk.

    Writes the Zarr store OUT/NAME/sweep.zarr, which xarray opens, and with two ranges sweep.png, a
    map of the RMS force on the foundation. Interrupted or killed, the same command goes on where it
    was. About 20 s of compilation, then about a second a design and
    core with the default turns.
    """

    crusher: Crusher = field(default_factory=Crusher)
    over: Ranges = ()
    """A parameter, its range and a count, as in --over speed 25 40rad/s 16 or --over clearance
    0.03 "0.12 mm" 10: the unit of the last counts for the first. Or a choice and what to choose, as
    in --over start centred contact. May be repeated: the grid is the product of all."""
    settle: int = 40
    """Turns of the shaft before statistics start."""
    turns: int = 40
    """Turns of the shaft that statistics cover."""
    chunk: int | None = None
    """Designs kept at once: what an interruption can lose. Each chunk is a file of every
    variable. Without it 1024, on a GPU 65 536."""
    engine: Literal["lanes", "loop", "vmap", "gpu"] | None = None
    """What computes the designs. Without it "gpu" where CuPy finds one and a chunk has 16 384
    designs or more, and "lanes" elsewhere."""
    rtol: float = 1e-9
    """Tolerance of a step, in clearances and m/s."""
    scheduler: str | None = None
    """Address of a Dask scheduler, as tcp://host:8786, or a number of local worker processes;
    this process without."""
    netcdf: bool = False
    """Also write OUT/NAME/sweep.nc at the end."""
    csv: bool = False
    """Also write OUT/NAME/sweep.csv at the end, a row a crusher."""
    mat: bool = False
    """Also write OUT/NAME/sweep.mat at the end, for MATLAB."""
    results: Results = field(default_factory=lambda: Results("sweep"))


@dataclass(frozen=True)
class Regimes:
    """Classify the motion of some designs: periodic, chaotic, whirl and so on.

    Writes OUT/NAME/regimes.json and regimes.nc after each design; the same command does not do
    again what is done, and may name further designs. A grid of two ranges is drawn, regimes.png.
    With the default turns about a minute for the first design, most of it compilation, and 5 to
    30 s for each of the others.
    """

    crusher: Crusher = field(default_factory=Crusher)
    over: Ranges = ()
    """A parameter and its range, or a choice and what to choose, as in sweep; the grid is the
    product of all."""
    design: Designs = ()
    """A design of a list instead, as in --design "speed=25 rad/s, clearance=0.03 mm". May be
    repeated; all name the same keys. Without --over and --design: the crusher as it is."""
    settle: int = 200
    """Turns of the shaft before the motion is looked at."""
    turns: int = 1000
    """Turns of which the section is looked at, at least 20."""
    tangent_turns: int = 100
    """Further turns for the exponents."""
    rtol: float = 1e-10
    """Tolerance of a step, in clearances and m/s: tighter than for statistics, since points that
    repeat are told by it."""
    results: Results = field(default_factory=lambda: Results("regimes"))


@dataclass(frozen=True)
class Gradient:
    """Slopes of a statistic, each with a verdict: ok, undecided, doubtful or refused.

    Writes OUT/NAME/gradient.json; the same question again is answered from it. With the default
    turns one to four minutes, most of it compilation; a chaotic motion takes longer than a
    periodic one.
    """

    metric: Annotated[str, tyro.conf.Positional] = ""
    """The statistic, as jaxcrusher.statistics names them: foundation_rms, winding, drive_power and
    so on; an unknown one, as in "gradient any", lists them all. Without it foundation_rms of a
    crusher, and shaking_rms of another linkage."""
    crusher: Crusher = field(default_factory=Crusher)
    by: tuple[str, ...] = ()
    """Keys of the scene file to differentiate by; without it the speed and all clearances. Slopes
    are printed by the units that their values are given in; gradient.json has SI units."""
    settle: int = 50
    """Turns of the shaft before the statistic starts."""
    turns: int = 50
    """Turns of the shaft that the statistic covers."""
    radius: float = 0.01
    """Radius of what checks a derivative, as a share of each value (of its scale where it is 0)."""
    pairs: int = 32
    """Pairs of runs of a fit of a chaotic motion."""
    seed: int = 0
    """Seed of the fit's random runs."""
    rtol: float = 1e-9
    """Tolerance of a step, in clearances and m/s."""
    results: Results = field(default_factory=lambda: Results("gradient"))


@dataclass(frozen=True)
class Orbit:
    """The periodic orbit of a crusher: RMS, multipliers, and slopes by every number of it.

    Solved for, not waited for: half a minute, most of it compilation. Writes OUT/NAME/orbit.json,
    orbit.csv (all observables over the shaft's angle) and orbit.png (orbit of the pin, and force
    on the foundation with the ideal joint's).
    """

    crusher: Crusher = field(default_factory=Crusher)
    period: int = 1
    """Turns after which the motion repeats."""
    effort: Literal["quick", "usual", "thorough"] = "usual"
    """How far the orbit is searched for: thorough waits as long as it takes. Ctrl-C tells what is
    known by then."""
    mat: bool = False
    """Also write OUT/NAME/orbit.mat for MATLAB: what orbit.csv holds."""
    results: Results = field(default_factory=lambda: Results("orbit"))


@dataclass(frozen=True)
class Film:
    """A film of a machine: mechanism, loose pins in their bores magnified, force over the turn.

    Writes OUT/NAME/film.html (a page that plays without a network), film.gif, film.mp4 where ffmpeg
    is installed, and film.png (the instant of the largest force). About a minute, most of it
    compilation and drawing.
    """

    crusher: Crusher = field(default_factory=Crusher)
    motion: Literal["orbit", "run"] = "orbit"
    """What is filmed: the periodic orbit, or a run. Where there is no orbit, it is a run, as the
    title says."""
    period: int = 1
    """Turns after which the orbit repeats."""
    effort: Literal["quick", "usual", "thorough"] = "usual"
    """How far the orbit is searched for: thorough waits as long as it takes."""
    settle: int = 20
    """Turns of the shaft before those of a run that are filmed."""
    turns: int = 2
    """Turns of a run that are filmed."""
    frames: int = 120
    """Pictures of the film, 20 a second, at most 150."""
    results: Results = field(default_factory=lambda: Results("film"))


@dataclass(frozen=True)
class Foundation:
    """The load sheet of a crusher for whoever lays out its foundation.

    Its columns are the machine with ideal joints, exactly, and where joints are loose the means of
    a run with their standard error. Writes OUT/NAME/sheet.html (pages of A4), sheet.csv (the same
    numbers and the harmonics of the motion), and run_up.png (what shakes the ground over the
    speed). At most a minute, some of it compilation.
    """

    crusher: Crusher = field(default_factory=Crusher)
    orders: int = 4
    """Highest harmonic of the shaft's speed that the sheet has."""
    speeds: tuple[str, str] | None = None
    """Lowest and highest speed of the picture, as in --speeds 100 400rpm; by default from half of
    the crusher's speed to twice that speed."""
    points: int = 61
    """Speeds of the picture."""
    settle: int = 20
    """Turns of the loose machine before those of the sheet."""
    turns: int = 40
    """Turns of the loose machine that the sheet has, in steps of five."""
    seconds: float = 35.0
    """Time that the run may take; the sheet says how many turns it had. Runs with half and twice of
    what impacts rest on may take half of it besides."""
    resonance: tuple[float, float] = (0.7, 1.3)
    """Times each order of the shaft between which it is judged whether a natural frequency is in
    resonance."""
    dynamic_factor: float = 3.0
    """Of the equivalent static loads: what moves counts so often."""
    run_up: str = "10 s"
    """Time from standstill to the running speed, and back."""
    results: Results = field(default_factory=lambda: Results("foundation"))


@dataclass(frozen=True)
class Balance:
    """The counterweight that makes the first order of the shaking force least, in closed form.

    It follows from the machine with ideal joints. The periodic orbit of the machine as it is, with
    and without it, shows what clearance leaves of that. Writes OUT/NAME/balance.json and
    balance.png. About half a minute, most of it compilation.
    """

    crusher: Crusher = field(default_factory=Crusher)
    radius: str | None = None
    """Radius of the counterweight about the crank's bearing, as in --radius "350 mm"; by default
    the crusher's counterweight.radius, and of another linkage the length of its crank."""
    effort: Literal["quick", "usual", "thorough"] = "usual"
    """How far the two orbits are searched for."""
    results: Results = field(default_factory=lambda: Results("balance"))


@dataclass(frozen=True)
class Bearing:
    """What the bearings of a machine stand: loads, life, safety, impacts, side by side.

    Of a run: every number has its scatter. Where contact is lost, the same with half and with
    twice what was assumed of damping and of the load's edge. Writes OUT/NAME/bearing.csv. Some
    seconds a machine, and ten of compilation.
    """

    crusher: Crusher = field(default_factory=Crusher)
    over: Ranges = ()
    """A parameter, its range and a count, as in --over speed 200 220rpm 2 or --over clearance 0.2
    "0.35 mm" 2; a column for each machine of the grid."""
    settle: int = 20
    """Turns of the shaft before those that count."""
    turns: int = 40
    """Turns that count, in steps of five."""
    joint: str | None = None
    """The joint to look at first: of a crusher main, of another linkage its only loose one."""
    wear: tuple[str, str] | None = None
    """Coefficient of wear and width of the bores, as in --wear "1e-14 m2/N" "400 mm": adds how fast
    the clearances of sliding joints grow by Archard's law."""
    hours: tuple[float, ...] = ()
    """Hours of work after which each machine is run again, with clearances that have grown since
    the run before."""
    seconds: float = 40.0
    """Time that all runs may take; the table says how many turns they had."""
    results: Results = field(default_factory=lambda: Results("bearing"))


@dataclass(frozen=True)
class Compare:
    """Crushers side by side: capacity, shaking, peaks, wear and energy.

    Writes OUT/NAME/compare.csv and compare.png. The numbers are those of the periodic orbit where
    the machine comes to one, else means over turns of the shaft. About half a minute, most of it
    compilation.
    """

    scenes: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    """TOML files of the crushers."""
    settle: int = 40
    """Turns of the shaft before means start, where there is no orbit."""
    turns: int = 40
    """Turns of the shaft that means cover, where there is no orbit."""
    bulk_density: str | None = None
    """Bulk density of the crushed rock, as in "1.6 t/m3", for a capacity in t/h."""
    results: Results = field(default_factory=lambda: Results("compare"))


@dataclass(frozen=True)
class Identify:
    """Numbers of a machine from its measured vibration, and what the data cannot tell.

    Writes OUT/NAME/identified.json and identified.png (measured and fitted amplitudes, a corner
    plot of the estimates). About a minute the first time, most of it compilation, and some seconds
    then.
    """

    crusher: Crusher = field(default_factory=Crusher)
    measured: tuple[Path, ...] = ()
    """CSV files of harmonics and RMS values with the columns speed_rpm, quantity, order, amplitude,
    phase_deg, sigma and unit, or of time series with time, angle_deg and quantities. A quantity is
    one of the machine with its direction, as main_cap_acceleration_y; a point NAME of
    [foundation.points] has NAME_velocity and NAME_acceleration. See examples/measured.csv."""
    free: tuple[str, ...] = ()
    """Keys of the scene file to be found; the search begins at their values."""
    prior: Priors = ()
    """What else is known of a number, as in --prior foundation.mass "6 t" "0.3 t": its mean and
    its standard deviation. May be repeated."""
    starts: int = 3
    """Starts of the search: values of the scene file, and others around them."""
    orders: int = 4
    """Highest harmonic that is taken from a time series."""
    noise: float = 0.01
    """Standard deviation of a further measurement, as a share of the observable's RMS: what would
    tell most, of all that sensors can show, is printed. 0 leaves that out, and half of the
    compilation."""
    results: Results = field(default_factory=lambda: Results("identify"))


Command = (
    Simulate
    | Sweep
    | Regimes
    | Gradient
    | Orbit
    | Film
    | Foundation
    | Balance
    | Bearing
    | Compare
    | Identify
)
