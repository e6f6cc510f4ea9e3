"""The error of each smoothing width, against its run time."""

import time
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

import jaxcrusher as jc
from benchmarks.peers import scipy_peer
from benchmarks.peers.equations import Crusher
from benchmarks.peers.motion import Motion
from jaxcrusher.files.progress import progress
from jaxcrusher.files.provenance import command
from jaxcrusher.files.results import results_folder, write_figure, write_text
from jaxcrusher.pictures.page import STYLE, WIDTH, plain_powers

TIMES = 1e-5 * np.arange(2001)
OUTPUTS = ("normal_force", "friction_force", "eccentricity")
# Name -> where it is in a scene, its unit, its values, and a speed (rad/s) at which it matters:
# at 30 rad/s surfaces slip at 3.9 m/s, far beyond the ramp; at 7.7 at its upper corner, 1 m/s.
WIDTHS = {
    "contact corner": (lambda s: s.joint.normal.width, "m", 10.0 ** np.arange(-12, -5), 30.0),
    "friction ramp": (lambda s: s.joint.friction.width, "m/s", 10.0 ** np.arange(-6, 0), 7.7),
    "length of e": (lambda s: s.joint.norm_width, "m", 10.0 ** np.arange(-12, -5), 30.0),
}
RUNS = 5


def reference(speed: float) -> tuple[np.ndarray, float]:
    """The unsmoothed contact force (N) at TIMES, and its own error against a looser run."""
    motion = Motion(Crusher(friction=0.1, speed=speed))
    fine, coarse = (
        motion.observe(TIMES, scipy_peer.integrate(motion, TIMES, rtol=rtol))["contact_force"]
        for rtol in (1e-12, 1e-11)
    )
    return fine, float(np.abs(fine - coarse).max() / fine.max())


def measure(scene: jc.Scene, exact: np.ndarray) -> tuple[float, float]:
    """Largest error of the contact force over its largest value, and seconds (median) of a run."""

    def once():
        motion = jc.simulate(scene, TIMES, outputs=OUTPUTS)
        return jax.block_until_ready(motion)

    motion, seconds = once(), []
    if not bool(motion.success):
        raise RuntimeError(motion.failure)
    for _ in range(RUNS):
        began = time.perf_counter()
        once()
        seconds.append(time.perf_counter() - began)
    force = np.hypot(motion.normal_force, motion.friction_force)
    return float(np.abs(force - exact).max() / exact.max()), float(np.median(seconds))


def run(out: Path) -> None:
    """Measure every width with the others at their defaults; write the table and the figure."""
    folder, rows, own = results_folder(out), {}, 0.0
    with progress() as bars:
        for name, (where, _, widths, speed) in WIDTHS.items():
            exact, error = reference(speed)
            own = max(own, error)
            scene = jc.paper_scene(speed, 0.06e-3, slip="surface")
            measure(scene, exact)  # compiles
            changed = [eqx.tree_at(where, scene, jnp.array(width)) for width in widths]
            rows[name] = [measure(one, exact) for one in bars.track(changed, description=name)]
    write_text(folder / "smoothing.md", _table(rows, own))
    with plt.rc_context(STYLE):
        write_figure(folder / "smoothing.png", _draw(rows, own))
    print(f"{folder / 'smoothing.md'}, {folder / 'smoothing.png'}")


def default(name: str) -> float:
    """The width that scenes have."""
    return float(WIDTHS[name][0](jc.paper_scene(30.0, 0.06e-3)))


def _table(rows: dict, own: float) -> str:
    lines = [
        "# Smoothing",
        "",
        f"Made by `{command()}`; not edited by hand. Error: the largest",
        "difference of the contact force over 20 ms of impacts (centred start, surface slip,",
        "0.06 mm) from SciPy's DOP853 on the laws without smoothing, over its largest value. Time:",
        "that of a run against the default's. One width is changed at a time.",
        "",
        f"The reference agrees with a run at ten times its tolerance to {own:.1e}. What is left",
        "where a width no longer matters is the integration's own error at the default tolerance.",
        "The defaults are the largest widths (powers of ten) that stay about there: smaller ones",
        "buy nothing, larger ones save no time.",
        "",
        "| width | value | at rad/s | error | time / default's |",
        "|---|---|---|---|---|",
    ]
    for name, (_, unit, widths, speed) in WIDTHS.items():
        usual = np.isclose(widths, default(name), atol=0)
        base = rows[name][int(np.flatnonzero(usual)[0])][1]
        for width, (apart, seconds), mark in zip(widths, rows[name], usual, strict=True):
            label = f"**{name}** (default)" if mark else name
            lines.append(
                f"| {label} | {width:.0e} {unit} | {speed:g} | {apart:.1e} | {seconds / base:.2f} |"
            )
    return "\n".join(lines) + "\n"


def _draw(rows: dict, own: float) -> Figure:
    fig, axes = plt.subplots(
        1, len(WIDTHS), figsize=(WIDTH, 3.4), layout="constrained", sharey=True
    )
    for ax, (name, (_, unit, widths, speed)) in zip(axes, WIDTHS.items(), strict=True):
        ax.loglog(widths, [error for error, _ in rows[name]], "o-", color="C0", label="error")
        ax.axvline(default(name), color="C1", linestyle="--", label="default")
        ax.axhline(own, color="0.5", linestyle=":", label="reference's own error")
        ax.set(xlabel=f"width ({unit})", title=f"{name}, {speed:g} rad/s")
        plain_powers(ax)
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("largest error of the contact force")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return fig
