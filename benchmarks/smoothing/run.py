"""The error of each smoothing width, against its run time."""

from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

import jaxcrusher as jc
from benchmarks.pages import publish, table
from benchmarks.peers import scipy_peer
from benchmarks.peers.equations import Crusher
from benchmarks.peers.motion import Motion
from benchmarks.timing import timed
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import results_folder
from jaxcrusher.pictures.page import WIDTH, plain_powers

TIMES = 1e-5 * np.arange(2001)
OUTPUTS = ("normal_force", "friction_force", "eccentricity")
# Name -> where it is in a scene, its unit, its values, and a speed (rad/s) at which it matters:
# at 30 rad/s surfaces slip at 3.9 m/s, far beyond the ramp; at 7.7 at its upper corner, 1 m/s.
WIDTHS = {
    "contact corner": (lambda s: s.joint.normal.width, "m", 10.0 ** np.arange(-12, -5), 30.0),
    "friction ramp": (lambda s: s.joint.friction.width, "m/s", 10.0 ** np.arange(-6, 0), 7.7),
    "length of e": (lambda s: s.joint.norm_width, "m", 10.0 ** np.arange(-12, -5), 30.0),
}


class Row(NamedTuple):
    """A width; `reference_error` is that of the reference against a looser run, relative."""

    name: str
    width: float
    error: float  # largest of the contact force, over its largest value
    seconds: float
    reference_error: float


def reference(speed: float) -> tuple[np.ndarray, float]:
    """Return the contact force (N) at TIMES without smoothing, and its own error."""
    motion = Motion(Crusher(friction=0.1, speed=speed))
    fine, coarse = (
        motion.observe(TIMES, scipy_peer.integrate(motion, TIMES, rtol=rtol))["contact_force"]
        for rtol in (1e-12, 1e-11)
    )
    return fine, float(np.abs(fine - coarse).max() / fine.max())


def run(out: Path) -> None:
    """Measure every width with the others at their defaults; write the page and the figure."""
    folder, rows = results_folder(out), []
    with progress() as bars:
        for name, (where, _, widths, speed) in WIDTHS.items():
            exact, own = reference(speed)
            scene = jc.paper_scene(speed, 0.06e-3, slip="surface")
            for width in bars.track(widths, description=name):
                one = eqx.tree_at(where, scene, jnp.array(width))
                _, again, motion = timed(lambda one=one: jc.simulate(one, TIMES, outputs=OUTPUTS))
                if not bool(motion.success):
                    raise RuntimeError(motion.failure)
                force = np.hypot(motion.normal_force, motion.friction_force)
                error = float(np.abs(force - exact).max() / exact.max())
                rows.append(Row(name, float(width), error, again.wall, own))
    data, tables = [row._asdict() for row in rows], {"widths": widths_table(rows)}
    publish(folder, "smoothing.md", tables, "scipy", rows=data, draw=lambda: draw(rows))


def default(name: str) -> float:
    """Return the width that scenes have."""
    return float(WIDTHS[name][0](jc.paper_scene(30.0, 0.06e-3)))


def widths_table(rows: list[Row]) -> str:
    """Return the table of all widths; times are in units of the default's."""
    cells = []
    for name, (_, unit, _, speed) in WIDTHS.items():
        mine = [row for row in rows if row.name == name]
        usual = next(row for row in mine if np.isclose(row.width, default(name), atol=0))
        for row in mine:
            label = f"**{name}** (default)" if row is usual else name
            ratio = f"{row.seconds / usual.seconds:.2f}"
            cells.append(
                [label, f"{row.width:.0e} {unit}", f"{speed:g}", f"{row.error:.1e}", ratio]
            )
    return table(("width", "value", "at rad/s", "error", "time / default's"), cells)


def draw(rows: list[Row]) -> Figure:
    """Draw the error over each width."""
    fig, axes = plt.subplots(
        1, len(WIDTHS), figsize=(WIDTH, 3.4), layout="constrained", sharey=True
    )
    own = max(row.reference_error for row in rows)
    for ax, (name, (_, unit, _, speed)) in zip(axes, WIDTHS.items(), strict=True):
        mine = [row for row in rows if row.name == name]
        ax.loglog([r.width for r in mine], [r.error for r in mine], "o-", color="C0", label="error")
        ax.axvline(default(name), color="C1", linestyle="--", label="default")
        ax.axhline(own, color="0.5", linestyle=":", label="reference's own error")
        ax.set(xlabel=f"width ({unit})", title=f"{name}, {speed:g} rad/s")
        plain_powers(ax)
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("largest error of the contact force")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return fig
