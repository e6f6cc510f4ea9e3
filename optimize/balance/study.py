"""The stages of the design study, each written as it ends."""

import time
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import Progress

from jaxcrusher.files.progress import progress
from jaxcrusher.files.provenance import command, versions
from jaxcrusher.files.results import results_folder, write_json, write_text
from jaxcrusher.files.resume import earlier
from jaxcrusher.scenes.build import build_chamber
from optimize.balance import evidence, figure, problem, report
from optimize.balance import objective as orbit_force
from optimize.balance.compare import METHODS, Answer, Search, Smooth, require_rivals, search
from optimize.balance.options import Options
from optimize.design import Design

# Gradients of the robust search at most; it starts at the optimum, and ends far earlier.
ROBUST_GRADIENTS = 40
# Random points for each start at most; hardly any fails.
MOST_DRAWS = 20


class Study:
    """A study in its folder: what was finished is written, and not done again."""

    def __init__(self, options: Options):
        problem.check(options)
        require_rivals()
        self.options, self.folder = options, results_folder(options.folder)
        self.path = self.folder / "result.json"
        settings = problem.settings(options)
        self.result: dict[str, Any] = earlier(self.path, settings, "name") or {
            "status": "interrupted",
            "command": command(),
            "versions": versions("scipy", "cma", "Py-BOBYQA"),
            "settings": settings,
            "seconds": {},
            "searches": [],
        }

    def write(self) -> None:
        """At once or not at all."""
        write_json(self.path, self.result)

    def stage(self, name: str, work: Callable[[], Any]) -> Any:
        """The result of a stage, done now or found."""
        if self.result.get(name) is None:
            began = time.perf_counter()
            self.result[name] = work()
            self.result["seconds"][name] = time.perf_counter() - began
            self.write()
        return self.result[name]


def run(options: Options, console: Console) -> dict:
    """The whole study; returns what result.json holds."""
    study = Study(options)
    result = study.result
    if result["status"] == "finished":
        console.print(f"finished earlier: {study.path} (delete it to do it again)")
        report.print_tables(console, result)
        return result
    if result["searches"]:
        console.print(f"going on: {len(result['searches'])} searches found in {study.path}")
    design = problem.design(options)
    first = design.unit(problem.reference(options))
    with progress(console, remaining=False) as bars:
        _searches(study, design, first, bars)
        best = min(
            (found for found in result["searches"] if found["best"]),
            key=lambda found: found["best"][-1],
            default=None,
        )
        if best is None:
            raise RuntimeError("no search found a design with a number: all motions failed")
        points = {problem.title(options): first, "optimised": np.array(best["point"])}
        bar = bars.add_task("robust design", total=ROBUST_GRADIENTS)
        robust = study.stage(
            "robust", lambda: _robust(options, design, points, lambda: bars.advance(bar))
        )
        bars.update(bar, completed=ROBUST_GRADIENTS)
        points["robust"] = np.array(robust["point"])
        bar = bars.add_task("evidence", total=3)
        study.stage("long_runs", lambda: evidence.confirm(design, points, options.settle))
        bars.advance(bar)
        turn = evidence.histories(design, points, options.settle)
        study.stage("figures", lambda: {n: evidence.figures(turn[n]) for n in points})
        bars.advance(bar)
        study.stage("designs", lambda: _designs(design, points))
        bars.advance(bar)
    picture = study.folder / f"{options.name}.png"
    figure.draw(picture, result, turn)
    write_text(study.folder / f"{options.name}.md", report.markdown(result, picture.name))
    result["status"] = "finished"
    study.write()
    report.print_tables(console, result)
    console.print(f"results in {study.folder}/")
    return result


def _searches(study: Study, design: Design, first: np.ndarray, bars: Progress) -> None:
    """Every method from every start; written as each ends."""
    options, result = study.options, study.result
    done = {(found["method"], found["start"]) for found in result["searches"]}
    total = options.starts * len(METHODS)
    bar = bars.add_task("searches", total=total, completed=len(done))
    if len(done) == total:
        return
    began = time.perf_counter()
    objective, scale = orbit_force.orbit_objective(design, problem.conditions(options), first)
    # A study that goes on keeps the costs it began with: every search has the same budget.
    cost = result.setdefault(
        "cost",
        {
            "scale": scale,
            "value_seconds": objective.value_seconds,
            "gradient_seconds": objective.gradient_seconds,
        },
    )
    objective = Smooth(
        objective.value, objective.gradient, cost["value_seconds"], cost["gradient_seconds"]
    )
    result["seconds"]["compilation"] = time.perf_counter() - began
    for number, start in enumerate(_starts(objective, options, len(first))):
        for method in METHODS:
            if (method, number) in done:
                continue
            found: Search = search(method, objective, start, options.budget, number)
            result["searches"].append(asdict(found))
            study.write()
            bars.advance(bar)


def _starts(objective: Smooth, options: Options, dimension: int) -> list[np.ndarray]:
    """Random machines that move: from links that do not close no slope leads anywhere."""
    generator, found = np.random.default_rng(options.seed), []
    for _ in range(MOST_DRAWS * options.starts):
        point = generator.uniform(size=dimension)
        if np.isfinite(objective.value(point).value):
            found.append(point)
        if len(found) == options.starts:
            return found
    raise RuntimeError(
        f"only {len(found)} of {MOST_DRAWS * options.starts} random machines have a periodic orbit"
    )


def _robust(
    options: Options, design: Design, points: dict[str, np.ndarray], advance: Callable[[], None]
) -> dict[str, Any]:
    """The design of least mean + sigmas * spread, and the spread of all three."""
    middle = problem.conditions(options)
    widths = dict(zip(problem.CONDITIONS, options.tolerance, strict=True))
    conditions = orbit_force.tolerances(middle, widths, options.samples, options.seed)

    def sampled(point: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return orbit_force.sampled(point, conditions, design)

    scale = float(sampled(next(iter(points.values())))[0].mean())

    def gradient(point: np.ndarray) -> Answer:
        advance()
        rms, slopes, _ = sampled(point)
        value, slope = orbit_force.mean_and_spread(rms, slopes, options.sigmas)
        return Answer(value / scale, 0, slope / scale)

    objective = Smooth(gradient, gradient, 1.0, 1.0)
    found = search("L-BFGS-B", objective, points["optimised"], ROBUST_GRADIENTS)
    # From the optimum at the middle of the tolerances; where that has no number, there it stays.
    point = np.array(found.point or points["optimised"])
    forces = {name: sampled(p) for name, p in {**points, "robust": point}.items()}
    return {
        "point": point.tolist(),
        "gradients": found.evaluations,
        "conditions": {name: column.tolist() for name, column in conditions.items()},
        "values": {name: rms.tolist() for name, (rms, _, _) in forces.items()},
        "shaking": {name: column.tolist() for name, (_, _, column) in forces.items()},
    }


def _designs(design: Design, points: dict[str, np.ndarray]) -> dict[str, Any]:
    """The numbers of the designs, and what their forces are made of."""
    chosen = {}
    origins = evidence.origins(design, points)
    for name, point in points.items():
        described = design.description(point)
        chosen[name] = {
            "point": point.tolist(),
            "values": design.numbers(point),
            "eccentricity": float(described["shaft.eccentricity"]),
            "counterweight_mass": float(described["counterweight.mass"]),
            "counterweight_angle": float(described["counterweight.angle"]),
            "capacity": float(build_chamber(described).capacity(described["speed"])),
            **origins[name],
        }
    return {"bounds": {name: list(b) for name, b in design.bounds.items()}, "chosen": chosen}
