"""Options of the design study. This module imports no JAX."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from jaxcrusher.files.results import run_folder

# Beyond 5 % the toggle can come so flat that no eccentricity gives the stroke.
MOST_LINKS = 5.0
# Beyond 10 % the restitution passes 1.
MOST_MACHINE = 10.0


@dataclass(frozen=True)
class Options:
    """Options of the design study: its numbers and its effort."""

    name: str = "balance"
    """Name of the study: results go to OUT/NAME/."""
    out: Path = Path("results")
    """Folder of all results."""
    scene: Path | None = None
    """TOML scene file of the machine to begin with; what it leaves out is the PE250x400's."""
    overrides: Annotated[
        tuple[tuple[str, str], ...],
        tyro.conf.UseAppendAction,
        tyro.conf.arg(name="set", metavar="KEY VALUE"),
    ] = ()
    """A key of the scene file and its value with its unit, over the file's, as in
    --set speed "286 rpm". May be repeated."""
    links: float = MOST_LINKS
    """Lengths, bearing distance and inclination may change by this many percent, up to 5."""
    machine: float = 0.0
    """Masses, inertias, load and what the bearing is made of may change by this many percent, up to
    10: twelve further parameters. 0 leaves them as they are."""
    starts: int = 10
    """Random starts of every method."""
    budget: int = 1000
    """Work of a search, in values of the objective."""
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

    @property
    def folder(self) -> Path:
        """The folder of this study."""
        return run_folder(self.out, self.name)
