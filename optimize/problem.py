"""The problem that the options of the search describe: what is free, and what is compared."""

from dataclasses import asdict
from typing import Any

from jaxcrusher.basics.checks import require, require_choice, require_within
from jaxcrusher.commands.crushers import scene_of
from jaxcrusher.crusher.capacity import AFFLUENCE
from jaxcrusher.crusher.scene import require_clearance
from jaxcrusher.scenes.build import build_chamber
from jaxcrusher.scenes.echo import units_of, units_of_file
from jaxcrusher.scenes.parameters import CHOICES, NUMBERS, PE250X400, in_words, readable
from jaxcrusher.scenes.plausibility import require_possible
from jaxcrusher.scenes.scene_file import read_range, read_scene_file, read_text
from optimize.answer import Box
from optimize.design import Design
from optimize.evaluate import Case
from optimize.landscape import GRID_DIMENSIONS
from optimize.objectives import OBJECTIVES
from optimize.options import Options

# The paper's choice, Section 5.3.
SEED_SPEED, SEED_CLEARANCE = 39.0, 0.03e-3
# The paper's greatest capacity, to which its floor refers, is that at 25 rad/s.
GREATEST_AT = 25.0
# Options that do not decide the answer, or do by what they are read as.
KEPT_APART = ("name", "out", "scene", "speed", "clearance", "design")


def check(options: Options) -> None:
    """Raise ValueError for a value outside its limits, before anything is compiled."""
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
    if options.load_law is not None:
        require_choice("load_law", options.load_law, CHOICES["load_law"])
    if options.capacity_floor is not None:
        require(
            options.capacity_floor >= 0, "capacity_floor", "be >= 0 m3/h", options.capacity_floor
        )
    require_choice("objective", options.objective, tuple(OBJECTIVES))
    _require_used(options)
    described, free = description(options), bounds(options)
    scene = scene_of({**described, **{name: low for name, (low, _) in free.items()}}, options.scene)
    if "clearance" in free:
        bore = described.get("bore_radius", PE250X400["bore_radius"])
        require_clearance(free["clearance"][1], bore)
    sought = case(options)
    if not sought.links_free:
        reached = float(sought.chamber.capacity(sought.slowest))
        require(
            reached >= sought.capacity_floor * (1 - 1e-12),
            "capacity_floor",
            f"be reached in the box, whose lowest speed gives {reached:.4g} m3/h",
            sought.capacity_floor,
        )
    require_possible(described, free)
    if "sliding_power" in sought.objective.outputs:
        rubs = scene.joint is not None and scene.joint.friction is not None
        require(rubs, "objective", "be another without friction", options.objective)


def _require_used(options: Options) -> None:
    """ValueError for an option that another one makes idle."""
    names = [name for name, _, _ in options.design]
    require(len(set(names)) == len(names), "design", "name every parameter once", names)
    many = len(names) > GRID_DIMENSIONS
    grid = "not be given with more than two parameters, which --samples spreads"
    for name, idle, must in (
        ("speed", bool(names), "be a line --design speed LOW HIGH beside other ones"),
        ("clearance", bool(names), "be a line --design clearance LOW HIGH beside other ones"),
        ("cells", many, grid),
        ("grid", many, grid),
        ("samples", not many, "not be given with a grid; --cells and --grid are its points"),
        ("friction", "friction" in names, "not be given where --design frees it"),
        ("impact_velocity", "impact_velocity" in names, "not be given where --design frees it"),
        ("slip", options.friction == 0, "not be given without friction"),
    ):
        value = getattr(options, name)
        given = value != getattr(Options, name)
        require(not (idle and given), name, must, value)


def bounds(options: Options) -> dict[str, tuple[float, float]]:
    """The free parameters with their bounds, in SI units.

    Raises ValueError for unknown names, for values without a unit, and for no LOW < HIGH.
    """
    found = {}
    for name, low, high in _free(options):
        found[name] = read_range(name, low, high)
        good = found[name][0] < found[name][1]
        require(good, name, "have LOW < HIGH", f"{low} {high}")
    return found


def _free(options: Options) -> tuple[tuple[str, str, str], ...]:
    """As they are written."""
    paper = (("speed", *options.speed), ("clearance", *options.clearance))
    return options.design or paper


def description(options: Options) -> dict[str, Any]:
    """The crusher's other numbers and choices: the scene file's, then the options'."""
    values: dict[str, Any] = {} if options.scene is None else dict(read_scene_file(options.scene))
    for name, value in (
        ("slip", options.slip),
        ("friction", options.friction),
        ("load_law", options.load_law),
    ):
        if value is not None:
            values[name] = value
    if options.impact_velocity == "tracked":
        values["impact_law"] = "tracked"
    elif options.impact_velocity is not None:
        velocity = read_text("impact_velocity", options.impact_velocity)
        values |= {"impact_law": "constant", "impact_velocity": velocity}
    require(values.get("joint") != "ideal", "scene", "have a joint with clearance", "ideal")
    # The search tries both starts itself.
    values.pop("start", None)
    return values


def settings(options: Options) -> dict[str, Any]:
    """Everything that decides the answer."""
    kept = {name: value for name, value in asdict(options).items() if name not in KEPT_APART}
    return {"command": "search", **kept, "bounds": bounds(options), "scene": description(options)}


def case(options: Options) -> Case:
    """What is searched and what for."""
    free, described = bounds(options), description(options)
    fixed = {name: v for name, v in described.items() if name not in free}
    return Case(
        Design(free, fixed),
        OBJECTIVES[options.objective],
        build_chamber(described),
        floor(options),
        options.inside_model,
    )


def reference(options: Options) -> dict[str, float]:
    """Return the free parameters of the design to compare with: the paper's, or the scene file's.

    A joint that is ideal there is loose in every design of the box, and has the default clearance.
    """
    base = _compared(options)
    return {name: float(base.get(name, NUMBERS[name].default)) for name in bounds(options)}


def reference_title(options: Options) -> str:
    """Return the name of `reference`, with the numbers that its machine lacks."""
    title = "paper's choice" if options.scene is None else "scene file"
    base = _compared(options)
    assumed = [
        f"{in_words(name)} {readable(name, NUMBERS[name].default)}"
        for name in bounds(options)
        if name not in base
    ]
    return f"{title} with {' and '.join(assumed)}" if assumed else title


def _compared(options: Options) -> dict[str, Any]:
    """Return the machine of `reference`, with its own speed and clearance."""
    chosen = {"speed": SEED_SPEED, "clearance": SEED_CLEARANCE} if options.scene is None else {}
    return {**PE250X400, **description(options), **chosen}


def floor(options: Options) -> float:
    """The least capacity, m3/h: the greatest over the factor of affluence.

    The greatest is that at the lowest speed of the box; the paper's, at 25 rad/s.
    """
    if options.capacity_floor is not None:
        return options.capacity_floor
    fixed, free = description(options), bounds(options)
    slowest = GREATEST_AT
    if options.scene is not None:
        slowest = free["speed"][0] if "speed" in free else fixed.get("speed", PE250X400["speed"])
    return float(build_chamber(fixed).capacity(slowest)) / AFFLUENCE


def box(case: Case, options: Options) -> Box:
    """The box searched, and the range of speeds that the capacity equations give."""
    chamber, floor = case.chamber, case.capacity_floor
    speeds = float(chamber.lowest_speed()), float(chamber.highest_speed(floor))
    units = units_of_file(options.scene) | units_of(
        (name, high) for name, _, high in _free(options)
    )
    return Box(dict(case.design.bounds), floor, speeds, units)
