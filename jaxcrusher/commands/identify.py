"""`python -m jaxcrusher identify`: a machine's parameters, estimated from measured vibration."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from rich.console import Console

from jaxcrusher.basics.checks import require
from jaxcrusher.commands.machines import read_machine, settings_of
from jaxcrusher.commands.options import Identify
from jaxcrusher.files.progress import stages
from jaxcrusher.files.provenance import provenance
from jaxcrusher.files.results import listed, write_figure, write_json
from jaxcrusher.files.resume import begin_beside
from jaxcrusher.identification.identify import Identified, identify
from jaxcrusher.identification.measurements import taken
from jaxcrusher.identification.model import quantities_of
from jaxcrusher.pictures.fits import plot_corner
from jaxcrusher.pictures.style import WIDTH, style
from jaxcrusher.scenes.reader import require_continuous
from jaxcrusher.scenes.units import typed_in

FILES = ("identified.json", "identified.png")
FURTHER = 3  # how many further measurements are printed
COLUMNS, CORNER = 2, 5  # columns of the picture, and numbers in the corner plot


def run(options: Identify, console: Console) -> int:
    """Solve, print and write. ValueError for bad options, and if the first orbit is missing."""
    machine = read_machine(options.crusher)
    require(len(options.measured) > 0, "measured", "name a file", "missing")
    require(len(options.free) > 0, "free", "name numbers to be found", "missing")
    require(0 <= options.noise < np.inf, "noise", "be finite and >= 0", options.noise)
    for argument, names in (("free", options.free), ("prior", [one for one, *_ in options.prior])):
        for name in names:
            require_continuous(argument, name, machine)
    typed = lambda name, text: typed_in(machine.numbers[name].unit, name, text)  # noqa: E731
    priors = {n: (typed(n, mean), typed(n, sigma)) for n, mean, sigma in options.prior}
    twice = len(priors) < len(options.prior)
    require(not twice, "prior", "name each number once", "twice of one")
    quantities = quantities_of(machine.scene())
    measured = taken(options.measured, quantities.unit_of, options.orders, quantities.phase)
    settings = settings_of(
        "identify",
        machine,
        measured=[asdict(one) for one in measured],
        **{name: getattr(options, name) for name in ("free", "prior", "starts", "noise")},
    )
    folder = begin_beside(options.results.folder, settings, *FILES)
    with stages(console, "solving (the first time a minute, most of it compilation)"):
        found = identify(machine, measured, options.free, priors=priors, starts=options.starts)
    console.print("\n".join(found.lines(machine.units)), markup=False)
    experiments = []
    if options.noise:
        with stages(console, "looking for what tells most"):
            experiments = found.optimal_experiments(noise=options.noise)
        for one in experiments[:FURTHER]:
            called, unit = quantities.called(one.quantity), quantities.unit(one.quantity)
            order = f"order {one.order}" if one.order else "mean"
            console.print(
                f"Tells {one.gain:.1f} bits more: {called} ({one.quantity}), {order}, at "
                f"{one.speed * 30 / np.pi:.4g} rpm, known to {one.sigma:.2g} {unit}"
            )
    write_json(
        folder / "identified.json",
        provenance("Identified numbers", scene=machine.values)
        | {"values": found.values, "standard_deviations": found.standard_deviations}
        | {"correlations": found.correlations, "chi_square": found.chi_square}
        | {"degrees_of_freedom": found.freedom, "residuals": found.residuals}
        | {"measured": [asdict(one) for one in found.measured]}
        | {"fitted_amplitude": amplitudes(found)}
        | {
            "unidentifiable": [asdict(one) for one in found.unidentifiable],
            "remarks": found.remarks,
        }
        | {"optimal_experiments": [asdict(one) for one in experiments]},
    )
    start = {name: machine.number(name) for name in options.free}
    draw(found, start, machine.units, folder / "identified.png")
    console.print(listed(folder, FILES))
    return 0


def amplitudes(found: Identified) -> list[float]:
    """Return the fitted values: harmonics as amplitudes, others with their sign."""
    pairs = zip(found.measured, found.fitted, strict=True)
    return [abs(fit) if one.is_harmonic else fit.real for one, fit in pairs]


def draw(found: Identified, start: Mapping[str, float], units: dict[str, str], path: Path) -> None:
    """Draw measured and fitted amplitudes by observable, and the corner plot of known numbers.

    `start` has the initial values of the fit. The plot shows the `CORNER` most correlated numbers.
    """
    shown = list(
        dict.fromkeys(found.problem.quantities.observable(one.quantity) for one in found.measured)
    )
    names, tied = list(found.values), np.abs(found.correlations)
    np.fill_diagonal(tied, 0.0)
    known = [i for i, name in enumerate(names) if found.known[name]]
    closest = sorted(known, key=lambda i: -tied[i, known].max())[:CORNER]
    kept = sorted(closest)
    rows = -(-len(shown) // COLUMNS)
    heights = [2.3 * rows, *([1.2 + 1.2 * len(kept)] if kept else [])]
    with plt.rc_context(style()):
        fig = plt.figure(figsize=(WIDTH, sum(heights)), layout="constrained")
        above, *below = fig.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
        axes = above.subplots(rows, COLUMNS, squeeze=False)
        for ax, name in zip(axes.flat, shown, strict=False):
            _draw_harmonics(ax, found, name)
        for ax in axes.flat[len(shown) :]:
            ax.set_axis_off()
        if kept:
            values = {names[i]: found.values[names[i]] for i in kept}
            spread = found.covariance[np.ix_(kept, kept)]
            plot_corner(values, spread, below[0], start=start, units=units)
        write_figure(path, fig)


def _draw_harmonics(ax: Axes, found: Identified, name: str) -> None:
    """Draw an observable: measurements with bars of two sigmas, and fitted values as crosses."""
    kinds: dict[tuple[str, int | str], list[tuple[float, float, float, float]]] = {}
    for one, fit in zip(found.measured, found.fitted, strict=True):
        if found.problem.quantities.observable(one.quantity) == name:
            row = one.speed * 30 / np.pi, abs(one.amplitude), 2 * one.sigma, abs(fit)
            kinds.setdefault((one.quantity, one.order), []).append(row)
    for i, ((quantity, order), rows) in enumerate(kinds.items()):
        speed, amplitude, error, fit = np.array(sorted(rows)).T
        side = quantity.removeprefix(name).strip("_")
        label = f"{side}, {order}" if side else f"{order}"
        ax.errorbar(speed, amplitude, error, fmt="o", ms=3, color=f"C{i}", label=label)
        ax.plot(speed, fit, "x-", lw=0.8, color=f"C{i}")
    ax.set(
        title=name.replace("_", " "),
        xlabel="speed (rpm)",
        ylabel=f"amplitude ({found.problem.quantities.unit(name)})",
    )
    ax.set_yscale("log")
    ax.legend(title="order; x: fitted")
