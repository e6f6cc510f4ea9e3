"""From the options of a search to its problem. This module reports all wrong options."""

import math
from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

from jaxcrusher.basics.checks import require, require_choice, require_within
from jaxcrusher.crusher.capacity import AFFLUENCE, CrushingChamber
from jaxcrusher.files.journal import digest_of
from jaxcrusher.mechanism.scene import Scene, require_clearance
from jaxcrusher.scenes.build import Crusher, build_chamber, build_scene
from jaxcrusher.scenes.machine import Machine, tell_about
from jaxcrusher.scenes.own_laws import with_digests
from jaxcrusher.scenes.parameters import PE250X400, in_words, key_of, readable
from jaxcrusher.scenes.reader import (
    kind_of,
    naming,
    read_bulk_density,
    read_entries,
    read_machine,
    read_scene_file,
    read_text,
)
from jaxcrusher.scenes.units import units_of
from optimize.ask.design import GRID_DIMENSIONS, CounterweightMoment, Design, EqualStroke
from optimize.ask.limits import read_limits
from optimize.ask.objectives import OBJECTIVES, OF_SUPPORTS, own_objective, plain
from optimize.ask.options import Effort, Options
from optimize.ask.problem import DesignProblem
from optimize.ask.sets import SETS, SETS_OF, Bounds, ranges, sets, written_bounds

# The paper's choice, Section 5.3.
SEED_SPEED, SEED_CLEARANCE = 39.0, 0.03e-3
# Options that do not decide the answer, or whose resolved values stand in the settings instead.
KEPT_APART = (
    "seconds",
    "scheduler",
    "name",
    "out",
    "scene",
    "overrides",
    "speed",
    "clearance",
    "design",
    "limit",
    "bulk_density",
)
# Options of a crusher alone: numbers and laws of a linkage are given by --set and --design.
_OF_A_CRUSHER = (
    "speed",
    "clearance",
    "capacity_floor",
    "bulk_density",
    "slip",
    "friction",
    "load_law",
    "impact_velocity",
)
# Parameters of sliding steel, which a roller bearing does not use, and the laws without a `load`.
OF_SLIDING = ("friction", "slip", "restitution", "young", "poisson", "impact_velocity")
WITHOUT_LOAD = ("none", "by_angle", "chamber")


def resolve(options: Options) -> DesignProblem:
    """Return the problem that the options describe.

    Raises ValueError for a value outside its limits, before anything is compiled.
    """
    _check_numbers(options)
    _require_used(options)
    _require_not_set(options)
    problem = _linkage(options) if kind_of(options.scene) == "linkage" else _crusher(options)
    problem = replace(
        problem,
        inside_model=options.inside_model,
        bulk_density=read_bulk_density(options.bulk_density),
        effort=Effort(**{one.name: getattr(options, one.name) for one in fields(Effort)}),
    )
    machine, chamber, free = problem.design.machine, problem.chamber, dict(problem.design.bounds)
    if chamber is not None and not problem.links_free:
        reached = float(chamber.capacity(problem.slowest))
        require(
            bool(problem.reaches(reached)),
            "capacity_floor",
            f"be reached in the box, whose lowest speed gives {reached:.4g} m3/h",
            problem.capacity_floor,
        )
    machine.require_possible(
        {name: ends for name, ends in free.items() if name not in CounterweightMoment.inputs}
    )
    texts = (*options.overrides, *((name, high) for name, _, high in ranges(options)))
    entries = () if options.scene is None else read_entries(options.scene)
    kept = {key: value for key, value in asdict(options).items() if key not in KEPT_APART}
    name, kept_stroke = problem.objective.name, problem.design.kept_stroke
    kept["objective"] = f"{name} {digest_of(problem.objective.formula)}" if ":" in name else name
    kept |= {} if kept_stroke is None else {"stroke": kept_stroke.target}
    settings = {
        "command": "search",
        **kept,
        "bounds": free,
        "limits": {limit.statistic: limit.most for limit in problem.limits},
        "scene": with_digests(machine.given),
        **machine.structure.record,
    }
    return replace(problem, units=machine.units | units_of((*entries, *texts)), settings=settings)


def tell(problem: DesignProblem, path: Path | None) -> None:
    """Print on standard error unusual numbers of the machine, and numbers that its file omits."""
    machine, free = problem.design.machine, dict(problem.reference)
    for name in CounterweightMoment.inputs:
        free.pop(name, None)
    tell_about(replace(machine, given={**machine.given, **free}), path)


def _asked(
    options: Options, usual: str, design: Design, chamber: CrushingChamber | None, scene: Scene
) -> DesignProblem:
    """Return the problem of a box of designs, with objective and limits; `scene` is of one design.

    The objective is one of a crusher, a statistic, or one of your own. `usual` is the default.
    Raises ValueError for an unknown objective, or one that the machine does not have.
    """
    name = options.objective or usual
    limits = read_limits(options.limit, scene)
    if ":" in name:
        return DesignProblem(design, own_objective(name), chamber, limits=limits)
    known = {} if chamber is None else OBJECTIVES
    stands = scene.supports is not None or name not in OF_SUPPORTS
    require(stands, "objective", "be another without foundation.mass", name)
    if name not in scene.statistics:
        require_choice("objective", name, tuple(known or scene.statistics))
    found = known[name] if name in known else plain(name, scene.statistics)
    if chamber is not None and "sliding_power" in found.outputs:
        main = scene.joints["main"]
        rubs = main is not None and main.friction is not None
        rubs |= "friction" in design.bounds  # which may begin at zero
        require(rubs, "objective", "be another without friction", name)
    return DesignProblem(design, replace(found, name=name), chamber, limits=limits)


def _crusher(options: Options) -> DesignProblem:
    """Return the problem of a crusher, with its box and the floor of its capacity."""
    described = _description(options)
    machine = Machine(Crusher(), described)
    free, written = _bounds(options, machine), written_bounds(options, machine)
    _require_felt(options, described, {*written})
    # With a set, every design has the stroke of the described machine.
    kept_stroke = EqualStroke.of(described) if sets(options) else None
    design = Design(free, machine, kept_stroke)
    reference, compared_with = _reference(options, described, free)
    # The bounds of sets lie around the machine's numbers; other ranges may lie anywhere.
    lowest = reference | {name: low for name, (low, _) in written.items()}
    corner = described | design.completed(lowest)
    with naming(options.scene, corner):
        scene = build_scene(corner)
    if "clearance" in free:
        bore = described.get("bore_radius", PE250X400["bore_radius"])
        require_clearance(free["clearance"][1], bore)
    chamber, floor = build_chamber(described), options.capacity_floor
    if floor is None:
        # The greatest capacity (m3/h), at the lowest speed of the box (25 rad/s in the paper), over
        # the factor of affluence.
        slowest = free.get("speed", (described.get("speed", PE250X400["speed"]),))[0]
        floor = float(chamber.capacity(slowest)) / AFFLUENCE
    return replace(
        _asked(options, "rms", design, chamber, scene),
        capacity_floor=floor,
        reference=reference,
        compared_with=compared_with,
    )


def _linkage(options: Options) -> DesignProblem:
    """Return the problem of a scene file's linkage, whose `--design` options name free numbers.

    The optimum is compared with the file's own numbers. Raises ValueError for options of a crusher,
    without `--design`, for a number that the file does not have, and for ideal joints.
    """
    for name in _OF_A_CRUSHER:
        value = getattr(options, name)
        must = "not be given with a linkage, whose numbers --set and --design name"
        require(value == getattr(Options, name), name, must, value)
    must = "free a number of a linkage, as in --design joints.B.clearance 0.05mm 0.5mm"
    require(len(options.design) > 0, "design", must, "missing")
    found = read_machine(options.scene, options.overrides)
    # The search tries both starts itself.
    found = replace(found, given={n: v for n, v in found.given.items() if n != "start"})
    values, scene, free = found.values, found.scene(), _bounds(options, found)
    for name, (_, high) in free.items():
        require(name in found.numbers, "design", "name numbers that the scene file gives", name)
        found.replace(**{name: high})  # raises ValueError if the number needs another one
        joint, _, key = name.rpartition(".")
        if key == "clearance":
            bore = values.get(f"{joint}.bore_radius", math.inf)  # a guide has no bore
            require_clearance(high, bore, f"{joint}.")
    require(not scene.is_ideal, "scene", "have a joint with clearance", "ideal joints")
    design = Design(free, found)
    reference = {name: float(values.get(name, 0.0)) for name in free}
    asked = _asked(options, "shaking_rms", design, None, scene)
    return replace(asked, reference=reference, compared_with="scene file's choice")


def _check_numbers(options: Options) -> None:
    for name, value, least in (
        ("cells", min(options.cells), 3),
        ("grid", min(options.grid), 2),
        ("samples", options.samples, 2),
        ("settle", options.settle, 0),
        ("turns", options.turns, 2),
        ("steps", options.steps, 1),
        ("starts", options.starts, 2),
        ("refine", options.refine, 1),
        ("runs", options.runs, 2),
        ("seed", options.seed, 0),
    ):
        require(value >= least, name, f"be >= {least}", value)
    balanced = options.samples & (options.samples - 1) == 0
    require(balanced, "samples", "be a power of two, as Sobol's sequence asks", options.samples)
    if options.within is not None:
        require(options.within > 0, "within", "be > 0", options.within)
    if options.seconds is not None:
        finite = 0 < options.seconds < math.inf
        require(finite, "seconds", "be finite and > 0", options.seconds)
    if options.friction is not None:
        require_within("friction", options.friction, 0, 10)
    if options.capacity_floor is not None:
        finite = 0 <= options.capacity_floor < math.inf
        require(finite, "capacity_floor", "be finite and >= 0 m3/h", options.capacity_floor)


def _require_used(options: Options) -> None:
    """Raise ValueError for an option that another one makes unused, or an unknown `--design`."""
    names = [key_of(name) for name, _, _ in ranges(options)]
    require(len(set(names)) == len(names), "design", "name every parameter once", names)
    words = sets(options)
    for word in words:
        require_choice("design", word, SETS)
    many = bool(words) or len(names) > GRID_DIMENSIONS
    line = "be a line --design {} LOW HIGH beside other ones"
    grid = "not be given with more than two parameters, which --samples spreads"
    for name, idle, must in (
        ("speed", bool(options.design), line.format("speed")),
        ("clearance", bool(options.design), line.format("clearance")),
        ("cells", many, grid),
        ("grid", many, grid),
        ("within", many, "not be given with more than two parameters, of which nothing is bounded"),
        ("samples", not many, "not be given with a grid; --cells and --grid are its points"),
        ("friction", "friction" in names, "not be given where --design frees it"),
        ("impact_velocity", "impact_velocity" in names, "not be given where --design frees it"),
        ("slip", options.friction == 0, "not be given without friction"),
    ):
        value = getattr(options, name)
        given = value != getattr(Options, name)
        require(not (idle and given), name, must, value)


def _require_felt(options: Options, described: dict[str, Any], free: set[str]) -> None:
    """Raise ValueError for an option, or a single number of `--design`, that no law uses."""
    idle = _idle(described)
    if described.get("friction") == 0 and "friction" not in free:
        idle["slip"] = "friction=0"
    for name, why in idle.items():
        # The option impact_velocity itself chooses this law.
        option = None if why == "impact_law=tracked" else getattr(options, name, None)
        given = name in free or option is not None
        require(not given, name, f"not be given with `{why}`, which does not use it", "given")


def _idle(described: Mapping[str, Any]) -> dict[str, str]:
    """Return the numbers that no law of a description uses, each with the choice as its reason."""
    names = "contact_law", "load_law", "impact_law"
    law, idle = {name: described.get(name, PE250X400[name]) for name in names}, {}
    if law["impact_law"] == "tracked":
        idle["impact_velocity"] = "impact_law=tracked"
    if law["contact_law"] == "rollers":
        idle |= dict.fromkeys(OF_SLIDING, "contact_law=rollers")
    if law["load_law"] in WITHOUT_LOAD:
        idle["load"] = f"load_law={law['load_law']}"
    return idle


def _require_not_set(options: Options) -> None:
    """Raise ValueError for `--set` of a number that is free, or that another option gives.

    `--set` may give the numbers of a set, whose bounds lie around these values.
    """
    taken = {key_of(name) for name, _, _ in ranges(options)}
    given = ("slip", "friction", "load_law", "impact_velocity")
    taken |= {name for name in given if getattr(options, name) is not None}
    taken |= {"impact_law"} if options.impact_velocity is not None else set()
    for name, _ in options.overrides:
        repeated = key_of(name) in taken
        require(not repeated, "set", "not repeat what another option gives", name)
        must = "give the counterweight by mass and angle: its moment can only be free"
        require(key_of(name) not in CounterweightMoment.inputs, "set", must, name)


def _bounds(options: Options, machine: Machine) -> Bounds:
    """Return the free parameters with their bounds; single bounds replace those of sets.

    Parameters of a set that no law uses are left out.
    """
    found, idle = Bounds(), _idle(machine.given)
    for word in sets(options):
        found |= SETS_OF[type(machine.structure)](word, machine)
    left = {name: one for name, one in found.items() if name not in idle}
    return left | written_bounds(options, machine)


def _description(options: Options) -> dict[str, Any]:
    """Return the crusher's given numbers and choices; options replace the scene file's values."""
    choices = (("slip", options.slip), ("load_law", options.load_law))
    given = [(name, choice) for name, choice in choices if choice is not None]
    values: dict[str, Any] = read_scene_file(options.scene, (*options.overrides, *given))
    if options.friction is not None:
        values["friction"] = options.friction
    if options.impact_velocity == "tracked":
        values["impact_law"] = "tracked"
    elif options.impact_velocity is not None:
        velocity = read_text("impact_velocity", options.impact_velocity)
        values |= {"impact_law": "constant", "impact_velocity": velocity}
    require(values.get("joint") != "ideal", "scene", "have a joint with clearance", "ideal")
    rough = "load_scatter" in {*values, *(name for name, _, _ in ranges(options))}
    expected = options.objective == "expected_rms"
    must = "come with the objective expected_rms, as motions of others repeat"
    given = f"given with {options.objective or 'rms'}"
    require(expected or not rough, "load_scatter", must, given)
    require(rough or not expected, "objective", "be another without load_scatter", "expected_rms")
    # The search tries both starts itself.
    values.pop("start", None)
    return values


def _reference(
    options: Options, described: dict[str, Any], free: Bounds
) -> tuple[dict[str, float], str]:
    """Return the design to compare with, and its name.

    The design is the paper's choice, or the scene file's. A joint that is ideal there is loose in
    every design of the box, and has the default clearance. The name states a default, and a fixed
    speed or clearance that differs from the paper's choice.
    """
    base, title = {**PE250X400, **described}, "scene file's choice"
    base |= CounterweightMoment().of(base)
    known = Crusher().numbers(described)
    assumed = {name: known[name].default for name in free if name not in base}
    others = {}
    if options.scene is None:
        choice = {"speed": SEED_SPEED, "clearance": SEED_CLEARANCE}
        kept = {name: base[name] for name in choice if name not in free}
        others = {name: value for name, value in kept.items() if value != choice[name]}
        base, title = base | choice, "paper's choice"
    values = {name: float((base | assumed)[name]) for name in free}
    told = [
        f"{in_words(name)} {readable(name, value, known)}"
        for name, value in (others | assumed).items()
    ]
    return values, f"{title} with {' and '.join(told)}" if told else title
