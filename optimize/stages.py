"""The stages of a search, each with its seconds and integration steps in the result."""

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from rich.progress import Progress as Bars

import jaxcrusher as jc
from jaxcrusher.files.provenance import provenance
from jaxcrusher.files.results import write_netcdf
from optimize import confirm, landscape, local, problem
from optimize.evaluate import STARTS, Case, Window, evaluate, judged, started
from optimize.motions import cell_motions
from optimize.options import Options

# Tolerances of the landscape with its exponents and motions, and of the confirmation, in
# clearances.
MAP_RTOL, CONFIRM_RTOL = 1e-6, 1e-8
# Confirmation runs last this many times longer than the landscape's.
LONGER = 3
# Turns of the regime of the few designs that matter: settling, section points, exponents.
REGIME = (60, 200, 20)


@contextmanager
def stage(result: dict, name: str) -> Iterator[None]:
    """Books the seconds of a stage."""
    began = time.perf_counter()
    yield
    result["seconds"][name] = time.perf_counter() - began


def explore(
    case: Case, options: Options, units: np.ndarray, folder: Path, bars: Bars, result: dict
) -> xr.Dataset:
    """The landscape of `units` with its exponents, written after every chunk."""
    window = Window(options.settle, options.turns, MAP_RTOL)
    bar = bars.add_task("landscape", total=len(units))
    attributes = provenance(
        "Landscape of a design search",
        scene={**jc.PE250X400, **case.design.fixed},
        box=problem.box(options),
        settle_turns=window.settle,
        turns=window.turns,
        rtol=window.rtol,
    )
    data = xr.Dataset()
    with stage(result, "landscape"):
        for done, data in landscape.mapped(case, units, options.grid, window):
            data.attrs = attributes
            write_netcdf(folder / "landscape.nc", data)
            bars.update(bar, completed=done)
    result["steps"]["landscape"] = int(data.steps.sum())
    bar = bars.add_task("regimes", total=len(STARTS) * len(units))
    with stage(result, "regimes"):
        largest, steps = landscape.exponents(
            case,
            units,
            options.settle,
            MAP_RTOL,
            lambda done, _: bars.update(bar, completed=done),
        )
    result["steps"]["regimes"] = steps
    data["exponent"] = data.objective.copy(data=largest.reshape(data.objective.shape))
    data.exponent.attrs = {"units": "1", "long_name": "largest Lyapunov exponent, a turn"}
    write_netcdf(folder / "landscape.nc", data)
    return data


def descend(
    case: Case, options: Options, units: np.ndarray, data: xr.Dataset, bars: Bars, result: dict
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Local descents from the best of `units`, the landscape's points, and from random ones.

    Returns the candidates (m, n), the best points of the landscape first, and all paths, each
    of shape (points, n).
    """
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
    summary = [
        {"start": case.design.values(unit), "exponent": value, "by": "gradient" if g else "fits"}
        for unit, value, g in zip(starts, exponent, regular, strict=True)
    ]
    paths: list[np.ndarray] = []
    with stage(result, "refinement"):
        result["refinement"] = {"runs": summary}
        result["steps"]["refinement"] = 0
        if regular.any():
            bar = bars.add_task("gradient descent", total=options.steps)
            descent = local.descend_by_gradients(
                case, starts[regular], options.steps, lambda n, _: bars.update(bar, completed=n)
            )
            result["steps"]["refinement"] += descent.steps
            paths += list(np.moveaxis(descent.path, 1, 0))
            result["refinement"] |= _gradients(case, descent)
        for unit in starts[~regular]:
            bar = bars.add_task("descent by fits", total=None)
            objective = _NoisyObjective(case, Window(options.settle, options.turns, MAP_RTOL))
            path, _, _ = local.descend_by_fits(objective, unit, seed=options.seed)
            result["steps"]["refinement"] += objective.steps
            paths.append(path)
            bars.update(bar, total=1, completed=1)
    ends = np.stack([path[-1] for path in paths])
    # Descents that meet need one confirmation.
    _, first = np.unique(np.round(np.concatenate([best, ends]), 4), axis=0, return_index=True)
    return np.concatenate([best, ends])[np.sort(first)], paths


class _NoisyObjective:
    """The judged objective of points with random starts, counting its integration steps."""

    def __init__(self, case: Case, window: Window):
        self.case, self.window, self.steps = case, window, 0

    def __call__(self, units: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """Values (m,) of points (m, n), each start shifted as its number says."""
        draws = [np.random.default_rng(number) for number in numbers]
        shifts = np.stack([rng.uniform(-confirm.SHIFT, confirm.SHIFT, 2) for rng in draws])
        values = np.full(len(units), np.nan)
        for part, rows in evaluate(self.case, units, self.window, shifts=shifts):
            values[part] = judged(rows)
            self.steps += int(rows["steps"].sum())
        return values


def _gradients(case: Case, descent: local.Descent) -> dict[str, Any]:
    """First and last quiet objective, and the gradient at the best end, in SI units."""
    best = int(np.nanargmin(descent.values[-1]))
    widths = [high - low for low, high in case.design.bounds.values()]
    slopes = descent.gradient[best] / widths
    return {
        "quiet_first": descent.values[0],
        "quiet_last": descent.values[-1],
        "gradient_at_best": dict(zip(case.design.names, slopes, strict=True)),
    }


def settle_on(
    case: Case, options: Options, candidates: np.ndarray, bars: Bars, result: dict
) -> tuple[list[confirm.Confirmed], confirm.Confirmed]:
    """Independent long runs of the candidates and of the design to compare with."""
    reference = case.design.unit(problem.reference(options))
    window = Window(LONGER * options.settle, LONGER * options.turns, CONFIRM_RTOL)
    bar = bars.add_task("confirmation", total=(len(candidates) + 1) * options.runs)
    with stage(result, "confirmation"):
        found = confirm.confirm(
            case,
            np.concatenate([candidates, reference[None]]),
            options.runs,
            window,
            options.seed,
            lambda done, _: bars.update(bar, completed=done),
        )
    result["steps"]["confirmation"] = sum(int(one.rows["steps"].sum()) for one in found)
    if not any(one.counts for one in found[:-1]):
        raise RuntimeError("no candidate survived its confirmation: failed, whirl or constraint")
    return found[:-1], found[-1]


def evidence(
    case: Case, options: Options, best: np.ndarray, reference: np.ndarray, bars: Bars, result: dict
) -> None:
    """The slopes of the quiet motion at the best, with verdicts, and regimes.

    That of the best from both starts, and of the design to compare with from the centred one.
    """
    bar = bars.add_task("evidence", total=3)

    def scene(start: str, numbers: dict[str, Any]) -> jc.Scene:
        return started({**case.design.fixed, **numbers}, start)

    def regime(unit: np.ndarray) -> jc.Regime:
        settle, turns, tangent_turns = REGIME
        motion = scene("centred", case.design.numbers(unit))
        found = jc.regime(motion, settle, turns, tangent_turns=tangent_turns)
        bars.advance(bar)
        return found

    # Most of it is compilation, on one core a program.
    with stage(result, "evidence"), ThreadPoolExecutor(1) as pool:
        slopes = pool.submit(
            jc.gradient_report,
            lambda **numbers: scene("contact", numbers),
            case.objective.outputs[0],
            case.design.numbers(best),
            settle_turns=options.settle,
            turns=options.turns,
        )
        kinds = {
            (name, "centred"): regime(unit)
            for name, unit in (("optimum", best), ("seed_choice", reference))
        }
        found = slopes.result()
        bars.advance(bar)
    kinds["optimum", "contact"] = found.regime
    result["gradient_report"] = {
        "metric": found.metric,
        "exponent_x_horizon": found.growth,
        "slopes": {
            name: {
                "value": slope.value,
                "standard_error": slope.standard_error,
                "estimator": slope.estimator,
                "verdict": slope.verdict,
                "reasons": slope.reasons,
                "estimates": slope.estimates,
            }
            for name, slope in found.slopes.items()
        },
    }
    for (name, start), kind in kinds.items():
        regimes = result[name].setdefault("regime", {})
        regimes[start] = {"name": kind.name, "period": kind.period, "evidence": kind.evidence}


def film(case: Case, options: Options, data: xr.Dataset, bars: Bars, result: dict) -> xr.Dataset:
    """The motion of every point of the landscape, for the page."""
    bar = bars.add_task("motions", total=len(STARTS) * data.objective[0].size)
    with stage(result, "motions"):
        return cell_motions(
            case, data, options.settle, MAP_RTOL, lambda done, _: bars.update(bar, completed=done)
        )
