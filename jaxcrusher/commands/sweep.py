"""`python -m jaxcrusher sweep`: statistics over a grid of crushers, in a Zarr store."""

import math

import matplotlib.pyplot as plt
import xarray as xr
from rich.console import Console

from jaxcrusher.basics.checks import renamed
from jaxcrusher.batch.cluster import local_workers
from jaxcrusher.batch.sweep import sweep
from jaxcrusher.commands.machines import bounds, read_axes, read_machine, write_dataset
from jaxcrusher.commands.options import Sweep
from jaxcrusher.crusher.template import CALLED
from jaxcrusher.files.progress import progress
from jaxcrusher.files.results import results_folder, write_figure
from jaxcrusher.files.text import number
from jaxcrusher.pictures.plots import plot_sweep
from jaxcrusher.scenes.units import all_said, units_of


def run(options: Sweep, console: Console) -> int:
    """Sweep and print a closing line. Return 1 if a design failed; ValueError for bad options."""
    found = read_machine(options.crusher)
    axes = read_axes(options.over, found)
    headline = found.scene().headline
    found.require_possible(axes)
    folder = results_folder(options.results.folder)
    designs = math.prod(len(axis) for axis in axes.values())
    # On the command line --name chooses the store.
    called = renamed(store="name", settle_turns="settle")
    with progress(console) as bars, local_workers(options.scheduler) as scheduler, called:
        bar = bars.add_task("designs", total=designs)
        grid = sweep(
            found,
            axes,
            options.settle,
            options.turns,
            store=folder / "sweep.zarr",
            chunk=options.chunk,
            engine=options.engine,
            rtol=options.rtol,
            scheduler=scheduler,
            progress=lambda finished, _: bars.update(bar, completed=finished),
        )
    asked = {"sweep.nc": options.netcdf, "sweep.csv": options.csv, "sweep.mat": options.mat}
    written = [folder / "sweep.zarr", *(folder / name for name, wanted in asked.items() if wanted)]
    for path in written[1:]:
        write_dataset(path, grid.load())
    units = found.units | units_of(bounds(options.over))
    if len(axes) == 2 and not set(axes) & set(found.choices):
        written.append(folder / "sweep.png")
        fig, ax = plt.subplots(figsize=(7, 4.8), layout="constrained")
        plot_sweep(grid, headline, ax, units=units)
        write_figure(written[-1], fig)
    console.print(closing(grid, headline, units))
    console.print(", ".join(map(str, written)))
    return 0 if bool(grid.success.all()) else 1


def closing(grid: xr.Dataset, headline: str, units: dict[str, str]) -> str:
    """Count failures, whirls and designs outside the model; name the least headline RMS."""
    grid = grid[[headline, "success", "whirl", "inside_model"]].load()
    success, whirl = grid.success.to_numpy(), grid.whirl.to_numpy()
    outside = int((success & ~whirl & ~grid.inside_model.to_numpy()).sum())
    remark = grid.attrs.get("remark", "")
    counts = (
        f"{grid.success.size} designs: {int((~success).sum())} failed, {int(whirl.sum())} "
        f"whirl, {outside} more outside the contact model"
    )
    counts = f"{remark}\n{counts}" if remark else counts
    good = grid[headline].where(grid.success & ~grid.whirl)
    if not bool(good.notnull().any()):
        return counts
    best = good.isel(good.argmin(...))  # pyright: ignore
    design = all_said({str(name): best.coords[name].item() for name in grid.sizes}, units)
    return f"{counts}; least {CALLED[headline]} {number(best.item())} N at {design}"
