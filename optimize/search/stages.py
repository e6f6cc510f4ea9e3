"""The stages of a search: each takes the problem and earlier results, and returns results."""

import time
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from importlib import import_module
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import xarray as xr
from rich.progress import Progress as Bars

from jaxcrusher.batch.engines import default_engine
from jaxcrusher.files.journal import Journal
from jaxcrusher.files.provenance import provenance
from jaxcrusher.files.results import write_netcdf
from jaxcrusher.mechanism.reductions import ALL_THE_TIME
from jaxcrusher.scenes.reader import points_of
from jaxcrusher.sheets.load_sheet import Row, Site, sheet
from optimize.answer import Bound, Coexisting, Confirmed, Front, Orbit, Refinement
from optimize.ask.case import Case
from optimize.ask.constraints import losses
from optimize.ask.problem import Problem
from optimize.search import descents as local
from optimize.search import landscape, orbits, smooth
from optimize.search.bound import MOST, Points, Refined, optimality_bound, refined, unbounded
from optimize.search.cells import Cells
from optimize.search.concurrent import Stopped, run_concurrently
from optimize.search.confirm import SHIFT, Repeats, confirmed, long_runs
from optimize.search.decay import with_decay
from optimize.search.evaluate import Tracking, Window, evaluate, judged
from optimize.search.front import fronts
from optimize.search.landscape import Maps

# Tolerances of the landscape and of the confirmation, in clearances.
MAP_RTOL, CONFIRM_RTOL = 1e-6, 1e-8
# Confirmation runs last this many times longer than the landscape's.
LONGER = 3
# Designs that are looked at before all others: if none of them keeps contact, few or none has an
# orbit that keeps it, which is what nodes solve for.
SCOUTS = 16
# Harmonics of the shaft's speed in a load sheet.
ORDERS = 4
# Fields of `Answer` that a stage finds.
Part = dict[str, Any]
# By how much less than the optimum the box may hold, as a share of it, unless another is asked.
WITHIN = 3e-5


@dataclass(eq=False)
class Work:
    """Where stages tell their progress, keep what they have computed, and book what they spend.

    Stages may run concurrently. Where `stop` is set they end when they next tell their progress.
    """

    folder: Path
    bars: Bars
    journal: Journal
    stop: Event = field(default_factory=Event)
    seconds: dict[str, float] = field(default_factory=dict)
    steps: dict[str, int] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str, total: int) -> Iterator[Tracking]:
        """Show a bar for a stage, and book its seconds when it ends."""
        bar = self.bars.add_task(name, total=total)
        began = time.perf_counter()

        def progress(done: int, _: int) -> None:
            self.bars.update(bar, completed=done)
            if self.stop.is_set():
                raise Stopped

        yield Tracking(progress, self.journal)
        self.bars.update(bar, completed=total)
        self.seconds[name] = time.perf_counter() - began


def map_box(problem: Problem, work: Work) -> tuple[Maps, Orbit | None]:
    """Look at the whole box: its periodic orbits, and both starts on a coarser grid.

    Returns the maps, and the orbit of the design to compare with, which needs none of them: it is
    searched for beside them, with the programs that the confirmation uses again.
    """
    effort, case = problem.effort, problem.case
    cells, points = (
        landscape.points(case.design, grid, effort.samples, effort.seed)
        for grid in (effort.grid, effort.cells)
    )
    reference = case.design.unit(problem.searched.reference)
    contact: Future[bool] = Future()  # whether any design keeps it

    def explore() -> xr.Dataset:
        try:
            contact.set_result(_scouted(problem, work, points))
        except BaseException as error:
            contact.set_exception(error)
            raise
        found = _explore(problem, work, cells)
        import_module("optimize.tell.figures")  # a second, while the map of orbits is computed
        return found

    mapped, data, orbit = run_concurrently(
        work.stop,
        lambda: _map_orbits(problem, work, points, contact),
        explore,
        lambda: orbits.orbit_of(case, reference) if contact.result() else None,
    )
    return Maps(cells, data, points, mapped, contact.result()), orbit


def _scouted(problem: Problem, work: Work, points: np.ndarray) -> bool:
    """Tell whether any of some designs, evenly over the box, keeps contact from a start."""
    case, effort = problem.case, problem.effort
    some = landscape.spread(points, SCOUTS)
    with work.stage("scouts", len(landscape.STARTS) * len(some)) as tracking:
        rows = evaluate(case, some, Window(effort.settle, effort.turns, MAP_RTOL), tracking)
    shares = [column for name, column in rows.items() if name.endswith("contact_fraction")]
    return not shares or bool((np.min(shares, axis=0) >= ALL_THE_TIME).any())


def _map_orbits(
    problem: Problem, work: Work, points: np.ndarray, contact: Future[bool]
) -> xr.Dataset | None:
    """Map the periodic orbits of unit points; None where there are none to solve for.

    That is so of scenes that cannot be solved for, and of a box in which no scout keeps contact,
    unless another design has an orbit by nodes all the same.
    """
    case = problem.case
    if orbits.unsolvable(case):
        return None
    with work.stage("orbits", len(points)) as tracking:
        data = orbits.solve_map(case, points, problem.effort.cells, contact.result, tracking)
    if data is None:
        return None
    data.attrs = _provenance("Periodic orbits of a design search", problem)
    write_netcdf(work.folder / "orbits.nc", data)
    return data


def _explore(problem: Problem, work: Work, cells: np.ndarray) -> xr.Dataset:
    """Integrate unit points from both starts; return the landscape, which is also written."""
    case, effort = problem.case, problem.effort
    window = Window(effort.settle, effort.turns, MAP_RTOL)
    count = len(landscape.STARTS) * len(cells)
    with work.stage("landscape", count) as tracking:
        rows = evaluate(case, cells, window, tracking)
    data = landscape.dataset(case, cells, effort.grid, rows)
    how = asdict(window) | {"engine": default_engine(count)}
    data.attrs = _provenance("Landscape of a design search", problem, **how)
    write_netcdf(work.folder / "landscape.nc", data)
    work.steps["landscape"] = int(data.steps.sum())
    return data


def _provenance(title: str, problem: Problem, **settings: Any) -> dict[str, Any]:
    design = problem.case.design
    return provenance(title, scene=design.whole(design.fixed), box=asdict(problem.box), **settings)


def refine(problem: Problem, work: Work, maps: Maps) -> tuple[np.ndarray, Part]:
    """Descend from the best points of the map of orbits, and from random ones.

    Where no orbit counts, descents are fits, from the best cells of the landscape. Returns the ends
    of the descents, shape (candidates, n), and `refinement`, or why there is none.
    """
    case, effort = problem.case, problem.effort
    rng = np.random.default_rng(effort.seed)
    mapped, data = maps.orbits, maps.landscape
    values = np.full(len(maps.points), np.nan)
    if mapped is not None:
        begun = landscape.counting(data, maps.cells, maps.points)
        counts = mapped.counts.to_numpy().ravel() & begun
        values = np.where(counts, mapped.objective.to_numpy().ravel(), np.nan)
    best = landscape.best_points(values, maps.points, effort.refine)
    exact = len(best) > 0
    if not exact:
        worst = landscape.worst(data).to_numpy().ravel()
        best = landscape.best_points(worst, maps.cells, effort.refine)
    if not len(best):
        lost = losses(case, data, case.capacity(maps.cells), "points of the landscape")
        return best, {"empty": lost}
    starts = np.concatenate([best, rng.uniform(size=(effort.refine, best.shape[1]))])
    with work.stage("refinement", len(starts)) as tracking:
        found, ends = [], []
        for i, start in enumerate(starts):
            if exact:
                end, refined = _by_gradients(case, start, effort.steps)
            else:
                end, refined = _by_fits(problem, start, work)
            ends.append(end)
            found.append(refined)
            tracking.progress(i + 1, len(starts))
    # Descents that meet need one confirmation.
    candidates = np.stack(ends) if exact else np.concatenate([best, ends])
    _, first = np.unique(np.round(candidates, 4), axis=0, return_index=True)
    return candidates[np.sort(first)], {"refinement": tuple(found)}


def _by_gradients(case: Case, start: np.ndarray, steps: int) -> tuple[np.ndarray, Refinement]:
    function, spares = smooth.objective(case), smooth.constraints(case)
    descent = local.descend(function, start, case.upper, steps, spares)
    slopes = descent.gradient / orbits.widths(case)
    return descent.path[-1], Refinement(
        "gradient",
        case.design.values(descent.path),
        descent.first,
        descent.last,
        descent.evaluations,
        dict(zip(case.design.names, slopes.tolist(), strict=True)),
    )


def _by_fits(problem: Problem, start: np.ndarray, work: Work) -> tuple[np.ndarray, Refinement]:
    case, effort = problem.case, problem.effort
    objective = _NoisyObjective(case, Window(effort.settle, effort.turns, MAP_RTOL))
    path, means, _ = local.descend_by_fits(objective, start, seed=effort.seed)
    work.steps["refinement"] = work.steps.get("refinement", 0) + objective.steps
    ends = float(means[0]), float(means[-1])
    points = case.design.values(path)
    return path[-1], Refinement("fits", points, *ends, objective.evaluations, {})


class _NoisyObjective:
    """The objective of points with random starts, counting its integration steps."""

    def __init__(self, case: Case, window: Window):
        self.case, self.window, self.steps, self.evaluations = case, window, 0, 0

    def __call__(self, units: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """Return values (m,) of points (m, n), each start shifted as its number says."""
        draws = [np.random.default_rng(number) for number in numbers]
        shifts = np.stack([rng.uniform(-SHIFT, SHIFT, 2) for rng in draws])
        rows = evaluate(self.case, units, self.window, shifts=shifts)
        self.steps += int(rows["steps"].sum())
        self.evaluations += len(units)
        return judged(rows)


def confirm(
    problem: Problem, work: Work, maps: Maps, candidates: np.ndarray, orbit: Orbit | None
) -> tuple[Confirmed | None, Part]:
    """Run the candidates and the design to compare with for long, several times from each start.

    `orbit` is that of the design to compare with, if it is known. Returns the best candidate, None
    where none counts, with `candidates`, `seed_choice`, and why there is no best one.
    """
    case, (_, repeats) = problem.case, _repeats(problem)
    reference = case.design.unit(problem.searched.reference)
    points = np.concatenate([candidates, reference[None]])

    def solved() -> list[Orbit | None]:
        if maps.orbits is None:
            return [None] * len(points)
        ends = [orbits.orbit_of(case, point) for point in candidates]
        return [*ends, orbit or orbits.orbit_of(case, reference)]

    total = len(landscape.STARTS) * len(points) * repeats.runs
    with work.stage("confirmation", total) as tracking:
        runs, found = run_concurrently(
            work.stop,
            lambda: long_runs(case, points, repeats, tracking),
            solved,
        )
        *ended, other = [confirmed(case, *of) for of in zip(points, runs, found, strict=True)]
    work.steps["confirmation"] = sum(int(rows["steps"].sum()) for rows in runs)
    best = min((one for one in ended if one.counts), key=lambda one: one.objective, default=None)
    part: Part = {"candidates": tuple(ended), "seed_choice": other}
    if best is None and ended:
        rows = {name: np.stack([one[name] for one in runs[:-1]], axis=1) for name in runs[0]}
        capacity = case.capacity(candidates)
        part["empty"] = losses(case, rows, capacity, "long-run ends of descents")
    return best, part


def _repeats(problem: Problem) -> tuple[Repeats, Repeats]:
    """Return runs as long as the landscape's, and those that a design is judged by."""
    effort = problem.effort
    short = Window(effort.settle, effort.turns, MAP_RTOL)
    long = Window(LONGER * effort.settle, LONGER * effort.turns, CONFIRM_RTOL)
    return Repeats(effort.runs, short, effort.seed), Repeats(effort.runs, long, effort.seed)


def refine_map(problem: Problem, work: Work, maps: Maps, best: Confirmed) -> Refined | None:
    """Refine the map of orbits until it bounds the box; None where nothing can be bounded."""
    case, effort, mapped = problem.case, problem.effort, maps.orbits
    if unbounded(case, maps, best):
        return None
    assert mapped is not None
    with work.stage("bound", MOST) as tracking:
        rows = landscape.rows_of(mapped, len(maps.points))
        points = Points(case, maps.points, rows, _repeats(problem), tracking)
        within = WITHIN * abs(best.objective) if effort.within is None else effort.within
        return refined(points, Cells.of_grid(mapped.counts.shape), best, within)


def bounded(problem: Problem, maps: Maps, found: Refined | None, best: Confirmed) -> Bound:
    """Return how far below the optimum the box may hold another design, from a refined map.

    The optimum is the one that is reported: a worse orbit may have raised its objective.
    """
    if none := unbounded(problem.case, maps, best):
        return none
    assert found is not None
    return optimality_bound(found, best)


def with_coexisting_orbits(
    problem: Problem, work: Work, maps: Maps, designs: tuple[Confirmed, Confirmed]
) -> tuple[Confirmed, Confirmed]:
    """Return two designs with the orbits that random starts come to, and the decay of their runs.

    An orbit that is worse than the design's own takes its place in the objective.
    """
    case, (one, other) = problem.case, designs
    if maps.orbits is None:
        return designs
    with work.stage("coexisting", 2):
        of_one, of_other, (one, other) = run_concurrently(
            work.stop,
            lambda: orbits.coexisting(case, one.values),
            lambda: orbits.coexisting(case, other.values),
            lambda: with_decay(case, designs),
        )
    return by_worst_orbit(case, one, of_one), by_worst_orbit(case, other, of_other)


def by_worst_orbit(case: Case, design: Confirmed, found: tuple[Coexisting, ...]) -> Confirmed:
    """Return a design with the orbits that random starts come to, judged by the worst."""
    design = replace(design, coexisting=found)
    known = (one for one in found if not np.isnan(one.objective))
    worst = max(known, key=lambda one: one.objective, default=None)
    # An objective of NaN, of a design that does not count, stays.
    if worst is None or not orbits.worse(worst.objective, design.objective):
        return design
    forces = {name: float(worst.solution[name]) for name in design.forces}
    half_width = orbits.error(case, worst.solution, worst.objective)
    return replace(design, objective=worst.objective, half_width=half_width, forces=forces)


def load_sheets(
    described: Mapping[str, Any], designs: Mapping[str, Confirmed]
) -> dict[str, list[Row]]:
    """Return the load sheets of the foundation, by title, of designs that come to their orbit.

    Motor, frame and points are those that are `described`.
    """
    power, frame = described.get("motor_power"), described.get("frame_mass")
    site = Site(power, frame, points_of(described))
    return {
        title: sheet(design.orbit.solution, ORDERS, site)
        for title, design in designs.items()
        if design.settles and design.orbit is not None
    }


def trade(problem: Problem, work: Work, best: Confirmed, maps: Maps) -> tuple[Front, ...]:
    """Return the Pareto fronts of an optimum on its orbit; none where it has none."""
    mapped = maps.counting_orbits
    if mapped is None or not best.settles:
        return ()
    with work.stage("fronts", 2):
        return fronts(problem.case, best, maps.points, mapped, problem.effort.steps)
