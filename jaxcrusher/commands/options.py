"""The command line of `python -m jaxcrusher`: the options of each command. It imports no JAX."""

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
    """The crusher, or another linkage."""

    scene: Path | None = None
    """TOML file of the crusher. Missing numbers are those of the PE250x400. With kind = "linkage"
    the file describes any linkage."""
    overrides: Pairs = ()
    """A key of the scene file and its value with unit, which replaces the file's value, as in
    --set clearance 0.06mm --set speed "286 rpm" --set friction 0.05. May be repeated."""


@dataclass(frozen=True)
class Results:
    """The folder of the results."""

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

    Writes OUT/NAME/motion.nc (forces, positions, powers and energies over time) and motion.png (the
    last two turns: path of the pin, and force on the foundation beside that of an ideal joint).
    Ten turns take about 10 s, most of it compilation.
    """

    crusher: Crusher = field(default_factory=Crusher)
    turns: float | None = None
    """Time span in turns of the shaft; by default 10."""
    seconds: float | None = None
    """Time span in s, in place of --turns."""
    samples: int = 10_001
    """Number of instants in the file, evenly spaced over the time span."""
    settle: int | None = None
    """Turns before the statistics of the last line start; by default half of the time span."""
    rtol: float = 1e-11
    """Tolerance of a step, in clearances and m/s. It is tighter than for statistics, since impacts
    amplify errors of a time history."""
    csv: bool = False
    """Also write OUT/NAME/motion.csv, with a row for each instant."""
    mat: bool = False
    """Also write OUT/NAME/motion.mat for MATLAB."""
    results: Results = field(default_factory=lambda: Results("simulate"))


@dataclass(frozen=True)
class Sweep:
    """Compute statistics over a grid of crushers, and save them chunk by chunk.

    Writes the Zarr store OUT/NAME/sweep.zarr, which xarray opens, and with two ranges sweep.png, a
    map of the RMS force on the foundation. After an interruption the same command continues. It
    takes about 20 s of compilation, and then on each core about a second for each design with the
    default turns.
    """

    crusher: Crusher = field(default_factory=Crusher)
    over: Ranges = ()
    """A parameter, its range and a count, as in --over speed 25 40rad/s 16 or --over clearance
    0.03 "0.12 mm" 10: the unit of the highest value is that of the lowest too. Or a choice and its
    values, as in --over start centred contact. May be repeated: the grid is the product of all."""
    settle: int = 40
    """Turns of the shaft before statistics start."""
    turns: int = 40
    """Turns of the shaft that statistics cover."""
    chunk: int | None = None
    """Designs saved together, which an interruption can lose. Each chunk is one file for each
    variable. By default 1024, on a GPU 65 536."""
    engine: Literal["lanes", "loop", "vmap", "gpu"] | None = None
    """Engine that computes the designs. By default "gpu" if CuPy finds a GPU and a chunk has 16 384
    designs or more, else "lanes"."""
    rtol: float = 1e-9
    """Tolerance of a step, in clearances and m/s."""
    scheduler: str | None = None
    """Address of a Dask scheduler, as tcp://host:8786, or a number of local worker processes. By
    default this process computes."""
    netcdf: bool = False
    """Also write OUT/NAME/sweep.nc at the end."""
    csv: bool = False
    """Also write OUT/NAME/sweep.csv at the end, with a row for each crusher."""
    mat: bool = False
    """Also write OUT/NAME/sweep.mat at the end, for MATLAB."""
    results: Results = field(default_factory=lambda: Results("sweep"))


@dataclass(frozen=True)
class Regimes:
    """Classify the motion of some designs: periodic, chaotic, whirl and so on.

    Writes OUT/NAME/regimes.json and regimes.nc after each design, and for a grid of two ranges
    regimes.png. The same command skips finished designs, and may name further ones. With the
    default turns the first design takes about a minute, most of it compilation, and each further
    design 5 to 30 s.
    """

    crusher: Crusher = field(default_factory=Crusher)
    over: Ranges = ()
    """A parameter and its range, or a choice and its values, as in sweep. The grid is the product
    of all."""
    design: Designs = ()
    """A design of a list, in place of --over, as in --design "speed=25 rad/s, clearance=0.03 mm".
    May be repeated; all name the same keys. Without both options: the crusher as it is."""
    settle: int = 200
    """Turns of the shaft before the analysed motion starts."""
    turns: int = 1000
    """Turns of the Poincare section that are analysed, at least 20."""
    tangent_turns: int = 100
    """Further turns for the Lyapunov exponents."""
    rtol: float = 1e-10
    """Tolerance of a step, in clearances and m/s. It is tighter than for statistics, because it
    decides which points of the section repeat."""
    results: Results = field(default_factory=lambda: Results("regimes"))


@dataclass(frozen=True)
class Gradient:
    """Compute slopes of a statistic, each with a verdict: ok, undecided, doubtful or refused.

    Writes OUT/NAME/gradient.json, from which the same command reads the answer later. With the
    default turns it takes one to four minutes, most of it compilation; a chaotic motion takes
    longer than a periodic one.
    """

    metric: Annotated[str, tyro.conf.Positional] = ""
    """The statistic by its name in jaxcrusher.statistics: foundation_rms, winding, drive_power and
    so on; an unknown name, as in "gradient any", lists them all. By default foundation_rms of a
    crusher, and shaking_rms of another linkage."""
    crusher: Crusher = field(default_factory=Crusher)
    by: tuple[str, ...] = ()
    """Keys of the scene file to differentiate by; by default the speed and all clearances. Slopes
    are printed per unit in which each value is given; gradient.json has SI units."""
    settle: int = 50
    """Turns of the shaft before the statistic starts."""
    turns: int = 50
    """Turns of the shaft that the statistic covers."""
    radius: float = 0.01
    """Size of the changes that check a derivative, as a share of each value (a value of 0: of its
    scale)."""
    pairs: int = 32
    """Pairs of runs for the fit of a chaotic motion."""
    seed: int = 0
    """Seed of the fit's random runs."""
    rtol: float = 1e-9
    """Tolerance of a step, in clearances and m/s."""
    results: Results = field(default_factory=lambda: Results("gradient"))


@dataclass(frozen=True)
class Orbit:
    """Solve for the periodic orbit of a crusher: RMS, multipliers, and slopes by every parameter.

    Writes OUT/NAME/orbit.json, orbit.csv (all observables over the shaft's angle) and orbit.png
    (path of the pin, and force on the foundation beside that of an ideal joint). It takes about
    half a minute, most of it compilation.
    """

    crusher: Crusher = field(default_factory=Crusher)
    period: int = 1
    """Period of the motion in turns of the shaft."""
    effort: Literal["quick", "usual", "thorough"] = "usual"
    """Effort of the search for the orbit; thorough may take minutes. Ctrl-C ends the search and
    prints what is known."""
    mat: bool = False
    """Also write OUT/NAME/orbit.mat for MATLAB, with the content of orbit.csv."""
    results: Results = field(default_factory=lambda: Results("orbit"))


@dataclass(frozen=True)
class Film:
    """Film a machine: mechanism, magnified loose pins in their bores, and force over the turn.

    Writes OUT/NAME/film.html (a page that plays without a network), film.gif, film.mp4 if ffmpeg is
    installed, and film.png (the instant of the largest force). It takes about a minute, most of it
    for compilation and drawing.
    """

    crusher: Crusher = field(default_factory=Crusher)
    motion: Literal["orbit", "run"] = "orbit"
    """The filmed motion: the periodic orbit, or a run. Without an orbit the film shows a run; its
    title says which motion it shows."""
    period: int = 1
    """Period of the orbit in turns of the shaft."""
    effort: Literal["quick", "usual", "thorough"] = "usual"
    """Effort of the search for the orbit; thorough may take minutes."""
    settle: int = 20
    """Turns of the shaft before the filmed turns of a run."""
    turns: int = 2
    """Filmed turns of a run."""
    frames: int = 120
    """Number of pictures, at most 150. The film shows 20 in a second."""
    results: Results = field(default_factory=lambda: Results("film"))


@dataclass(frozen=True)
class Foundation:
    """Make the load sheet of a crusher for the engineer who designs its foundation.

    A column has the exact numbers of ideal joints. If joints are loose, another column has the
    means of a run with their standard error. Writes OUT/NAME/sheet.html (pages of A4), sheet.csv
    (the same numbers and the harmonics of the motion), and run_up.png (RMS forces over the speed).
    It takes at most a minute, some of it for compilation.
    """

    crusher: Crusher = field(default_factory=Crusher)
    orders: int = 4
    """Highest harmonic of the shaft's speed in the sheet."""
    speeds: tuple[str, str] | None = None
    """Lowest and highest speed of the picture, as in --speeds 100 400rpm; by default half and twice
    the crusher's speed."""
    points: int = 61
    """Number of speeds in the picture."""
    settle: int = 20
    """Turns of the run before the turns of the sheet start."""
    turns: int = 40
    """Turns of the run that the sheet covers, in steps of five."""
    seconds: float = 35.0
    """Longest time of the run; the sheet says how many turns it had. Runs with half and twice the
    numbers on which impacts depend may add half of this time."""
    resonance: tuple[float, float] = (0.7, 1.3)
    """Multiples of each order's frequency between which a natural frequency is checked for
    resonance."""
    dynamic_factor: float = 3.0
    """Factor on the moving part of the equivalent static loads."""
    run_up: str = "10 s"
    """Time from standstill to the running speed, and from there to standstill."""
    results: Results = field(default_factory=lambda: Results("foundation"))


@dataclass(frozen=True)
class Balance:
    """Compute the counterweight that makes the first order of the shaking force least.

    A closed form gives it for ideal joints. The periodic orbits of the real machine with and
    without the counterweight show the effect of clearance. Writes OUT/NAME/balance.json and
    balance.png. It takes about half a minute, most of it compilation.
    """

    crusher: Crusher = field(default_factory=Crusher)
    radius: str | None = None
    """Radius of the counterweight about the crank's bearing, as in --radius "350 mm". By default
    the crusher's counterweight.radius, or the length of another linkage's crank."""
    effort: Literal["quick", "usual", "thorough"] = "usual"
    """Effort of the search for the two orbits; thorough may take minutes."""
    results: Results = field(default_factory=lambda: Results("balance"))


@dataclass(frozen=True)
class Bearing:
    """Compare the bearings of machines side by side: loads, life, safety and impacts.

    The numbers are from a run, and each has its scatter. If contact is lost, the run is repeated
    with half and twice the assumed damping and edge of the load. Writes OUT/NAME/bearing.csv. It
    takes some seconds for each machine, and ten seconds of compilation.
    """

    crusher: Crusher = field(default_factory=Crusher)
    over: Ranges = ()
    """A parameter, its range and a count, as in --over speed 200 220rpm 2 or --over clearance 0.2
    "0.35 mm" 2. The table has a column for each machine of the grid."""
    settle: int = 20
    """Turns of the shaft before the turns that count."""
    turns: int = 40
    """Turns that count, in steps of five."""
    joint: str | None = None
    """First joint of the tables; by default a crusher's main bearing, or the only loose joint."""
    wear: tuple[str, str] | None = None
    """Coefficient of wear and width of the bores, as in --wear "1e-14 m2/N" "400 mm". It adds the
    growth of the clearances of sliding joints by Archard's law."""
    hours: tuple[float, ...] = ()
    """Hours of work after which each machine is run again, with clearances that have grown since
    the previous run."""
    seconds: float = 40.0
    """Longest time of all runs; a line below the tables says how many turns they had."""
    results: Results = field(default_factory=lambda: Results("bearing"))


@dataclass(frozen=True)
class Compare:
    """Compare crushers side by side: capacity, shaking force, peaks, wear and energy.

    Writes OUT/NAME/compare.csv and compare.png. The numbers are those of the stable periodic orbit;
    without such an orbit they are means over turns of the shaft. It takes about half a minute, most
    of it compilation.
    """

    scenes: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    """TOML files of the crushers."""
    settle: int = 40
    """Turns of the shaft before means start, if there is no orbit."""
    turns: int = 40
    """Turns of the shaft that means cover, if there is no orbit."""
    bulk_density: str | None = None
    """Bulk density of the crushed rock, as in "1.6 t/m3", for a capacity in t/h."""
    results: Results = field(default_factory=lambda: Results("compare"))


@dataclass(frozen=True)
class Identify:
    """Estimate parameters of a machine from its measured vibration, and what the data cannot tell.

    Writes OUT/NAME/identified.json and identified.png (measured and fitted amplitudes, a corner
    plot of the estimates). It takes about a minute the first time, most of it compilation, and
    later some seconds.
    """

    crusher: Crusher = field(default_factory=Crusher)
    measured: tuple[Path, ...] = ()
    """CSV files of harmonics and RMS values with the columns speed_rpm, quantity, order, amplitude,
    phase_deg, sigma and unit, or of time series with time, angle_deg and quantities. A quantity is
    named with its direction, as main_cap_acceleration_y; a point NAME of [foundation.points] has
    NAME_velocity and NAME_acceleration. See examples/measured.csv."""
    free: tuple[str, ...] = ()
    """Keys of the scene file to be estimated; the search begins at their values."""
    prior: Priors = ()
    """Prior knowledge of a parameter, as in --prior foundation.mass "6 t" "0.3 t": its mean and its
    standard deviation. May be repeated."""
    starts: int = 3
    """Number of starts of the search: the values of the scene file, and others around them."""
    orders: int = 4
    """Highest harmonic that is computed from a time series."""
    noise: float = 0.01
    """Standard deviation of a further measurement, as a share of the observable's RMS. The most
    informative further measurements are printed. 0 omits them, and half of the compilation."""
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
