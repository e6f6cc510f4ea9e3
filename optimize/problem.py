"""The problem that the options of the search describe: what is free, and what is compared."""

import math
from typing import Any

from jaxcrusher.basics.checks import require, require_choice, require_within
from jaxcrusher.crusher.capacity import AFFLUENCE, CrushingChamber
from jaxcrusher.scenes.build import build_scene
from jaxcrusher.scenes.parameters import CHOICES, PE250X400
from jaxcrusher.scenes.scene_file import read_scene_file, read_text, require_parameter
from optimize.answer import Box
from optimize.design import Design
from optimize.evaluate import Case
from optimize.objectives import OBJECTIVES
from optimize.options import Options

# The paper's choice, Section 5.3.
SEED_SPEED, SEED_CLEARANCE = 39.0, 0.03e-3
# The paper's greatest capacity, to which its floor refers, is that at 25 rad/s.
GREATEST_AT = 25.0


def check(options: Options) -> None:
    """Raise ValueError for a value outside its limits, before anything is compiled."""
    for name, (low, high), unit in (
        ("speed", options.speed, "rad/s"),
        ("clearance", options.clearance, "mm"),
    ):
        good = math.isfinite(low) and math.isfinite(high) and 0 < low < high
        require(good, name, f"be a box 0 < LOW < HIGH {unit}", (low, high))
    largest = options.clearance[1]
    bore = 1e3 * float(PE250X400["bore_radius"])
    require(largest < bore, "clearance", f"be < {bore:g} mm", largest)
    for name, value, least in (
        ("cells", min(options.cells), 3),
        ("grid", min(options.grid), 2),
        ("samples", options.samples, 2),
        ("settle", options.settle, 0),
        ("turns", options.turns, 2),
        ("steps", options.steps, 1),
        ("refine", options.refine, 1),
        ("runs", options.runs, 2),
        ("seed", options.seed, 0),
    ):
        require(value >= least, name, f"be >= {least}", value)
    if options.friction is not None:
        require_within("friction", options.friction, 0, 10)
    if options.slip is not None:
        require_choice("slip", options.slip, CHOICES["slip"])
    if options.load is not None:
        require_choice("load", options.load, CHOICES["load_law"])
    if isinstance(options.impact_velocity, float | int):
        good = math.isfinite(options.impact_velocity) and options.impact_velocity > 0
        require(good, "impact_velocity", "be > 0 m/s", options.impact_velocity)
    if options.capacity_floor is not None:
        require(
            options.capacity_floor >= 0, "capacity_floor", "be >= 0 m3/h", options.capacity_floor
        )
    require_choice("objective", options.objective, tuple(OBJECTIVES))
    names = [name for name, _, _ in options.design]
    for name in names:
        require_parameter(name)
    require(len(set(names)) == len(names), "design", "name every parameter once", names)
    sought = case(options)
    reached = float(CrushingChamber().capacity(sought.slowest))
    require(
        reached >= sought.capacity_floor * (1 - 1e-12),
        "capacity_floor",
        f"be reached in the box, whose lowest speed gives {reached:.4g} m3/h",
        sought.capacity_floor,
    )
    scene = build_scene(description(options))
    if "sliding_power" in sought.objective.outputs:
        rubs = scene.joint is not None and scene.joint.friction is not None
        require(rubs, "objective", "be another without friction", options.objective)


def bounds(options: Options) -> dict[str, tuple[float, float]]:
    """The free parameters with their bounds, in SI units."""
    if options.design:
        return {
            name: (float(read_text(name, low)), float(read_text(name, high)))
            for name, low, high in options.design
        }
    small, large = options.clearance
    return {"speed": options.speed, "clearance": (1e-3 * small, 1e-3 * large)}


def description(options: Options) -> dict[str, Any]:
    """The crusher's other numbers and choices: the scene file's, then the options'."""
    values: dict[str, Any] = {} if options.scene is None else dict(read_scene_file(options.scene))
    for name, value in (
        ("slip", options.slip),
        ("friction", options.friction),
        ("load_law", options.load),
    ):
        if value is not None:
            values[name] = value
    if options.impact_velocity == "tracked":
        values["impact_law"] = "tracked"
    elif options.impact_velocity is not None:
        values |= {"impact_law": "constant", "impact_velocity": options.impact_velocity}
    require(values.get("joint") != "ideal", "scene", "have a joint with clearance", "ideal")
    # The search tries both starts itself.
    values.pop("start", None)
    return values


def case(options: Options) -> Case:
    """What is searched and what for."""
    free = bounds(options)
    fixed = {name: v for name, v in description(options).items() if name not in free}
    return Case(
        Design(free, fixed),
        OBJECTIVES[options.objective],
        CrushingChamber(),
        floor(options),
        options.inside_model,
    )


def reference(options: Options) -> dict[str, float]:
    """The free parameters of the design to compare with: the paper's choice, or the scene file."""
    base = {**PE250X400, **description(options)}
    if options.scene is None:
        base |= {"speed": SEED_SPEED, "clearance": SEED_CLEARANCE}
    return {name: float(base[name]) for name in bounds(options)}


def reference_title(options: Options) -> str:
    """What `reference` is: the paper chose for its own machine."""
    return "paper's choice" if options.scene is None else "scene file"


def floor(options: Options) -> float:
    """The least capacity, m3/h."""
    if options.capacity_floor is not None:
        return options.capacity_floor
    return float(CrushingChamber().capacity(GREATEST_AT)) / AFFLUENCE


def box(case: Case) -> Box:
    """The box searched, and the range of speeds that the capacity equations give."""
    chamber, floor = case.chamber, case.capacity_floor
    speeds = float(chamber.lowest_speed()), float(chamber.highest_speed(floor))
    return Box(dict(case.design.bounds), floor, speeds)
