"""The stages of a search, each with its seconds and integration steps."""

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from rich.progress import Progress as Bars

import jaxcrusher as jc
from jaxcrusher.files.provenance import provenance
from jaxcrusher.files.results import write_netcdf
from optimize import landscape, local, problem
from optimize.answer import Answer, Confirmed, Refinement
from optimize.confirm import SHIFT, confirm
from optimize.evaluate import STARTS, Case, Progress, Window, evaluate, judged, started
from optimize.motions import cell_motions
from optimize.options import Options

# Tolerances of the landscape with its exponents and motions, and of the confirmation, in
# clearances.
MAP_RTOL, CONFIRM_RTOL = 1e-6, 1e-8
# Confirmation runs last this many times longer than the landscape's.
LONGER = 3
# Turns of the regime of the few designs that matter: settling, section points, exponents.
REGIME = (60, 200, 20)


@dataclass(frozen=True)
class Search:
    """What every stage works on: the case, what was asked for, and where its progress is told."""

    case: Case
    options: Options
    bars: Bars

    @contextmanager
    def stage(self, answer: Answer, name: str, total: int) -> Iterator[Progress]:
        """A bar for a stage, whose seconds are booked when it ends; yields its progress."""
        bar = self.bars.add_task(name, total=total)
        began = time.perf_counter()
        yield lambda done, _: self.bars.update(bar, completed=done)
        answer.seconds[name] = time.perf_counter() - began


def explore(search: Search, answer: Answer, units: np.ndarray, folder: Path) -> xr.Dataset:
    """The landscape of `units` with its exponents, written after every chunk."""
    case, options = search.case, search.options
    window = Window(options.settle, options.turns, MAP_RTOL)
    attributes = provenance(
        "Landscape of a design search",
        scene={**jc.PE250X400, **case.design.fixed},
        box=asdict(answer.box),
        settle_turns=window.settle,
        turns=window.turns,
        rtol=window.rtol,
    )
    data = xr.Dataset()
    with search.stage(answer, "landscape", len(units)) as progress:
        for done, data in landscape.mapped(case, units, options.grid, window):
            data.attrs = attributes
            write_netcdf(folder / "landscape.nc", data)
            progress(done, len(units))
    answer.steps["landscape"] = int(data.steps.sum())
    with search.stage(answer, "regimes", data.objective.size) as progress:
        states = data.state.to_numpy().reshape(len(STARTS), len(units), -1)
        largest, steps = landscape.exponents(case, units, states, MAP_RTOL, progress)
    answer.steps["regimes"] = steps
    data["exponent"] = data.objective.copy(data=largest.reshape(data.objective.shape))
    data.exponent.attrs = {"units": "1", "long_name": "largest Lyapunov exponent, a turn"}
    write_netcdf(folder / "landscape.nc", data)
    return data


def refine(
    search: Search, answer: Answer, units: np.ndarray, data: xr.Dataset
) -> tuple[np.ndarray, Answer]:
    """Local descents from the best of `units`, the landscape's points, and from random ones.

    Returns the candidates (m, n), the best points of the landscape first, and the answer with
    its descents.
    """
    case, options = search.case, search.options
    values = landscape.worst(data).to_numpy().ravel()
    best = landscape.best_points(values, units, options.refine)
    if not len(best):
        raise RuntimeError("every point of the box failed, whirls or breaks a constraint")
    rng = np.random.default_rng(options.seed)
    starts = np.concatenate([best, rng.uniform(size=(options.refine, best.shape[1]))])
    # A start's motion is taken for that of the landscape's nearest point.
    nearest = np.argmin(((starts[:, None] - units) ** 2).sum(axis=-1), axis=1)
    exponent = data.exponent.to_numpy().reshape(len(STARTS), -1).max(axis=0)[nearest]
    # A NaN exponent, of a failed motion, has no gradient either.
    regular = exponent < landscape.CHAOTIC
    steps = options.steps if regular.any() else 0
    found, ends, taken = [], [], 0
    with search.stage(answer, "refinement", steps + int((~regular).sum())) as progress:
        if regular.any():
            descent = local.descend_by_gradients(case, starts[regular], steps, progress)
            taken += descent.steps
            ends.append(descent.path[-1])
            found += _by_gradients(case, descent, exponent[regular])
        for i, unit in enumerate(starts[~regular]):
            objective = _NoisyObjective(case, Window(options.settle, options.turns, MAP_RTOL))
            path, means, _ = local.descend_by_fits(objective, unit, seed=options.seed)
            taken += objective.steps
            ends.append(path[-1:])
            growth = float(exponent[~regular][i])
            found.append(
                Refinement("fits", growth, _path(case, path), float(means[0]), float(means[-1]), {})
            )
            progress(steps + i + 1, 0)
    answer.steps["refinement"] = taken
    # Descents that meet need one confirmation.
    candidates = np.concatenate([best, *ends])
    _, first = np.unique(np.round(candidates, 4), axis=0, return_index=True)
    return candidates[np.sort(first)], replace(answer, refinement=tuple(found))


def _by_gradients(case: Case, descent: local.Descent, exponent: np.ndarray) -> list[Refinement]:
    widths = np.array([high - low for low, high in case.design.bounds.values()])
    found = []
    for i, growth in enumerate(exponent.tolist()):
        slopes = dict(zip(case.design.names, (descent.gradient[i] / widths).tolist(), strict=True))
        first, last = float(descent.values[0, i]), float(descent.values[-1, i])
        path = _path(case, descent.path[:, i])
        found.append(Refinement("gradient", growth, path, first, last, slopes))
    return found


def _path(case: Case, units: np.ndarray) -> dict[str, np.ndarray]:
    return {name: np.asarray(values) for name, values in case.design.values(units).items()}


class _NoisyObjective:
    """The judged objective of points with random starts, counting its integration steps."""

    def __init__(self, case: Case, window: Window):
        self.case, self.window, self.steps = case, window, 0

    def __call__(self, units: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """Values (m,) of points (m, n), each start shifted as its number says."""
        draws = [np.random.default_rng(number) for number in numbers]
        shifts = np.stack([rng.uniform(-SHIFT, SHIFT, 2) for rng in draws])
        values = np.full(len(units), np.nan)
        for part, rows in evaluate(self.case, units, self.window, shifts=shifts):
            values[part] = judged(rows)
            self.steps += int(rows["steps"].sum())
        return values


def settle_on(
    search: Search, answer: Answer, candidates: np.ndarray
) -> tuple[list[Confirmed], Confirmed]:
    """Independent long runs of the candidates and of the design to compare with."""
    case, options = search.case, search.options
    points = np.concatenate([candidates, case.design.unit(problem.reference(options))[None]])
    window = Window(LONGER * options.settle, LONGER * options.turns, CONFIRM_RTOL)
    with search.stage(answer, "confirmation", len(points) * options.runs) as progress:
        found = confirm(case, points, options.runs, window, options.seed, progress)
    answer.steps["confirmation"] = sum(
        int(runs.by_run["steps"].sum()) for one in found for runs in one.runs.values()
    )
    if np.isnan([one.objective for one in found[:-1]]).all():
        raise RuntimeError("no candidate survived its confirmation: failed, whirl or constraint")
    return found[:-1], found[-1]


def weigh(search: Search, answer: Answer, best: Confirmed, reference: Confirmed) -> Answer:
    """The answer with the slopes of the quiet motion at the best, with verdicts, and regimes.

    That of the best from both starts, and of the design to compare with from the centred one.
    """
    case, options = search.case, search.options

    def scene(start: str, numbers: dict[str, Any]) -> jc.Scene:
        return started({**case.design.fixed, **numbers}, start)

    def regime(design: Confirmed) -> jc.Regime:
        settle, turns, tangent_turns = REGIME
        motion = scene("centred", design.values)
        return jc.regime(motion, settle, turns, tangent_turns=tangent_turns)

    # Most of it is compilation, on one core a program.
    with search.stage(answer, "evidence", 3) as progress, ThreadPoolExecutor(1) as pool:
        slopes = pool.submit(
            jc.gradient_report,
            lambda **numbers: scene("contact", numbers),
            case.objective.outputs[0],
            best.values,
            settle_turns=options.settle,
            turns=options.turns,
        )
        kinds = []
        for design in (best, reference):
            kinds.append(_kept(regime(design)))
            progress(len(kinds), 3)
        found = slopes.result()
        progress(3, 3)
    quiet = _kept(found.regime)
    return replace(
        answer,
        optimum=replace(best, regime={"centred": kinds[0], "contact": quiet}),
        seed_choice=replace(reference, regime={"centred": kinds[1]}),
        gradient_report=replace(found, regime=quiet),
    )


def _kept(regime: jc.Regime) -> jc.Regime:
    """The verdict with its indicators, without the motion they are of."""
    return replace(regime, statistics=None, state=None)


def film(search: Search, answer: Answer, units: np.ndarray, data: xr.Dataset) -> xr.Dataset:
    """The motion of every point of the landscape after its window, for the page."""
    with search.stage(answer, "motions", data.objective.size) as progress:
        found, answer.steps["motions"] = cell_motions(search.case, units, data, MAP_RTOL, progress)
    return found
