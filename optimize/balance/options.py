"""What the design study can be told, and the design it makes of that."""

import math
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from jaxcrusher.basics.checks import require, require_positive, require_whole, require_within
from jaxcrusher.files.results import results_folder
from jaxcrusher.scenes.parameters import PARAMETERS, PE250X400
from optimize.design import CounterweightMoment, Design
from optimize.stroke import EqualStroke

LINKS = ("toggle.length", "bearing.distance", "bearing.inclination", "jaw.length")
# Beyond 5 % the toggle can come so flat that no eccentricity gives the stroke.
MOST_LINKS = 5.0
# A flywheel of this crusher has room for it; 14 kg m at the smallest radius are 200 kg.
COUNTERWEIGHT = {
    "counterweight.moment_along": (-14.0, 14.0),
    "counterweight.moment_across": (-14.0, 14.0),
    "counterweight.radius": (0.1, 0.35),
}
# No counterweight: the paper's machine, at the radius of the description.
PAPER = {**PE250X400, "counterweight.moment_along": 0.0, "counterweight.moment_across": 0.0}


@dataclass(frozen=True)
class Options:
    """Choose counterweight, mass centre and links of a PE250x400 that shake its foundation least,
    at equal stroke, capacity and speed: a gradient search against two rivals without gradients.
    """  # noqa: D205

    name: str = "balance"
    """Name of the study: results go to OUT/NAME/."""
    out: Path = Path("results")
    """Folder of all results."""
    speed: float = 30.0
    """Driving speed, rad/s."""
    clearance: float = 0.06
    """Radial clearance, mm."""
    links: float = MOST_LINKS
    """Lengths, bearing distance and inclination may change by this many percent, up to 5."""
    starts: int = 10
    """Random starts of every method."""
    budget: int = 1000
    """Work of a search, in values of the objective."""
    turns: int = 2
    """Turns of the shaft of one value, from the start in contact."""
    samples: int = 32
    """Conditions that a robust design is judged under."""
    tolerance: tuple[float, float, float] = (0.5, 0.5, 0.2)
    """Relative tolerances of clearance, friction and load."""
    sigmas: float = 3.0
    """Standard deviations that a robust design counts on top of the mean."""
    settle: int = 160
    """Turns of the confirmation before its statistics start, and as many that they cover."""
    seed: int = 0
    """Seed of the starts and of the samples."""

    def check(self) -> None:
        """Raise ValueError for a value outside its limits, before anything is compiled."""
        require_positive("speed", self.speed, "rad/s")
        bore = 1e3 * float(PE250X400["bore_radius"])
        good = math.isfinite(self.clearance) and 0 < self.clearance < bore
        require(good, "clearance", f"lie in (0, {bore:g}) mm", self.clearance)
        good = 0 < self.links <= MOST_LINKS
        require(good, "links", f"lie in (0, {MOST_LINKS:g}] percent", self.links)
        for name, least in (
            ("starts", 1),
            ("budget", 1),
            ("turns", 1),
            ("samples", 2),
            ("settle", 2),
            ("seed", 0),
        ):
            require_whole(name, getattr(self, name), least)
        for width in self.tolerance:
            require_within("tolerance", width, 0.0, 0.9)
        require_within("sigmas", self.sigmas, 0.0, 10.0)

    def folder(self) -> Path:
        """Make the results' folder; ValueError if it cannot be written."""
        return results_folder(self.out, self.name)

    def numbers(self) -> dict:
        """What the answer depends on, for result.json."""
        kept = {name: value for name, value in asdict(self).items() if name not in ("name", "out")}
        return {name: list(v) if isinstance(v, tuple) else v for name, v in kept.items()}

    def command(self) -> str:
        """The command that makes this study, wherever it is written."""
        words = ["python -m optimize.balance"]
        for name, default in Options().numbers().items():
            value = self.numbers()[name]
            if value != default:
                values = value if isinstance(value, list) else [value]
                words.append(" ".join([f"--{name}", *(f"{entry:g}" for entry in values)]))
        return " ".join(words)

    def conditions(self) -> dict[str, float]:
        """The clearance (m), friction and load (N) that the machine is meant for."""
        described = {**PE250X400, "clearance": 1e-3 * self.clearance}
        return {name: float(described[name]) for name in ("clearance", "friction", "load")}

    def design(self) -> Design:
        """Nine free parameters; the eccentricity follows from the paper's stroke."""
        bounds = {
            **COUNTERWEIGHT,
            "jaw.mass_centre_distance": (0.27, 0.33),
            "jaw.mass_centre_angle": (float(np.radians(5)), float(np.radians(25))),
        }
        for name in LINKS:
            value = PARAMETERS[name].default
            bounds[name] = (value * (1 - self.links / 100), value * (1 + self.links / 100))
        fixed = {"speed": self.speed, "start": "contact", **self.conditions()}
        return Design(bounds, fixed, (CounterweightMoment(), EqualStroke.of({})))
