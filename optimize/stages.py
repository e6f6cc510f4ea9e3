"""The stages of a search, each with its seconds and integration steps."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import xarray as xr
from rich.progress import Progress as Bars

import jaxcrusher as jc
from jaxcrusher.files.provenance import provenance
from jaxcrusher.files.results import write_netcdf
from optimize import landscape, local, problem, settled, smooth
from optimize.abreast import Stopped, abreast
from optimize.answer import Answer, Companion, Confirmed, Refinement
from optimize.confirm import SHIFT, confirmed, long_runs
from optimize.decay import with_decay
from optimize.evaluate import Case, Progress, Window, evaluate, judged, losses, started
from optimize.front import fronts
from optimize.held import held
from optimize.motions import cell_motions
from optimize.options import Options

# Tolerances of the landscape and its motions, and of the confirmation, in clearances.
MAP_RTOL, CONFIRM_RTOL = 1e-6, 1e-8
# Confirmation runs last this many times longer than the landscape's.
LONGER = 3
# Turns of the regime of the few designs that matter: settling, section points, exponents.
REGIME = (60, 200, 20)


@dataclass(frozen=True)
class Search:
    """What every stage works on: the case, what was asked for, and where its progress is told.

    Stages may run side by side; where `stop` is set they end when they next tell their progress.
    """

    case: Case
    options: Options
    bars: Bars
    stop: Event = field(default_factory=Event)

    @contextmanager
    def stage(self, answer: Answer, name: str, total: int) -> Iterator[Progress]:
        """A bar for a stage, whose seconds are booked when it ends; yields its progress."""
        bar = self.bars.add_task(name, total=total)
        began = time.perf_counter()

        def progress(done: int, _: int) -> None:
            self.bars.update(bar, completed=done)
            if self.stop.is_set():
                raise Stopped

        yield progress
        answer.seconds[name] = time.perf_counter() - began


def map_orbits(
    search: Search, answer: Answer, units: np.ndarray, folder: Path
) -> xr.Dataset | None:
    """The settled motions of `units`; None where the scenes have no orbit to solve for."""
    case = search.case
    if settled.unsolvable(case):
        return None
    with search.stage(answer, "settled", len(units)) as progress:
        rows = settled.solve_map(case, units, progress)
    data = settled.mapped(case, units, search.options.cells, rows)
    data.attrs = _provenance("Settled motions of a design search", search, answer)
    write_netcdf(folder / "settled.nc", data)
    return data


def explore(
    search: Search, answer: Answer, units: np.ndarray, folder: Path
) -> tuple[xr.Dataset, xr.Dataset]:
    """What both starts of `units` do in their first turns, written after every chunk.

    Also their motions after these, for the page.
    """
    case, options = search.case, search.options
    window = Window(options.settle, options.turns, MAP_RTOL)
    attributes = _provenance("Landscape of a design search", search, answer, **asdict(window))
    data = xr.Dataset()
    with search.stage(answer, "landscape", len(units)) as progress:
        for done, data in landscape.mapped(case, units, options.grid, window):
            data.attrs = attributes
            write_netcdf(folder / "landscape.nc", data)
            progress(done, len(units))
    answer.steps["landscape"] = int(data.steps.sum())
    with search.stage(answer, "motions", data.objective.size) as progress:
        motions, answer.steps["motions"] = cell_motions(case, units, data, MAP_RTOL, progress)
    return data, motions


def _provenance(title: str, search: Search, answer: Answer, **settings: Any) -> dict[str, Any]:
    scene = {**jc.PE250X400, **search.case.design.fixed}
    return provenance(title, scene=scene, box=asdict(answer.box), **settings)


def refine(
    search: Search,
    answer: Answer,
    units: np.ndarray,
    data: xr.Dataset,
    points: np.ndarray,
    orbits: xr.Dataset | None,
) -> tuple[np.ndarray, Answer]:
    """Local descents from the best of the settled map's `points` and from random ones.

    Where no settled motion counts they are fits, from the best of `units`, the landscape's points.
    Returns the candidates (m, n), and the answer with its descents; where none of `units` counts
    either there are none, and the answer says why.
    """
    case, options = search.case, search.options
    rng = np.random.default_rng(options.seed)
    started = landscape.counting(data, units, points)
    values = np.full(len(points), np.nan)
    if orbits is not None:
        counts = orbits.counts.to_numpy().ravel() & started
        values = np.where(counts, orbits.objective.to_numpy().ravel(), np.nan)
    best = landscape.best_points(values, points, options.refine)
    exact = len(best) > 0
    if not exact:
        best = landscape.best_points(
            landscape.worst(data).to_numpy().ravel(), units, options.refine
        )
    if not len(best):
        rows = {str(name): values.to_numpy() for name, values in data.items()}
        return best, replace(
            answer, empty=losses(rows, case, case.capacity(units), "points of the landscape")
        )
    starts = np.concatenate([best, rng.uniform(size=(options.refine, best.shape[1]))])
    with search.stage(answer, "refinement", len(starts)) as progress:
        found, ends = [], []
        for i, start in enumerate(starts):
            if exact:
                end, refined = _by_gradients(case, start, options.steps)
            else:
                end, refined = _by_fits(case, start, answer, options)
            ends.append(end)
            found.append(refined)
            progress(i + 1, len(starts))
    # Descents that meet need one confirmation.
    candidates = np.stack(ends) if exact else np.concatenate([best, ends])
    _, first = np.unique(np.round(candidates, 4), axis=0, return_index=True)
    return candidates[np.sort(first)], replace(answer, refinement=tuple(found))


def _by_gradients(case: Case, start: np.ndarray, steps: int) -> tuple[np.ndarray, Refinement]:
    function, spares = smooth.objective(case), smooth.floor(case)
    descent = local.descend(function, start, case.upper, steps, spares)
    slopes = descent.gradient / settled.widths(case)
    return descent.path[-1], Refinement(
        "gradient",
        _path(case, descent.path),
        descent.first,
        descent.last,
        descent.evaluations,
        dict(zip(case.design.names, slopes.tolist(), strict=True)),
    )


def _by_fits(
    case: Case, start: np.ndarray, answer: Answer, options: Options
) -> tuple[np.ndarray, Refinement]:
    objective = _NoisyObjective(case, Window(options.settle, options.turns, MAP_RTOL))
    path, means, _ = local.descend_by_fits(objective, start, seed=options.seed)
    answer.steps["refinement"] = answer.steps.get("refinement", 0) + objective.steps
    ends = float(means[0]), float(means[-1])
    return path[-1], Refinement("fits", _path(case, path), *ends, objective.evaluations, {})


def _path(case: Case, units: np.ndarray) -> dict[str, np.ndarray]:
    return {name: np.asarray(values) for name, values in case.design.values(units).items()}


class _NoisyObjective:
    """The judged objective of points with random starts, counting its integration steps."""

    def __init__(self, case: Case, window: Window):
        self.case, self.window, self.steps, self.evaluations = case, window, 0, 0

    def __call__(self, units: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """Values (m,) of points (m, n), each start shifted as its number says."""
        draws = [np.random.default_rng(number) for number in numbers]
        shifts = np.stack([rng.uniform(-SHIFT, SHIFT, 2) for rng in draws])
        values = np.full(len(units), np.nan)
        for part, rows in evaluate(self.case, units, self.window, shifts=shifts):
            values[part] = judged(rows)
            self.steps += int(rows["steps"].sum())
        self.evaluations += len(units)
        return values


def settle_on(
    search: Search, answer: Answer, candidates: np.ndarray
) -> tuple[Answer, Confirmed | None]:
    """Independent long runs of the candidates and of the design to compare with.

    Returns the answer with them, and the best one. That is None where none counts, and the answer
    says why.
    """
    case, options = search.case, search.options
    points = np.concatenate([candidates, case.design.unit(problem.reference(options))[None]])
    window = Window(LONGER * options.settle, LONGER * options.turns, CONFIRM_RTOL)
    with search.stage(answer, "confirmation", len(points) * options.runs) as progress:
        runs, orbits = abreast(
            search.stop,
            lambda: long_runs(case, points, options.runs, window, options.seed, progress),
            lambda: [settled.looked_at(case, point) for point in points],
        )
        found = [confirmed(case, *of) for of in zip(points, runs, orbits, strict=True)]
    answer.steps["confirmation"] = sum(
        int(runs.by_run["steps"].sum()) for one in found for runs in one.transient.values()
    )
    *ended, reference = found
    answer = replace(answer, candidates=tuple(ended), seed_choice=reference)
    best = min((one for one in ended if one.counts), key=lambda one: one.objective, default=None)
    if best is None and ended:
        rows = {name: np.stack([one[name] for one in runs[:-1]], axis=1) for name in runs[0]}
        answer = replace(
            answer, empty=losses(rows, case, case.capacity(candidates), "long-run ends of descents")
        )
    return answer, best


def weigh(search: Search, answer: Answer, best: Confirmed) -> Answer:
    """The answer with what holds the best where it is, and what else random starts come to.

    Starts of best and reference that come to no settled motion get a regime, and the best slopes
    by what motions allow.
    """
    case, options = search.case, search.options
    assert answer.seed_choice is not None
    reference: Confirmed = answer.seed_choice

    def scene(start: str, numbers: dict[str, Any]) -> jc.Scene:
        return started({**case.design.fixed, **numbers}, start)

    def regimes(design: Confirmed) -> Confirmed:
        settle, turns, tangent_turns = REGIME
        found = {}
        for start, runs in design.transient.items():
            if not runs.settles:
                motion = scene(start, design.values)
                found[start] = _kept(jc.regime(motion, settle, turns, tangent_turns=tangent_turns))
        return replace(design, regime=found)

    if not settled.unsolvable(case):
        with search.stage(answer, "companions", 2) as progress:
            of_best, of_reference, (best, reference) = abreast(
                search.stop,
                lambda: settled.companions(case, best.values),
                lambda: settled.companions(case, reference.values),
                lambda: with_decay(case, [best, reference]),
            )
            best, reference = accompanied(best, of_best), accompanied(reference, of_reference)
            progress(2, 2)
    if not (best.settles and reference.settles):
        with search.stage(answer, "regimes", 3) as progress:
            best, reference = regimes(best), regimes(reference)
            progress(2, 3)
            if not best.settles:
                slopes = jc.gradient_report(
                    lambda **numbers: scene("contact", numbers),
                    case.objective.outputs[0],
                    best.values,
                    settle_turns=options.settle,
                    turns=options.turns,
                )
                slopes = replace(slopes, regime=_kept(slopes.regime))
                answer = replace(answer, gradient_report=slopes)
            progress(3, 3)
    limits, unheld = held(case, best)
    return replace(
        answer,
        optimum=best,
        seed_choice=reference,
        ideal=best.ideal_rms,
        held=limits,
        unheld=unheld,
    )


def trade(
    search: Search, answer: Answer, best: Confirmed, units: np.ndarray, orbits: xr.Dataset | None
) -> Answer:
    """The answer with the fronts of a settled optimum."""
    if orbits is None or not best.settles or not orbits.counts.any():
        return answer
    with search.stage(answer, "fronts", 2) as progress:
        found = fronts(search.case, best, units, orbits, search.options.steps)
        progress(2, 2)
    return replace(answer, fronts=found)


def accompanied(design: Confirmed, found: tuple[Companion, ...]) -> Confirmed:
    """A design with the motions that random starts come to, judged by the worst."""
    design = replace(design, companions=found)
    worst = max(found, key=lambda one: one.objective, default=None)
    # What does not count, a NaN, stays so.
    if worst is None or not settled.worse(worst.objective, design.objective):
        return design
    return replace(
        design,
        objective=worst.objective,
        foundation_rms=worst.foundation_rms,
        shaking_rms=worst.shaking_rms,
    )


def _kept(regime: jc.Regime) -> jc.Regime:
    """The verdict with its indicators, without the motion they are of."""
    return replace(regime, statistics=None, state=None)
