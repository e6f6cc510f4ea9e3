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
from benchmarks.pages import publish, table
from jaxcrusher.dynamics.indicators import Lyapunov, lyapunov_spectrum, zero_one_test
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import results_folder

POINTS = 2000
TANGENT_TURNS = 150
SLICES = 8
HEADINGS = ("system", "per", "from tangents", "published", "nolds lyap_r", "nolds lyap_e", "K")


def row(
    name: str,
    unit: str,
    found: Lyapunov,
    interval: float,
    series: np.ndarray,
    strobe: np.ndarray,
    published: str = "",
) -> list[str]:
    """Return a line of the table; `series` is for nolds, `strobe` for the 0-1 test."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # nolds': too few neighbours, a poor fit
        rosenstein = float(np.asarray(nolds.lyap_r(series))) / interval
        eckmann = float(np.max(nolds.lyap_e(series))) / interval
    own = f"{found.exponents[0] / interval:.4g} ± {found.errors[0] / interval:.2g}"
    others = f"{rosenstein:.3g}", f"{eckmann:.3g}", f"{zero_one_test(strobe):.2f}"
    return [name, unit, own, published, *others]


def crusher() -> list[str]:
    """Return the line of the chaotic crusher: 30 rad/s, 0.06 mm, load on the closing stroke."""
    scene = jc.paper_scene(30.0, 0.06e-3, load_law="closing_stroke")
    section = jc.poincare_section(scene, 100, POINTS, rtol=1e-10)
    further = jc.poincare_section(
        scene, 0, TANGENT_TURNS, slices=SLICES, state=section.states[-1], rtol=1e-10
    )
    if not (bool(section.outcome.success) and bool(further.outcome.success)):
        raise RuntimeError("The crusher's motion failed.")
    found = lyapunov_spectrum(np.asarray(further.jacobians), slices=SLICES)
    series = np.asarray(section.states)[:, 0]
    return row("crusher, closing stroke", "turn", found, 1.0, series, series)


def run(out: Path) -> None:
    """Measure and write the page."""
    folder, rows = results_folder(out), []
    with progress() as bars:
        for name, (step, start, interval, stride, unit, known) in bars.track(SYSTEMS.items()):
            points, jacobians = iterate(step, start, stride * POINTS, 200)
            found, series = lyapunov_spectrum(jacobians), points[:POINTS, 0]
            strobe = points[::stride, 0]
            rows.append(row(name, unit, found, interval, series, strobe, f"{known:.4g}"))
        rows.append(crusher())
    publish(folder, "lyapunov.md", {"exponents": table(HEADINGS, rows)}, "nolds")
