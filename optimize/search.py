"""The whole search: its stages, and what result.json holds of their answers."""

import numpy as np
from rich.console import Console

import jaxcrusher as jc
from jaxcrusher.files.progress import progress
from jaxcrusher.files.provenance import command, versions
from jaxcrusher.files.results import results_folder, write_json
from optimize import landscape, problem, report, stages, verdicts
from optimize.confirm import Confirmed
from optimize.evaluate import STARTS, Case
from optimize.options import Options
from optimize.page.document import write_page


def run(options: Options, console: Console) -> dict:
    """The whole search; returns what result.json holds. Each stage is written as it ends."""
    problem.check(options)
    case, folder = problem.case(options), results_folder(options.folder)
    result: dict = {
        "status": "interrupted",
        "command": command(),
        "versions": versions("optax"),
        "objective": {
            "name": options.objective,
            "unit": case.objective.unit,
            "meaning": case.objective.meaning,
        },
        "box": problem.box(options),
        "fixed": dict(case.design.fixed),
        "seed": options.seed,
        "seconds": {},
        "steps": {},
    }
    units = landscape.points(case.design, options.grid, options.samples, options.seed)
    explored = None
    try:
        with progress(console) as bars:
            explored = data = stages.explore(case, options, units, folder, bars, result)
            candidates, paths = stages.descend(case, options, units, data, bars, result)
            confirmed, reference = stages.settle_on(case, options, candidates, bars, result)
            best = confirmed[int(np.nanargmin([one.value for one in confirmed]))]
            result["optimum"] = _entry(case, best)
            result["seed_choice"] = _entry(case, reference)
            result["ideal"] = {"foundation_rms": result["optimum"]["ideal_rms"]}
            result["grid_best"] = _brief(case, confirmed[0])
            result["candidates"] = [_brief(case, one) for one in confirmed]
            result["claim"] = verdicts.claim(data, best, confirmed[0])
            stages.evidence(case, options, best.unit, reference.unit, bars, result)
            motions = stages.film(case, options, data, bars, result)
        result["checks"] = verdicts.checks(result, case, options, best)
        result["remark"] = verdicts.remark(result, case, options)
        result["status"] = "finished"
    finally:
        write_json(folder / "result.json", result)
        if result["status"] != "finished":
            write_page(folder, result, explored, None)
    drawn = report.draw_all(folder, case, options, units, data, paths, result)
    write_page(folder, result, data, motions, drawn)
    report.print_table(console, result)
    console.print(f"results in {folder}/")
    return result


def _entry(case: Case, one: Confirmed) -> dict:
    """All that result.json holds of a confirmed design."""
    described = {**case.design.fixed, **case.design.numbers(one.unit)}
    ideal = jc.statistics(jc.build_scene(described).ideal(), 0, 1, outputs=("foundation_rms",))
    complete = {**jc.PE250X400, **described}
    return _brief(case, one) | {
        "speed": float(complete["speed"]),
        "clearance": float(complete["clearance"]),
        "foundation_rms": float(one.rows["foundation_rms"].mean(axis=1).max()),
        "ideal_rms": float(np.asarray(ideal.foundation_rms)),
        "capacity": float(case.capacity(one.unit)),
        "runs": {
            start: _run(one, i, float(complete["restitution"])) for i, start in enumerate(STARTS)
        },
    }


def _brief(case: Case, one: Confirmed) -> dict:
    """A design's numbers and what it is judged by."""
    return {
        "values": case.design.numbers(one.unit),
        "objective": one.value,
        "half_width": one.error,
        "worse_start": STARTS[one.worse],
    }


def _run(one: Confirmed, start: int, restitution: float) -> dict:
    """The unshifted run from one start, and the interval of the objective over all runs."""
    row = one.first(start)
    limits = ("half_width_ratio", "impact_speed_ratio", "delivered_restitution")
    return row | {
        "validity": {name: row[name] for name in limits} | {"asked_restitution": restitution},
        "runs": one.rows["objective"].shape[1],
        "objective_mean": one.mean(start),
        "objective_half_width": one.half_width(start),
    }
