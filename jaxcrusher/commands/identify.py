"""`python -m jaxcrusher identify`: numbers of a machine from its measured vibration."""

import itertools
from dataclasses import asdict
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from rich.console import Console
from scipy.stats import chi2

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
from jaxcrusher.scenes.reader import require_continuous
from jaxcrusher.scenes.units import typed_in
from jaxcrusher.scenes.units import unit_of as shown_in

FILES = ("identified.json", "identified.png")
FURTHER = 3  # further measurements that are printed
COLUMNS, ELLIPSES = 3, 3  # of the picture


def run(options: Identify, console: Console) -> int:
    """Solve, print, write. ValueError for bad options, and without an orbit to begin with."""
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
    further = []
    if options.noise:
        with stages(console, "looking for what tells most"):
            further = found.further(noise=options.noise)
        for one in further[:FURTHER]:
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
        | {"untold": [asdict(one) for one in found.untold], "remarks": found.remarks}
        | {"further": [asdict(one) for one in further]},
    )
    draw(found, machine.units, folder / "identified.png")
    console.print(listed(folder, FILES))
    return 0


def amplitudes(found: Identified) -> list[float]:
    """Return what was fitted: of harmonics the amplitude, and the rest with its sign."""
    pairs = zip(found.measured, found.fitted, strict=True)
    return [abs(fit) if one.is_harmonic else fit.real for one, fit in pairs]


def draw(found: Identified, units: dict[str, str], path: Path) -> None:
    """Draw measured and fitted amplitudes by observable, and ellipses of the most correlated."""
    shown = list(
        dict.fromkeys(found.problem.quantities.observable(one.quantity) for one in found.measured)
    )
    names, tied = list(found.values), np.abs(found.correlations)
    known = [i for i, name in enumerate(names) if found.known[name]]
    pairs = sorted(itertools.combinations(known, 2), key=lambda pair: -tied[pair])[:ELLIPSES]
    rows = -(-(len(shown) + len(pairs)) // COLUMNS)
    size = {"figsize": (4.2 * COLUMNS, 3.4 * rows), "layout": "constrained"}
    fig, axes = plt.subplots(rows, COLUMNS, squeeze=False, **size)
    for ax, name in zip(axes.flat, shown, strict=False):
        _draw_harmonics(ax, found, name)
    for ax, (i, j) in zip(list(axes.flat)[len(shown) :], pairs, strict=False):
        _draw_ellipse(
            ax, found, (names[i], names[j]), found.covariance[np.ix_((i, j), (i, j))], units
        )
    for ax in list(axes.flat)[len(shown) + len(pairs) :]:
        ax.set_axis_off()
    write_figure(path, fig, dpi=120)


def _draw_harmonics(ax: Axes, found: Identified, name: str) -> None:
    """Draw what was measured of an observable, with two sigmas, and what was fitted, as crosses."""
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
    ax.legend(fontsize=7, title="order; crosses: fitted", title_fontsize=7)


def _draw_ellipse(
    ax: Axes,
    found: Identified,
    names: tuple[str, str],
    covariance: Float[np.ndarray, "2 2"],
    units: dict[str, str],
) -> None:
    """Draw where two numbers lie together with a chance of 95 %."""
    angle = np.linspace(0, 2 * np.pi, 181)
    circle = np.sqrt(chi2.ppf(0.95, 2)) * np.stack([np.cos(angle), np.sin(angle)])
    along, vectors = np.linalg.eigh(covariance)
    # Of numbers that cannot be told apart rounding may leave a variance below zero.
    around = vectors * np.sqrt(np.maximum(along, 0.0)) @ circle
    places, labels = [], []
    for name, part in zip(names, around, strict=True):
        unit, size = shown_in(name, units)
        places.append((found.values[name] + part) / size)
        labels.append(f"{name} ({unit})" if unit else name)
    ax.plot(*places)
    ax.plot(*(place.mean() for place in places), "+", color="C0")
    ax.set(xlabel=labels[0], ylabel=labels[1], title="95 % of both")
    ax.locator_params(nbins=4)
