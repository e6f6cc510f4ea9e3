"""What the design search can be told, and the box it searches."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from jaxcrusher.basics.checks import require, require_choice, require_within
from jaxcrusher.crusher.capacity import AFFLUENCE, CrushingChamber
from jaxcrusher.files.results import results_folder
from jaxcrusher.scenes.parameters import CHOICES, PE250X400
from jaxcrusher.scenes.scene_file import read_scene_file, read_text, require_parameter
from optimize.design import Design
from optimize.evaluate import Case
from optimize.objectives import OBJECTIVES

# The paper's choice, Section 5.3.
SEED_SPEED, SEED_CLEARANCE = 39.0, 0.03e-3
# The paper's greatest capacity, to which its floor refers, is that at 25 rad/s.
GREATEST_AT = 25.0
NO_FLAG = tyro.conf.Suppress


@dataclass(frozen=True)
class Options:
    """Find the design of a jaw crusher that shakes its foundation least, inside a box: by default
    the driving speed and bearing clearance of a PE250x400, and the RMS of |R_O| + |R_C|.
    """  # noqa: D205

    name: str = "default"
    """Name of the run: results go to OUT/NAME/."""
    out: Path = Path("results")
    """Folder of all results."""
    objective: Literal[
        "rms", "peak", "smooth_peak", "mean", "excess", "joint_peak", "wear", "energy"
    ] = "rms"
    """What to make small: RMS, peak, smooth peak or mean of the foundation force, its excess over
    the ideal joint, the peak force in the bearing (all N), sliding work or drive energy per
    volume crushed (J/m3)."""
    speed: tuple[float, float] = (25.0, 40.0)
    """Lowest and highest driving speed, rad/s."""
    clearance: tuple[float, float] = (0.03, 0.12)
    """Smallest and largest radial clearance, mm."""
    design: Annotated[
        tuple[tuple[str, str, str], ...],
        tyro.conf.UseAppendAction,
        tyro.conf.arg(metavar="NAME LOW HIGH"),
    ] = ()
    """A free parameter with its bounds, instead of speed and clearance, as often as needed.
    Names as in a scene file, such as counterweight.mass; bounds are SI numbers or quantities,
    such as "0.1 mm"."""
    scene: Path | None = None
    """TOML scene file with the crusher's other numbers; the options below go before it."""
    capacity_floor: float | None = None
    """Least crushing capacity, m3/h; by default the paper's, 9.41 / 1.67."""
    inside_model: bool = False
    """Refuse designs whose motion leaves the contact model (wide contact, hard impacts)."""
    grid: tuple[int, int] = (16, 10)
    """Cells of the landscape along the first and the second parameter."""
    samples: int = 256
    """Points of the landscape of more than two parameters, a Sobol sequence."""
    settle: int = 40
    """Turns of the shaft before statistics start."""
    turns: int = 40
    """Turns of the shaft that statistics cover."""
    steps: int = 40
    """Gradient steps of each refinement."""
    refine: int = 3
    """Best cells to refine from; as many random points are refined too."""
    runs: int = 5
    """Independent long runs from each start that confirm a candidate."""
    slip: Literal["centre", "surface"] | None = None
    """Reading of the slip speed in the friction law."""
    friction: float | None = None
    """Friction coefficient; 0 leaves friction out."""
    load: Literal["along_jaw", "normal_to_jaw", "closing_stroke", "none"] | None = None
    """Direction of the crushing load on the jaw."""
    impact_velocity: float | Literal["tracked"] | None = None
    """Impact velocity of the contact law, m/s, or tracked."""
    seed: int = 0
    """Seed of the random refinement points and of the confirmation's starts."""
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
            ("grid", min(self.grid), 2),
            ("samples", self.samples, 2),
            ("settle", self.settle, 0),
            ("turns", self.turns, 2),
            ("steps", self.steps, 1),
            ("refine", self.refine, 1),
            ("runs", self.runs, 2),
            ("seed", self.seed, 0),
        ):
            require(value >= least, name, f"be >= {least}", value)
        if self.friction is not None:
            require_within("friction", self.friction, 0, 10)
        if self.slip is not None:
            require_choice("slip", self.slip, CHOICES["slip"])
        if self.load is not None:
            require_choice("load", self.load, CHOICES["load_law"])
        if isinstance(self.impact_velocity, float | int):
            good = math.isfinite(self.impact_velocity) and self.impact_velocity > 0
            require(good, "impact_velocity", "be > 0 m/s", self.impact_velocity)
        if self.capacity_floor is not None:
            require(self.capacity_floor >= 0, "capacity_floor", "be >= 0 m3/h", self.capacity_floor)
        require_choice("objective", self.objective, tuple(OBJECTIVES))
        names = [name for name, _, _ in self.design]
        for name in names:
            require_parameter(name)
        require(len(set(names)) == len(names), "design", "name every parameter once", names)
        self.case()

    def folder(self) -> Path:
        """Make the results' folder; ValueError if it cannot be written."""
        return results_folder(self.out, self.name)

    def bounds(self) -> dict[str, tuple[float, float]]:
        """The free parameters with their bounds, in SI units."""
        if self.design:
            return {
                name: (float(read_text(name, low)), float(read_text(name, high)))
                for name, low, high in self.design
            }
        small, large = self.clearance
        return {"speed": self.speed, "clearance": (1e-3 * small, 1e-3 * large)}

    def description(self) -> dict[str, Any]:
        """The crusher's other numbers and choices: the scene file's, then the options'."""
        values: dict[str, Any] = {} if self.scene is None else dict(read_scene_file(self.scene))
        for name, value in (
            ("slip", self.slip),
            ("friction", self.friction),
            ("load_law", self.load),
        ):
            if value is not None:
                values[name] = value
        if self.impact_velocity == "tracked":
            values["impact_law"] = "tracked"
        elif self.impact_velocity is not None:
            values |= {"impact_law": "constant", "impact_velocity": self.impact_velocity}
        require(values.get("joint") != "ideal", "scene", "have a joint with clearance", "ideal")
        # The search tries both starts itself.
        values.pop("start", None)
        return values

    def case(self) -> Case:
        """What is searched and what for."""
        bounds = self.bounds()
        fixed = {name: v for name, v in self.description().items() if name not in bounds}
        return Case(
            Design(bounds, fixed),
            OBJECTIVES[self.objective],
            self.chamber,
            self.floor(),
            self.inside_model,
        )

    def reference(self) -> dict[str, float]:
        """The free parameters of the design to compare with: the paper's choice."""
        base = {**PE250X400, **self.description()}
        if not self.design:
            base |= {"speed": SEED_SPEED, "clearance": SEED_CLEARANCE}
        return {name: float(base[name]) for name in self.bounds()}

    def floor(self) -> float:
        """The least capacity, m3/h."""
        if self.capacity_floor is not None:
            return self.capacity_floor
        return float(self.chamber.capacity(GREATEST_AT)) / AFFLUENCE

    def box(self) -> dict:
        """The box searched, and the range of speeds that the capacity equations give."""
        return {
            **{name: list(limits) for name, limits in self.bounds().items()},
            "capacity_floor": self.floor(),
            "derived_speed": [
                float(self.chamber.lowest_speed()),
                float(self.chamber.highest_speed(self.floor())),
            ],
        }
