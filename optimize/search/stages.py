"""The stages of a search. Each takes the answer so far, and returns it with further fields."""

from concurrent.futures import Future
from dataclasses import asdict, replace
from importlib import import_module
from typing import Any

import numpy as np
import xarray as xr

from jaxcrusher.batch.engines import default_engine
from jaxcrusher.files.provenance import provenance
from jaxcrusher.files.results import write_netcdf
from jaxcrusher.mechanism.reductions import ALL_THE_TIME
from jaxcrusher.scenes.units import points_of
from jaxcrusher.sheets.load_sheet import Row, Site, sheet
from optimize.answer import Answer, Coexisting, Confirmed, Maps, Orbit, Refinement
from optimize.ask.constraints import losses
from optimize.ask.problem import DesignProblem
from optimize.search import descents, landscape, orbits
from optimize.search.active import active_constraints
from optimize.search.bound import MOST, Points, Refined, optimality_bound, refined, unbounded
from optimize.search.cells import Cells
from optimize.search.confirm import SHIFT, Repeats, confirmed, long_runs, long_window
from optimize.search.descents import Descent
from optimize.search.evaluate import Tracking, Window, evaluate, judged
from optimize.search.front import fronts
from optimize.search.work import Work

# Tolerance of the landscape, in clearances.
MAP_RTOL = 1e-6
# Harmonics of the shaft's speed in a load sheet.
ORDERS = 4
# Default of `Effort.within`, as a share of the optimum.
WITHIN = 3e-5


def map_box(answer: Answer, work: Work) -> Answer:
    """Map the whole box: its periodic orbits, and both starts on a coarser grid.

    The orbit of the design to compare with does not depend on these maps. It is solved for at the
    same time, with the programs that the confirmation uses again.
    """
    problem, effort = answer.problem, answer.problem.effort
    cells, points = (
        landscape.points(problem.design, grid, effort.samples, effort.seed)
        for grid in (effort.grid, effort.cells)
    )
    reference = problem.design.unit(problem.reference)
    # Collocation solves for orbits in contact. If no design keeps contact, few designs or none have
    # such an orbit.
    contact: Future[bool] = Future()

    def explore() -> xr.Dataset:
        try:
            found = _explore(problem, work, cells)
            contact.set_result(_keeps_contact(found))
        except BaseException as error:
            contact.set_exception(error)
            raise
        import_module("optimize.tell.figures")  # takes a second, during the map of orbits
        return found

    mapped, data, orbit = work.at_once(
        lambda: _map_orbits(problem, work, points, contact),
        explore,
        lambda: orbits.orbit_of(problem, reference) if contact.result() else None,
    )
    maps = Maps(cells, data, points, mapped, contact.result(), orbit)
    return replace(answer, maps=maps)


def _keeps_contact(data: xr.Dataset) -> bool:
    """Tell whether any design of the landscape keeps contact from a start."""
    shares = [column for name, column in data.items() if str(name).endswith("contact_fraction")]
    return not shares or bool((np.min(shares, axis=0) >= ALL_THE_TIME).any())


def _short(problem: DesignProblem) -> Window:
    """Return the turns and the tolerance of the landscape's runs."""
    return Window(problem.effort.settle, problem.effort.turns, MAP_RTOL)


def _map_orbits(
    problem: DesignProblem, work: Work, points: np.ndarray, contact: Future[bool]
) -> xr.Dataset | None:
    """Map the periodic orbits of places of the unit box; None if orbits cannot be solved for.

    This is so for some scenes, and for a box in which no design keeps contact, unless collocation
    finds an orbit all the same.
    """
    if orbits.unsolvable(problem):
        return None
    with work.stage("orbits", len(points)) as tracking:
        data = orbits.solve_map(problem, points, problem.effort.cells, contact.result, tracking)
    if data is None:
        return None
    data.attrs = _provenance("Periodic orbits of a design search", problem)
    write_netcdf(work.folder / "orbits.nc", data)
    return data


def _explore(problem: DesignProblem, work: Work, cells: np.ndarray) -> xr.Dataset:
    """Integrate places from both starts; write and return the landscape."""
    window, count = _short(problem), len(landscape.STARTS) * len(cells)
    with work.stage("landscape", count) as tracking:
        rows = evaluate(problem, cells, window, tracking)
    data = landscape.dataset(problem, cells, problem.effort.grid, rows)
    how = asdict(window) | {"engine": default_engine(count)}
    data.attrs = _provenance("Landscape of a design search", problem, **how)
    write_netcdf(work.folder / "landscape.nc", data)
    work.steps["landscape"] = int(data.steps.sum())
    return data


def _provenance(title: str, problem: DesignProblem, **settings: Any) -> dict[str, Any]:
    design = problem.design
    return provenance(
        title, scene=design.whole(design.fixed), bounds=dict(design.bounds), **settings
    )


def refine(answer: Answer, work: Work) -> Answer:
    """Descend from the best points of the map of orbits, and from random points.

    If no orbit counts, descents by fits start at the best cells of the landscape.
    """
    problem, effort, maps = answer.problem, answer.problem.effort, answer.maps
    assert maps is not None
    rng = np.random.default_rng(effort.seed)
    values = np.full(len(maps.points), np.nan)
    if maps.orbits is not None:
        begun = landscape.counting(maps.landscape, maps.cells, maps.points)
        counts = maps.orbits.counts.to_numpy().ravel() & begun
        values = np.where(counts, maps.orbits.objective.to_numpy().ravel(), np.nan)
    by, places, starts_at = "gradient", maps.points, effort.refine
    if not np.isfinite(values).any():
        by, places = "fits", maps.cells
        values = landscape.worst(maps.landscape).to_numpy().ravel()
    elif not problem.constrained:
        starts_at = effort.starts // 2
    best = landscape.best_points(values, places, starts_at)
    if not len(best):
        capacity = problem.capacity(maps.cells)
        lost = losses(problem, maps.landscape, capacity, "points of the landscape")
        return replace(answer, empty=lost)
    starts = np.concatenate([best, rng.uniform(size=(starts_at, best.shape[1]))])
    with work.stage("refinement", len(starts)) as tracking:
        if by == "fits":
            found = _by_fits(problem, starts, work, tracking)
            ends = np.concatenate([best, [one.path[-1] for one in found]])
        else:
            found, ends = _by_gradients(problem, starts, tracking)
    widths = orbits.widths(problem)
    told = (
        Refinement(
            by,
            problem.design.values(one.path),
            one.first,
            one.last,
            one.evaluations,
            dict(zip(problem.design.names, (one.gradient / widths).tolist(), strict=True)),
        )
        for one in found
    )
    # Descents with the same end need one confirmation.
    _, first = np.unique(np.round(ends, 4), axis=0, return_index=True)
    return replace(answer, refinement=tuple(told), ends=ends[np.sort(first)])


def _by_gradients(
    problem: DesignProblem, starts: np.ndarray, tracking: Tracking
) -> tuple[list[Descent], np.ndarray]:
    """Descend in lock-step, and polish the best distinct ends; return all descents, and these ends.

    With constraints besides bounds, only SLSQP descends, from one start after the other.
    """
    numbers, upper, effort = orbits.numbers(problem), problem.upper, problem.effort
    function, spares = numbers["objective"], orbits.spares(problem, numbers)
    found = []
    if not problem.constrained:
        progress = tracking.progress
        found = descents.descend_together(function, starts, upper, effort.steps, progress)
        ends = [one.path[-1] for one in descents.apart(found)]
        # If only neighbours in the map lead to orbits, descents find none: the best points stay.
        starts = np.array(ends or [*starts])[: effort.refine]
    polished = []
    for start in starts:
        polished.append(descents.descend(function, start, upper, effort.steps, spares))
        tracking.progress(len(found) + len(polished), len(found) + len(starts))
    return polished + found, np.stack([one.path[-1] for one in polished])


def _by_fits(
    problem: DesignProblem, starts: np.ndarray, work: Work, tracking: Tracking
) -> list[Descent]:
    """Descend by fits to runs from random starts, in lock-step."""
    steps = []

    def objective(places: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """Return values (m,) at points (m, n); `numbers` (m,) are seeds of the starts' shifts."""
        draws = [np.random.default_rng(number) for number in numbers]
        shifts = np.stack([rng.uniform(-SHIFT, SHIFT, 2) for rng in draws])
        rows = evaluate(problem, places, _short(problem), shifts=shifts)
        steps.append(rows["steps"].sum())
        return judged(rows)

    found = descents.descend_by_fits(
        objective, starts, seed=problem.effort.seed, progress=tracking.progress
    )
    work.steps["refinement"] = int(np.sum(steps))
    return found


def confirm(answer: Answer, work: Work) -> Answer:
    """Make several long runs of the ends and of the design to compare with, from each start.

    The best end that counts is the optimum. If no end counts, `empty` says why.
    """
    problem, effort, maps, ends = answer.problem, answer.problem.effort, answer.maps, answer.ends
    if ends is None:
        ends = np.zeros((0, len(problem.design.names)))
    assert maps is not None
    reference = problem.design.unit(problem.reference)
    points = np.concatenate([ends, reference[None]])
    repeats = Repeats(effort.runs, long_window(effort), effort.seed)

    def solved() -> list[Orbit | None]:
        if maps.orbits is None:
            return [None] * len(points)
        found = [orbits.orbit_of(problem, point) for point in ends]
        return [*found, maps.reference or orbits.orbit_of(problem, reference)]

    total = len(landscape.STARTS) * len(points) * repeats.runs
    with work.stage("confirmation", total) as tracking:
        runs, found = work.at_once(
            lambda: long_runs(problem, points, repeats, tracking),
            solved,
        )
        *ended, other = [confirmed(problem, *of) for of in zip(points, runs, found, strict=True)]
    work.steps["confirmation"] = sum(int(rows["steps"].sum()) for rows in runs)
    best = min((one for one in ended if one.counts), key=lambda one: one.objective, default=None)
    empty = answer.empty
    if best is None and ended:
        rows = {name: np.stack([one[name] for one in runs[:-1]], axis=1) for name in runs[0]}
        empty = losses(problem, rows, problem.capacity(ends), "long-run ends of descents")
    candidates = tuple(ended)
    return replace(answer, optimum=best, candidates=candidates, reference=other, empty=empty)


def bound(answer: Answer, work: Work) -> Answer:
    """Refine the map until it bounds the box, and search for worse motions of both designs."""
    best = answer.optimum
    if best is None or answer.reference is None:
        return answer
    refined_map, designs = work.at_once(
        lambda: _refine_map(answer, work, best), lambda: _coexisting(answer, work)
    )
    answer = replace(answer, **designs)
    # The bound is relative to the reported objective, which a worse orbit may have raised.
    assert answer.optimum is not None and answer.maps is not None
    known = unbounded(answer.problem, answer.maps, answer.optimum)
    if known is None:
        assert refined_map is not None
        known = optimality_bound(refined_map, answer.optimum)
    return replace(answer, bound=known)


def _refine_map(answer: Answer, work: Work, best: Confirmed) -> Refined | None:
    """Refine the map of orbits until it bounds the box; None if no bound can be computed."""
    problem, effort, maps = answer.problem, answer.problem.effort, answer.maps
    assert maps is not None
    if unbounded(problem, maps, best):
        return None
    assert maps.orbits is not None
    with work.stage("bound", MOST) as tracking:
        rows = landscape.rows_of(maps.orbits, len(maps.points))
        repeats = Repeats(effort.runs, _short(problem), effort.seed)
        points = Points(problem, maps.points, rows, repeats, tracking)
        within = WITHIN * abs(best.objective) if effort.within is None else effort.within
        return refined(points, Cells.of_grid(maps.orbits.counts.shape), best, within)


def _coexisting(answer: Answer, work: Work) -> dict[str, Confirmed]:
    """Return optimum and reference with the orbits to which random starts converge.

    An orbit that is worse than the design's own decides the objective.
    """
    designs = {"optimum": answer.optimum, "reference": answer.reference}
    known = {name: one for name, one in designs.items() if one is not None}
    if answer.maps is None or answer.maps.orbits is None:
        return known
    with work.stage("coexisting", len(known)):
        found = work.at_once(
            *(
                lambda one=one: orbits.coexisting(answer.problem, one.values)
                for one in known.values()
            ),
        )
    return {
        name: by_worst_orbit(answer.problem, one, others)
        for (name, one), others in zip(known.items(), found, strict=True)
    }


def by_worst_orbit(
    problem: DesignProblem, design: Confirmed, found: tuple[Coexisting, ...]
) -> Confirmed:
    """Return a design with the orbits of random starts, with the objective of the worst orbit."""
    design = replace(design, coexisting=found)
    known = (one for one in found if not np.isnan(one.objective))
    worst = max(known, key=lambda one: one.objective, default=None)
    # The objective of a design that does not count stays NaN.
    if worst is None or not orbits.worse(worst.objective, design.objective):
        return design
    forces = {name: float(worst.solution[name]) for name in design.forces}
    half_width = orbits.error(problem, worst.solution, worst.objective)
    return replace(design, objective=worst.objective, half_width=half_width, forces=forces)


def explain(answer: Answer, work: Work) -> Answer:
    """Find the active constraints at the optimum, and the load sheets of the designs."""
    if answer.optimum is None:
        return answer
    active, free_slopes = active_constraints(answer.problem, answer.optimum)
    return replace(answer, active=active, free_slopes=free_slopes, load_sheets=_load_sheets(answer))


def _load_sheets(answer: Answer) -> dict[str, list[Row]]:
    """Return the load sheets of the designs that settle on their orbit, by title.

    Motor power, frame mass and points are those of the machine's description.
    """
    described = answer.problem.design.machine.given
    power, frame = described.get("motor_power"), described.get("frame_mass")
    site = Site(power, frame, points_of(described))
    return {
        title: sheet(design.orbit.solution, ORDERS, site)
        for title, design in answer.designs.items()
        if design.settles and design.orbit is not None
    }


def trade(answer: Answer, work: Work) -> Answer:
    """Find the Pareto fronts of the optimum; none if it does not settle on an orbit."""
    best, maps = answer.optimum, answer.maps
    mapped = None if maps is None else maps.counting_orbits
    if best is None or maps is None or mapped is None or not best.settles:
        return answer
    problem = answer.problem
    with work.stage("fronts", 2):
        found = fronts(problem, best, maps.points, mapped, problem.effort.steps)
    return replace(answer, fronts=found)


# The result of each stage -> the stage, in the order of the search.
STAGES = {
    "maps": map_box,
    "descents": refine,
    "long runs": confirm,
    "bound": bound,
    "active constraints": explain,
    "fronts": trade,
}
