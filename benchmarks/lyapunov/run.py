"""Exponents from tangents against those from a series alone.

The series' estimators are nolds' Rosenstein (`lyap_r`) and Eckmann (`lyap_e`) with their default
settings.
"""

import warnings
from pathlib import Path

import nolds
import numpy as np

import jaxcrusher as jc
from benchmarks.lyapunov.systems import SYSTEMS, iterate
from jaxcrusher.dynamics.indicators import Lyapunov, lyapunov_spectrum, zero_one_test
from jaxcrusher.files.progress import progress
from jaxcrusher.files.provenance import command
from jaxcrusher.files.results import results_folder, write_text

POINTS = 2000
TANGENT_TURNS = 150
SLICES = 8


def row(
    name: str,
    found: Lyapunov,
    interval: float,
    series: np.ndarray,
    strobe: np.ndarray,
    unit: str,
    reference: float | None,
) -> str:
    """A line of the table; `series` for nolds, `strobe` for the 0-1 test."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # nolds': too few neighbours, a poor fit
        rosenstein = float(np.asarray(nolds.lyap_r(series))) / interval
        eckmann = float(np.max(nolds.lyap_e(series))) / interval
    own, error = found.exponents[0] / interval, found.errors[0] / interval
    published = "" if reference is None else f"{reference:.4g}"
    return (
        f"| {name} | {unit} | {own:.4g} ± {error:.2g} | {published} | {rosenstein:.3g} | "
        f"{eckmann:.3g} | {zero_one_test(strobe):.2f} |"
    )


def crusher() -> str:
    """The chaotic crusher: 30 rad/s, 0.06 mm, the load on the closing stroke."""
    scene = jc.paper_scene(30.0, 0.06e-3, load_law="closing_stroke")
    section = jc.poincare_section(scene, 100, POINTS, rtol=1e-10)
    further = jc.poincare_section(
        scene, 0, TANGENT_TURNS, slices=SLICES, state=section.states[-1], rtol=1e-10
    )
    if not (bool(section.outcome.success) and bool(further.outcome.success)):
        raise RuntimeError("The crusher's motion failed.")
    found = lyapunov_spectrum(np.asarray(further.jacobians), slices=SLICES)
    series = np.asarray(section.states)[:, 0]
    return row("crusher, closing stroke", found, 1.0, series, series, "turn", None)


def run(out: Path) -> None:
    """Measure and write the table."""
    path, rows = results_folder(out) / "lyapunov.md", []
    with progress() as bars:
        bar = bars.add_task("exponents", total=len(SYSTEMS) + 1)
        for name, (step, start, interval, stride, unit, reference) in SYSTEMS.items():
            points, jacobians = iterate(step, start, stride * POINTS, 200)
            found = lyapunov_spectrum(jacobians)
            series = points[:POINTS, 0]
            rows.append(row(name, found, interval, series, points[::stride, 0], unit, reference))
            bars.advance(bar)
        rows.append(crusher())
        bars.advance(bar)
    write_text(path, _table(rows))
    print(path)


def _table(rows: list[str]) -> str:
    lines = [
        "# Lyapunov exponents",
        "",
        f"Made by `{command()}`; not edited by hand. Largest exponents, from the",
        f"tangents along {POINTS} points (Lorenz: {10 * POINTS} samples of 0.05; crusher: "
        f"{TANGENT_TURNS} turns)",
        "with standard errors by batch means, against the published ones and against two",
        f"estimators that see one coordinate of {POINTS} samples only: nolds' `lyap_r`",
        "(Rosenstein) and `lyap_e` (Eckmann), default settings. K is the 0-1 test, near 1 for",
        "chaos. The crusher: 30 rad/s, 0.06 mm, load on the closing stroke, e_x once a turn.",
        "",
        "| system | per | from tangents | published | nolds lyap_r | nolds lyap_e | K |",
        "|---|---|---|---|---|---|---|",
        *rows,
        "",
        "An estimator that has only a series cannot see a growth of e^7 a turn: two points that",
        "are near at one turn are anywhere at the next.",
    ]
    return "\n".join(lines) + "\n"
