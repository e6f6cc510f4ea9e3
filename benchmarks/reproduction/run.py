"""The paper's figures, redrawn, and its numbers, checked."""

from collections.abc import Callable
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import jaxcrusher as jc
from benchmarks.pages import publish
from benchmarks.reproduction import figures, readings
from benchmarks.reproduction.claims import Evidence, claims
from benchmarks.reproduction.motions import compare, portraits
from benchmarks.reproduction.tables import reading_rows, tables
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import results_folder, write_table

TURN = 2 * np.pi / 30  # s
SPEEDS = np.linspace(25, 40, 11)  # rad/s
# Figure, what it shows, and its clearances: the largest (m) and how many from 0.03 mm.
BOXES = ((14, "foundation_rms", 0.12e-3, 10), (15, "foundation_peak", 0.06e-3, 7))


def run(out: Path) -> None:
    """Draw everything, and judge every claim."""
    results_folder(out)
    with progress(remaining=False) as bars, plt.rc_context(figures.STYLE):

        def stage(title: str, total: int) -> Callable[..., None]:
            task = bars.add_task(title, total=total)
            return lambda *what: bars.advance(task)

        draw_validation(out, stage("Figures 5 and 7", 3))
        draw_motions(out, stage("Figures 8 to 13 and 16", 3))
        boxes = []
        for figure, variable, largest, count in BOXES:
            cells = bars.add_task(f"Figure {figure}", total=count * len(SPEEDS))
            box = jc.sweep(
                jc.paper_machine(),
                {"speed": SPEEDS, "clearance": np.linspace(0.03e-3, largest, count)},
                20,
                12,
                rtol=1e-6,
                chunk=22,
                progress=lambda finished, _, task=cells: bars.update(task, completed=finished),
            )
            settled = jc.orbit_map(
                jc.paper_machine(),
                {
                    "speed": np.linspace(25, 40, 61),
                    "clearance": np.linspace(0.03e-3, largest, 2 * count - 1),
                },
            )
            figures.draw_landscape(
                out / f"fig{figure}.png", box[variable], settled[variable].where(settled.stable)
            )
            boxes.append(box)
        programs = len({(r.slip, r.impact_law, r.load_law, r.settle) for r in readings.READINGS})
        measured = readings.measure(readings.READINGS, done=stage("Readings", programs))
        evidence = Evidence(measured, *boxes)
    write_table(out / "readings.csv", reading_rows(claims(), evidence))
    publish(out, "reproduction/claims.md", tables(claims(), evidence), "exudyn")


def draw_validation(out: Path, done: Callable[..., None]) -> None:
    """Figures 5 and 7."""
    turn = compare("contact", TURN, 2e-6)
    done()
    figures.draw_comparison(out / "fig05.png", turn, compare("centred", 0.03, 1e-6))
    done()
    times = np.linspace(0, 2 * TURN, 2001)
    strokes = {}
    for clearance in (0.06, 0.12):
        scene = jc.paper_scene(30.0, 1e-3 * clearance)
        motion = jc.simulate(scene, times, outputs=("jaw_position",), rtol=1e-8)
        strokes[clearance] = np.asarray(motion.jaw_displacement)[:, 0]
    figures.draw_stroke(out / "fig07a.png", times, strokes)
    figures.draw_capacity(out / "fig07b.png")
    done()


def draw_motions(out: Path, done: Callable[..., None]) -> None:
    """Figures 8 to 13 and 16."""
    rows = {}
    for slip in ("centre", "surface"):
        rows[f"{slip} slip"] = portraits(readings.POINTS, slip)
        done()
    for first, points in ((8, readings.SPEED_POINTS), (11, readings.CLEARANCE_POINTS)):
        shown = {name: {p: motions[p] for p in points} for name, motions in rows.items()}
        for i, draw in enumerate((figures.orbit, figures.foundation, figures.section)):
            figures.draw_row(out / f"fig{first + i:02d}.png", draw, shown)
    figures.draw_choice(
        out / "fig16.png", {name: motions[readings.CHOICE] for name, motions in rows.items()}
    )
    done()
