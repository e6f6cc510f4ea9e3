"""The slider-crank against EXUDYN and SciPy, its limits, and the field's figures."""

from pathlib import Path

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from benchmarks.peers.exudyn_slider_crank import Numbers, by_exudyn, by_scipy
from benchmarks.slider_crank.mechanism import flores, joint_load, simulate
from jaxcrusher.files.results import results_folder, write_figure
from jaxcrusher.joint.normal import ConstantImpactVelocity
from jaxcrusher.joint.validity import validity


def compare(impact_velocity: float | None) -> None:
    """Print the first impacts by three programs, and until when the motions agree.

    `impact_velocity` (m/s) None is each impact's own, else one for all.
    """
    numbers, times = Numbers(), np.arange(0, 4e-3, 1e-6)
    law, title = None, "each impact's own velocity"
    if impact_velocity is not None:
        # No impact is as fast: EXUDYN's and SciPy's least one is then that of all.
        numbers = Numbers(least_impact_velocity=impact_velocity)
        law, title = ConstantImpactVelocity(impact_velocity), f"{impact_velocity:g} m/s for all"
    motion = simulate(flores(impact_velocity=law), times)
    own = joint_load(motion)
    by = {
        "jaxcrusher": own,
        "SciPy DOP853, sharp corner": by_scipy(numbers, times).contact_force,
        "EXUDYN, h = 1 us": by_exudyn(numbers, 4e-3, 1e-6).contact_force[: len(times)],
        "EXUDYN, h = 0.1 us": by_exudyn(numbers, 4e-3, 1e-7).contact_force[: 10 * len(times) : 10],
    }
    print(f"\nImpact velocity: {title}{motion.failure}")
    print("peak force of the first impacts, kN; agreement with SciPy to 1 % of the largest until")
    reference = by["SciPy DOP853, sharp corner"]
    for name, force in by.items():
        peaks = " ".join(f"{peak / 1e3:9.4f}" for peak in impact_peaks(force)[:6])
        apart = np.abs(force - reference) > 0.01 * own.max()
        until = f"{1e3 * times[apart.argmax()]:.2f}" if apart.any() else "the end, 4"
        print(f"  {name:27} {peaks}   {until if force is not reference else '-'} ms")


def impact_peaks(force: np.ndarray) -> list[float]:
    """Return the largest force of each stretch of contact, in samples of `force`."""
    touching = np.concatenate([[0], (force > 0).astype(int), [0]])
    begins, ends = np.flatnonzero(np.diff(touching) > 0), np.flatnonzero(np.diff(touching) < 0)
    return [float(force[begin:end].max()) for begin, end in zip(begins, ends, strict=True)]


def long_run(settle: int, turns: int) -> None:
    """Print RMS values over turns by three programs, with the scatter's standard errors."""
    turn, numbers = 2 * np.pi / Numbers().speed, Numbers()
    # 1 us to a rounding: a whole number of samples a turn.
    samples = round(turn / 1e-6)
    step = turn / samples
    times = step * np.arange((settle + turns) * samples)
    motion = simulate(flores(), times)
    exudyn = by_exudyn(numbers, times[-1], step)
    scipy = by_scipy(numbers, times, rtol=1e-9)
    rows = {
        "jaxcrusher": (joint_load(motion), motion.instants.crank_moment),
        "SciPy DOP853, sharp corner": (scipy.contact_force, scipy.crank_moment),
        "EXUDYN, h = 1 us": (exudyn.contact_force, exudyn.crank_moment),
    }
    print(
        f"\nRMS over {turns} turns after {settle}, +- standard error of the turns{motion.failure}"
    )
    for name, columns in rows.items():
        cells = []
        for column in columns:
            by_turn = np.asarray(column).reshape(-1, samples)[settle:]
            squares = np.mean(by_turn**2, axis=1)
            rms = np.sqrt(squares.mean())
            cells.append((rms, squares.std(ddof=1) / np.sqrt(turns) / (2 * rms)))
        (force, force_error), (moment, moment_error) = cells
        print(
            f"  {name:27} joint force {force:7.0f} +- {force_error:4.0f} N"
            f"   crank moment {moment:6.1f} +- {moment_error:4.1f} N m"
        )


def draw(path: Path, turns: int = 2) -> None:
    """Draw slider acceleration and crank moment over the crank angle, and the journal's orbit."""
    mechanism = flores()
    speed, joint = float(mechanism.drive.speed), mechanism.joints["wrist"]
    assert joint is not None
    times = np.linspace(0, turns * 2 * np.pi / speed, 12_000 * turns)
    motion, ideal = simulate(mechanism, times), simulate(flores(None), times)
    degrees = np.degrees(speed * times)
    figure = plt.figure(figsize=(11, 5.5), layout="constrained")
    axes = figure.subplot_mosaic(
        [["slider_acceleration", "orbit"], ["crank_moment", "orbit"]], width_ratios=[1.6, 1]
    )
    for name, unit, label in (
        ("slider_acceleration", 1e3, "slider acceleration (km/s²)"),
        ("crank_moment", 1, "crank moment (N m)"),
    ):
        ax = axes[name]
        values, rest = (np.asarray(getattr(m.instants, name)) / unit for m in (motion, ideal))
        ax.plot(degrees, values, color="C0", linewidth=0.8, label="clearance 0.5 mm")
        ax.plot(degrees, rest, color="k", linestyle="--", linewidth=1, label="ideal joint")
        ax.set(ylabel=label, xticks=np.arange(0, 360 * turns + 1, 90))
        ax.grid(alpha=0.3)
    axes["slider_acceleration"].legend(loc="lower right")
    axes["crank_moment"].set_xlabel("crank angle (degrees)")
    ax, radius = axes["orbit"], 1e3 * float(joint.clearance)
    circle = np.linspace(0, 2 * np.pi, 361)
    ax.plot(radius * np.cos(circle), radius * np.sin(circle), color="0.4", label="clearance")
    e = motion.instants.eccentricity
    assert e is not None
    ax.plot(1e3 * e.x, 1e3 * e.y, color="C0", linewidth=0.6, label="journal centre")
    ax.set(xlabel="$e_x$ (mm)", ylabel="$e_y$ (mm)", aspect="equal")
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2, frameon=False)
    figure.suptitle(
        f"Slider-crank, {60 * speed / (2 * np.pi):.0f} rpm, "
        f"dry clearance joint between rod and slider, first {turns} turns"
    )
    write_figure(path, figure)
    print(f"\n{path}")


def run(out: Path) -> None:
    """Print the comparison, the energy and the model's limits; draw the figure."""
    folder = results_folder(out)
    compare(None)
    compare(20.0)
    mechanism = flores()
    motion = simulate(mechanism, np.linspace(0, 24e-3, 24_001))
    ledger = motion.energy - motion.energy[0] - sum(motion.work.values())
    open_share = float(jnp.abs(ledger).max() / jnp.abs(motion.work["drive"]).max())
    lost = -float(motion.work["contact"][-1])
    print(f"\ntwo turns: {lost:.2f} J lost in contact; of the drive's largest work")
    print(f"  {open_share:.1e} are unaccounted for")
    contact, joint = motion.instants.contact, mechanism.joints["wrist"]
    assert contact is not None and joint is not None
    depth = contact.penetration.max() / 0.5e-3
    limits = validity(joint, depth, contact.penetration_rate.max())
    print("outside the contact model: " + ("; ".join(limits.remarks()) or "nothing"))
    long_run(5, 20)
    draw(folder / "slider_crank.png")
