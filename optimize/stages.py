"""The stages of a search: each takes the problem and earlier results, and returns results."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import xarray as xr
from rich.progress import Progress as Bars

import jaxcrusher as jc
from jaxcrusher.batch.engines import default_engine
from jaxcrusher.dynamics.regime import Regime
from jaxcrusher.dynamics.slopes import GradientReport
from jaxcrusher.files.journal import Journal
from jaxcrusher.files.provenance import provenance
from jaxcrusher.files.results import write_netcdf
from jaxcrusher.orbits.load_sheet import Row, sheet
from optimize import landscape, local, open_points, orbits, smooth
from optimize.answer import Coexisting, Confirmed, Front, OpenPoint, Refinement
from optimize.concurrent import Stopped, run_concurrently
from optimize.confirm import SHIFT, confirmed, long_runs
from optimize.decay import with_decay
from optimize.evaluate import Case, Progress, Rows, Window, evaluate, judged, losses, started
from optimize.forces import FORCES
from optimize.front import fronts
from optimize.motions import cell_motions
from optimize.problem import Problem

# Tolerances of the landscape and its motions, and of the confirmation, in clearances.
MAP_RTOL, CONFIRM_RTOL = 1e-6, 1e-8
# Confirmation runs last this many times longer than the landscape's.
LONGER = 3
# Harmonics of the shaft's speed in a load sheet.
ORDERS = 4
# Turns of the regime of the few designs that matter: settling, section points, exponents.
REGIME = (60, 200, 20)


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
    def stage(self, name: str, total: int) -> Iterator[Progress]:
        """Show a bar for a stage, and book its seconds when it ends; yields its progress."""
        bar = self.bars.add_task(name, total=total)
        began = time.perf_counter()

        def progress(done: int, _: int) -> None:
            self.bars.update(bar, completed=done)
            if self.stop.is_set():
                raise Stopped

        yield progress
        self.bars.update(bar, completed=total)
        self.seconds[name] = time.perf_counter() - began


def map_orbits(problem: Problem, work: Work, points: np.ndarray) -> xr.Dataset | None:
    """Map the periodic orbits of unit points; None where the scenes have none to solve for."""
    case = problem.case
    if orbits.unsolvable(case):
        return None
    with work.stage("orbits", len(points)) as progress:
        data = orbits.solve_map(case, points, problem.effort.cells, work.journal, progress)
    data.attrs = _provenance("Periodic orbits of a design search", problem)
    write_netcdf(work.folder / "orbits.nc", data)
    return data


def explore(problem: Problem, work: Work, units: np.ndarray) -> tuple[xr.Dataset, xr.Dataset]:
    """Integrate unit points from both starts, for their statistics and then for drawings.

    Returns the landscape, which is also written, and its motions.
    """
    case, effort = problem.case, problem.effort
    window = Window(effort.settle, effort.turns, MAP_RTOL)
    count = len(landscape.STARTS) * len(units)
    with work.stage("landscape", count) as progress:
        rows = evaluate(case, units, window, journal=work.journal, progress=progress)
    data = landscape.dataset(case, units, effort.grid, rows)
    how = asdict(window) | {"engine": default_engine(count)}
    data.attrs = _provenance("Landscape of a design search", problem, **how)
    write_netcdf(work.folder / "landscape.nc", data)
    work.steps["landscape"] = int(data.steps.sum())
    with work.stage("motions", data.objective.size) as progress:
        motions, work.steps["motions"] = cell_motions(
            case, units, data, MAP_RTOL, progress, journal=work.journal
        )
    return data, motions


def _provenance(title: str, problem: Problem, **settings: Any) -> dict[str, Any]:
    scene = {**jc.PE250X400, **problem.case.design.fixed}
    return provenance(title, scene=scene, box=asdict(problem.box), **settings)


@dataclass(frozen=True, eq=False)
class Refined:
    """The ends of local descents, shape (candidates, n), or why there are none."""

    candidates: np.ndarray
    descents: tuple[Refinement, ...] = ()
    empty: str = ""


def refine(
    problem: Problem,
    work: Work,
    units: np.ndarray,
    data: xr.Dataset,
    points: np.ndarray,
    mapped: xr.Dataset | None,
) -> Refined:
    """Descend from the best of the map's `points` and from random ones.

    Where no orbit counts, descents are fits, from the best of `units`, the landscape's points.
    """
    case, effort = problem.case, problem.effort
    rng = np.random.default_rng(effort.seed)
    begun = landscape.counting(data, units, points)
    values = np.full(len(points), np.nan)
    if mapped is not None:
        counts = mapped.counts.to_numpy().ravel() & begun
        values = np.where(counts, mapped.objective.to_numpy().ravel(), np.nan)
    best = landscape.best_points(values, points, effort.refine)
    exact = len(best) > 0
    if not exact:
        best = landscape.best_points(landscape.worst(data).to_numpy().ravel(), units, effort.refine)
    if not len(best):
        rows = {str(name): values.to_numpy() for name, values in data.items()}
        lost = losses(rows, case, case.capacity(units), "points of the landscape")
        return Refined(best, empty=lost)
    starts = np.concatenate([best, rng.uniform(size=(effort.refine, best.shape[1]))])
    with work.stage("refinement", len(starts)) as progress:
        found, ends = [], []
        for i, start in enumerate(starts):
            if exact:
                end, refined = _by_gradients(case, start, effort.steps)
            else:
                end, refined = _by_fits(problem, start, work)
            ends.append(end)
            found.append(refined)
            progress(i + 1, len(starts))
    # Descents that meet need one confirmation.
    candidates = np.stack(ends) if exact else np.concatenate([best, ends])
    _, first = np.unique(np.round(candidates, 4), axis=0, return_index=True)
    return Refined(candidates[np.sort(first)], tuple(found))


def _by_gradients(case: Case, start: np.ndarray, steps: int) -> tuple[np.ndarray, Refinement]:
    function, spares = smooth.objective(case), smooth.constraints(case)
    descent = local.descend(function, start, case.upper, steps, spares)
    slopes = descent.gradient / orbits.widths(case)
    return descent.path[-1], Refinement(
        "gradient",
        _path(case, descent.path),
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
    return path[-1], Refinement("fits", _path(case, path), *ends, objective.evaluations, {})


def _path(case: Case, units: np.ndarray) -> dict[str, np.ndarray]:
    return {name: np.asarray(values) for name, values in case.design.values(units).items()}


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


@dataclass(frozen=True, eq=False)
class Confirmation:
    """The candidates and the design to compare with after long runs, and the best candidate.

    The best is None where none counts, and `empty` says why.
    """

    candidates: tuple[Confirmed, ...]
    reference: Confirmed
    best: Confirmed | None
    empty: str = ""


def confirm(problem: Problem, work: Work, candidates: np.ndarray) -> Confirmation:
    """Run the candidates and the design to compare with for long, several times from each start."""
    case, effort = problem.case, problem.effort
    points = np.concatenate([candidates, case.design.unit(problem.reference)[None]])
    window = Window(LONGER * effort.settle, LONGER * effort.turns, CONFIRM_RTOL)
    total = len(landscape.STARTS) * len(points) * effort.runs
    with work.stage("confirmation", total) as progress:
        runs, found = run_concurrently(
            work.stop,
            lambda: long_runs(
                case, points, effort.runs, window, effort.seed, progress, work.journal
            ),
            lambda: [orbits.orbit_of(case, point) for point in points],
        )
        *ended, reference = [confirmed(case, *of) for of in zip(points, runs, found, strict=True)]
    work.steps["confirmation"] = sum(int(rows["steps"].sum()) for rows in runs)
    best = min((one for one in ended if one.counts), key=lambda one: one.objective, default=None)
    empty = _losses(case, candidates, runs[:-1]) if best is None and ended else ""
    return Confirmation(tuple(ended), reference, best, empty)


def _losses(case: Case, candidates: np.ndarray, runs: list[Rows]) -> str:
    rows = {name: np.stack([one[name] for one in runs], axis=1) for name in runs[0]}
    return losses(rows, case, case.capacity(candidates), "long-run ends of descents")


def run_open_points(
    problem: Problem, work: Work, points: np.ndarray, mapped: xr.Dataset | None
) -> tuple[OpenPoint, ...]:
    """Run the points of the map that have no stable orbit as long as candidates are run."""
    count = len(open_points.unstable(mapped))
    # Where no point of the map counts, nothing is bounded.
    if mapped is None or not count or not mapped.counts.any():
        return ()
    case, effort = problem.case, problem.effort
    window = Window(LONGER * effort.settle, LONGER * effort.turns, CONFIRM_RTOL)
    with work.stage("open points", len(landscape.STARTS) * count * effort.runs) as progress:
        return open_points.run_open_points(
            case, points, mapped, effort.runs, window, effort.seed, progress, work.journal
        )


def with_coexisting_orbits(
    problem: Problem, work: Work, designs: tuple[Confirmed, Confirmed]
) -> tuple[Confirmed, Confirmed]:
    """Return two designs with the orbits that random starts come to, and the decay of their runs.

    An orbit that is worse than the design's own takes its place in the objective.
    """
    case, (one, other) = problem.case, designs
    if orbits.unsolvable(case):
        return designs
    with work.stage("coexisting", 2) as progress:
        of_one, of_other, (one, other) = run_concurrently(
            work.stop,
            lambda: orbits.coexisting(case, one.values),
            lambda: orbits.coexisting(case, other.values),
            lambda: with_decay(case, designs),
        )
        progress(2, 2)
    return by_worst_orbit(one, of_one), by_worst_orbit(other, of_other)


def by_worst_orbit(design: Confirmed, found: tuple[Coexisting, ...]) -> Confirmed:
    """Return a design with the orbits that random starts come to, judged by the worst."""
    design = replace(design, coexisting=found)
    worst = max(found, key=lambda one: one.objective, default=None)
    # An objective of NaN, of a design that does not count, stays.
    if worst is None or not orbits.worse(worst.objective, design.objective):
        return design
    forces = {name: float(worst.solution[name]) for name in FORCES}
    return replace(design, objective=worst.objective, **forces)


def with_regimes(
    problem: Problem, work: Work, designs: tuple[Confirmed, Confirmed]
) -> tuple[tuple[Confirmed, Confirmed], GradientReport | None]:
    """Return two designs with the regimes of starts that do not come to an orbit.

    Where that is true of the first design, the slopes that its motions allow are returned too.
    """
    best, other = designs
    if best.settles and other.settles:
        return designs, None
    report = None
    with work.stage("regimes", 3) as progress:
        best, other = _with_regime(problem.case, best), _with_regime(problem.case, other)
        progress(2, 3)
        if not best.settles:
            report = _slopes(problem, best)
        progress(3, 3)
    return (best, other), report


def _with_regime(case: Case, design: Confirmed) -> Confirmed:
    settle, turns, tangent_turns = REGIME
    found = {}
    for start, runs in design.transient.items():
        if not runs.settles:
            scene = started(case.design.described(design.values), start)
            regime = jc.regime(scene, settle, turns, tangent_turns=tangent_turns)
            found[start] = _without_motion(regime)
    return replace(design, regime=found)


def _slopes(problem: Problem, best: Confirmed) -> GradientReport:
    case, effort = problem.case, problem.effort
    report = jc.gradient_report(
        lambda **numbers: started(case.design.described(numbers), "contact"),
        case.objective.outputs[0],
        best.values,
        settle_turns=effort.settle,
        turns=effort.turns,
    )
    return replace(report, regime=_without_motion(report.regime))


def _without_motion(regime: Regime) -> Regime:
    """Return the verdict with its indicators, without the motion that they were computed from."""
    return replace(regime, statistics=None, state=None)


def load_sheets(designs: Mapping[str, Confirmed]) -> dict[str, list[Row]]:
    """Return the load sheets of the foundation, by title, of designs that come to their orbit."""
    return {
        title: sheet(design.orbit.solution, ORDERS)
        for title, design in designs.items()
        if design.settles and design.orbit is not None
    }


def trade(
    problem: Problem, work: Work, best: Confirmed, points: np.ndarray, mapped: xr.Dataset | None
) -> tuple[Front, ...]:
    """Return the Pareto fronts of an optimum on its orbit; none where it has none."""
    if mapped is None or not best.settles or not mapped.counts.any():
        return ()
    with work.stage("fronts", 2) as progress:
        found = fronts(problem.case, best, points, mapped, problem.effort.steps)
        progress(2, 2)
    return found
