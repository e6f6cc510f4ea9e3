"""The periodic orbits of designs: the objective on them, its exact slopes, and multipliers."""

import functools
from collections.abc import Callable

import equinox as eqx
import numpy as np
import xarray as xr
from jaxtyping import Array, Float, PyTree, Scalar

import jaxcrusher as jc
from jaxcrusher.dynamics.many_orbits import MOTION, Sought, beside, solve_orbits
from jaxcrusher.files.table import COLUMNS, Column, columns_of
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.orbits.forced import refusal, unknowns
from jaxcrusher.orbits.result import WAYS, PeriodicOrbit
from optimize.answer import Coexisting, Orbit
from optimize.ask import constraints
from optimize.ask.design import GRID_DIMENSIONS
from optimize.ask.problem import DesignProblem
from optimize.search import descents
from optimize.search import motions as drawn
from optimize.search.evaluate import NOWHERE, Rows, Tracking, started
from optimize.search.landscape import labelled, spread

# Numbers of designs by name: values (*batch) and slopes (*batch, n).
Numbers = dict[str, tuple[np.ndarray, np.ndarray]]
# Numbers of an orbit in a map and in result.json besides its statistics.
KEPT = ("error", "largest_multiplier", "settling_turns", "least_penetration")
VERDICTS = ("success", "stable", "undecided", "inside_model")
# Number of designs solved between two reports of progress. Descents run the same program.
CHUNK = 32
# Slopes are compared with differences over twice this share of the box. In shorter differences
# rounding (1e-10 of the value) grows more than truncation falls.
BESIDE = 1e-3
# Number of random starts in the search for coexisting motions, and the turns of each.
ENSEMBLE, ENSEMBLE_TURNS = 16, 480
# Objectives that differ by a smaller share belong to two solutions of one motion.
SAME = 1e-6


def unsolvable(problem: DesignProblem) -> str:
    """Return why orbits of the problem's scenes cannot be solved for, or an empty text."""
    return refusal(problem.scene)


def solve(
    problem: DesignProblem,
    places: Float[np.ndarray, "points n"],
    neighbours: Callable[[int], list[int]] | None = None,
    *,
    effort: str | None = None,
    tracking: Tracking = NOWHERE,
) -> Rows:
    """Solve for the orbits of places of the unit box.

    Returns the rows of `jaxcrusher.dynamics.many_orbits.solve_orbits` and more. Without an `effort`
    each orbit is only tried from the pin at rest in its bore. `objective` and `counts` (see
    `constraints.of_orbits`) have the shape (points,), and `slope`, the slope of the objective per
    unit of each free parameter, (points, n). `numbers`, (points, numbers), are those of
    `DesignProblem.numbers`; their `slopes` by the axes of the unit box are (points, numbers, n).
    """
    rows = solve_orbits(
        _sought(problem),
        (places, {}),
        effort=effort,
        neighbours=neighbours,
        chunk=CHUNK,
        **vars(tracking),
    )
    known = dict(zip(problem.numbers, rows["numbers"].T, strict=True))
    rows["objective"] = known["objective"]
    rows["slope"] = rows["slopes"][:, 0] / widths(problem)
    rows["counts"] = constraints.of_orbits(
        problem, rows, known.get("capacity", np.zeros(len(places)))
    )
    return rows


def values_and_slopes(problem: DesignProblem, places: Float[np.ndarray, "*batch n"]) -> Numbers:
    """Return the `DesignProblem.numbers` at points of the unit box, with slopes by the box's axes.

    Values, (*batch), are NaN where `constraints.usable` rejects the orbit. Slopes are (*batch, n).
    """
    rows = solve(problem, np.reshape(places, (-1, np.shape(places)[-1])))
    values = np.where(constraints.usable(problem, rows)[:, None], rows["numbers"], np.nan)
    return {
        name: (values[:, i].reshape(places.shape[:-1]), rows["slopes"][:, i].reshape(places.shape))
        for i, name in enumerate(problem.numbers)
    }


def numbers(problem: DesignProblem) -> dict[str, descents.Smooth]:
    """Return the `DesignProblem.numbers` as functions, which share one solution for each point."""
    seen: dict[tuple[tuple[int, ...], bytes], Numbers] = {}

    def number(points: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
        key = points.shape, np.ascontiguousarray(points).tobytes()
        if key not in seen:
            seen[key] = values_and_slopes(problem, points)
        return seen[key][name]

    return {name: functools.partial(number, name=name) for name in problem.numbers}


def spares(
    problem: DesignProblem, numbers: dict[str, descents.Smooth]
) -> tuple[descents.Smooth, ...]:
    """Return the margin to each constraint as a share of its limit; below 0 it is broken.

    The floor of the capacity is included only if it is not a bound of the speed.
    """
    found = [
        descents.above(descents.negative(numbers[one.statistic]), -one.most)
        for one in problem.limits
    ]
    if problem.floor_bends:
        found.append(descents.above(numbers["capacity"], problem.capacity_floor))
    return tuple(found)


# To build a scene takes as long as to solve for an orbit, and descents ask for single points.
@functools.lru_cache(maxsize=8)
def _sought(problem: DesignProblem) -> Sought:
    numbers = tuple(eqx.Partial(_number, problem=problem, name=name) for name in problem.numbers)
    return Sought(eqx.Partial(_scene, problem=problem), numbers, None, unknowns(problem.scene))


def _scene(unit: Array, _: PyTree, problem: DesignProblem) -> Scene:
    return problem.design.scene(unit)


def _number(
    orbit: PeriodicOrbit, scene: Scene, unit: Array, _: PyTree, problem: DesignProblem, name: str
) -> Scalar:
    return problem.numbers[name](orbit, scene, problem.chamber_at(unit))


def solve_map(
    problem: DesignProblem,
    places: Float[np.ndarray, "points n"],
    cells: tuple[int, int],
    keeps_contact: Callable[[], bool] = lambda: True,
    tracking: Tracking = NOWHERE,
) -> xr.Dataset | None:
    """Return the map of the periodic orbits at the points of a grid or of a sequence.

    Each orbit is tried from the pin at rest. If no such orbit counts, the usual effort follows at
    all points. Nodes resolve no impacts: there is no map if no design keeps contact, and a sample
    of `CHUNK` points has no orbit. Several loose joints skip this costly sample.
    """
    if unknowns(problem.scene) > 2 and not keeps_contact():
        return None
    some = solve(problem, spread(places, CHUNK))
    if not some["success"].any() and not keeps_contact():
        return None
    rows, motions = solve(problem, places, tracking=tracking), ()
    if not rows["counts"].any():
        count = len(problem.design.names)
        # The points of a sequence lie too far apart to start from each other's orbits.
        near = beside(cells[:count], (True,) * count) if count <= GRID_DIMENSIONS else None
        rows, motions = solve(problem, places, near, effort="usual", tracking=tracking), MOTION
    rows |= drawn.turns(problem, places, rows)
    of = problem.objective
    columns = columns_of(problem.scene.statistics, problem.statistics) | drawn.COLUMNS
    columns |= {name: COLUMNS[name] for name in (*KEPT, *VERDICTS, "failure", "found", *motions)}
    columns["objective"] = Column(of.unit, of.meaning)
    columns["ideal_objective"] = drawn.COLUMNS["ideal_objective"]._replace(unit=of.unit)
    meaning = f"slope of the {of.meaning}, per unit of the parameter"
    columns["slope"] = Column(of.unit, meaning, dims=("parameter",))
    meaning = "may be chosen: a motion inside the constraints that is not known to be unstable"
    columns["counts"] = Column("1", meaning, bool)
    return labelled(problem.design, places, cells, rows, columns)


def widths(problem: DesignProblem) -> Float[np.ndarray, " n"]:
    """Return the width of the box in the unit of each parameter."""
    return np.array([high - low for low, high in problem.design.bounds.values()])


def orbit_of(problem: DesignProblem, unit: Float[np.ndarray, " n"]) -> Orbit | None:
    """Return the thorough solution for the orbit of one point, with its objective and slopes.

    Slopes are compared with central differences. They are NaN if their orbit is another motion than
    this solution. Returns None for a scene that `unsolvable` rejects.
    """
    if unsolvable(problem):
        return None
    described = problem.design.completed(problem.design.numbers(unit))
    scene = problem.design.build(described)
    solution = jc.periodic_orbit(scene, effort="thorough")
    offsets = BESIDE * np.eye(len(unit))
    places = np.concatenate([unit[None], unit + offsets, unit - offsets])
    effort = None if bool(solution.way == WAYS.rest) else "usual"
    rows = solve(problem, places, effort=effort)
    above, below = np.split(rows["objective"][1:], 2)
    slopes, names = rows["slope"][0], problem.design.names
    apart = np.abs((above - below) / (2 * BESIDE * widths(problem)) - slopes)
    value = float(problem.objective.formula(solution, scene, problem.chamber_of(described)))
    if not abs(rows["objective"][0] - value) <= SAME * abs(value):
        slopes, apart = np.full((2, len(unit)), np.nan)
    return Orbit(
        solution,
        value if bool(solution.success) else float("nan"),
        dict(zip(names, slopes.tolist(), strict=True)),
        dict(zip(names, apart.tolist(), strict=True)),
    )


def coexisting(problem: DesignProblem, values: dict[str, float]) -> tuple[Coexisting, ...]:
    """Return the stable orbits to which random starts around the centred start converge."""
    described = problem.design.completed(values)
    scene, chamber = problem.design.build(described), problem.chamber_of(described)
    centred = started(problem.design, values, "centred")
    found = jc.coexisting_orbits(centred, starts=ENSEMBLE, turns=ENSEMBLE_TURNS)
    return tuple(
        Coexisting(share, orbit, float(problem.objective.formula(orbit, scene, chamber)))
        for orbit, share in zip(found.orbits, found.shares, strict=True)
        if share > 0
    )


def error(problem: DesignProblem, solution: PeriodicOrbit, objective: float) -> float:
    """Return the estimated error of an objective, at least the error of its largest part."""
    outputs, unit = problem.objective.outputs, problem.objective.unit
    parts = [solution[name] for name in outputs if problem.scene.statistics[name].unit == unit]
    return float(solution.error) * max(map(abs, (objective, *map(float, parts))))


def worse(one: float, other: float) -> bool:
    """Tell whether an objective exceeds another by more than the error between two solutions."""
    return one - other > SAME * abs(other)
