"""What the design search can be told, and the box it searches."""

import math
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from jaxcrusher.capacity import AFFLUENCE, CrushingChamber
from jaxcrusher.checks import require, require_choice, require_within
from jaxcrusher.description import CHOICES, PE250X400

# The paper's choice, Section 5.3.
SEED_SPEED, SEED_CLEARANCE = 39.0, 0.03e-3
NO_FLAG = tyro.conf.Suppress


@dataclass(frozen=True)
class Options:
    """Find the driving speed and bearing clearance of a PE250x400 jaw crusher that shake its
    foundation least: the least RMS of |R_O| + |R_C| inside a box.
    """  # fmt: skip  # noqa: D205

    name: str = "default"
    """Name of the run: results go to OUT/NAME/."""
    out: Path = Path("results")
    """Folder of all results."""
    speed: tuple[float, float] = (25.0, 40.0)
    """Lowest and highest driving speed, rad/s."""
    clearance: tuple[float, float] = (0.03, 0.12)
    """Smallest and largest radial clearance, mm."""
    grid: tuple[int, int] = (16, 10)
    """Cells of the landscape: speeds and clearances."""
    settle: int = 40
    """Turns of the shaft before statistics start."""
    turns: int = 40
    """Turns of the shaft that statistics cover."""
    steps: int = 40
    """Gradient steps of each refinement."""
    refine: int = 3
    """Best cells to refine from; as many random points are refined too."""
    slip: Literal["centre", "surface"] = "centre"
    """Reading of the slip speed in the friction law."""
    friction: float = 0.1
    """Friction coefficient; 0 leaves friction out."""
    load: Literal["along_jaw", "normal_to_jaw", "closing_stroke", "none"] = "along_jaw"
    """Crushing load of 8.8 kN on the jaw."""
    impact_velocity: float | Literal["tracked"] = 0.5
    """Impact velocity of the contact law, m/s, or tracked."""
    seed: int = 0
    """Seed of the random refinement points."""
    chamber: Annotated[CrushingChamber, NO_FLAG] = field(default_factory=CrushingChamber)

    def check(self) -> None:
        """Raise ValueError for a value outside its limits, before anything is compiled."""
        for name, (low, high), unit in (
            ("speed", self.speed, "rad/s"),
            ("clearance", self.clearance, "mm"),
        ):
            good = math.isfinite(low) and math.isfinite(high) and 0 < low < high
            require(good, name, f"be a box 0 < LOW < HIGH {unit}", (low, high))
        largest = self.clearance[1]
        bore = 1e3 * float(PE250X400["bore_radius"])
        require(largest < bore, "clearance", f"be < {bore:g} mm", largest)
        for name, value, least in (
            ("grid", min(self.grid), 2), ("settle", self.settle, 0), ("turns", self.turns, 2),
            ("steps", self.steps, 1), ("refine", self.refine, 1), ("seed", self.seed, 0),
        ):  # fmt: skip
            require(value >= least, name, f"be >= {least}", value)
        require_within("friction", self.friction, 0, 10)
        require_choice("slip", self.slip, CHOICES["slip"])
        require_choice("load", self.load, CHOICES["load_law"])
        if not isinstance(self.impact_velocity, str):
            good = math.isfinite(self.impact_velocity) and self.impact_velocity > 0
            require(good, "impact_velocity", "be > 0 m/s", self.impact_velocity)

    def folder(self) -> Path:
        """Make the results' folder; ValueError if it cannot be written."""
        folder = self.out / self.name
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ValueError(
                f"Argument `out` must be a folder that can be written, but {folder} is not: "
                f"{error.strerror}."
            ) from None
        require(os.access(folder, os.W_OK), "out", "be a folder that can be written", folder)
        return folder

    def scene(self) -> dict:
        """The options of `jaxcrusher.paper_scene`, without the start."""
        return {
            "slip": self.slip,
            "friction": self.friction if self.friction > 0 else None,
            "load": None if self.load == "none" else self.load,
            "impact_velocity": self.impact_velocity,
        }

    def box(self) -> dict:
        """The box searched, and the one that the capacity equations give."""
        greatest = float(self.chamber.capacity(25.0))
        floor = greatest / AFFLUENCE
        return {
            "speed": list(self.speed),
            "clearance": [1e-3 * value for value in self.clearance],
            "capacity_floor": floor,
            "derived_speed": [
                float(self.chamber.lowest_speed()),
                float(self.chamber.highest_speed(floor)),
            ],
        }
