"""`python -m jaxcrusher sweep`: statistics over a grid of crushers, in a Zarr store."""

import contextlib
import logging
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from rich.console import Console

from jaxcrusher.basics.checks import require
from jaxcrusher.batch.large_sweep import sweep_to_store
from jaxcrusher.commands.options import Crusher, Ranges, Results, read_axes
from jaxcrusher.files.results import progress, write_netcdf

if TYPE_CHECKING:
    import distributed


@dataclass(frozen=True)
class Sweep:
    """Statistics over a grid of crushers, kept chunk by chunk.

    Writes the Zarr store OUT/NAME/sweep.zarr, which xarray opens. Interrupted or killed, the same
    command goes on where it was. About 20 s of compilation, then about a second a design and
    core with the default turns.
    """

    crusher: Crusher = field(default_factory=Crusher)
    over: Ranges = ()
    """A parameter and its range in SI units or quantities, as in --over speed 25 40 16 or --over
    clearance "0.03 mm" "0.12 mm" 10; or a choice and what to choose, as in --over start centred
    contact. May be repeated: the grid is the product of all."""
    settle: int = 40
    """Turns of the shaft before statistics start."""
    turns: int = 40
    """Turns of the shaft that statistics cover."""
    chunk: int = 64
    """Designs kept at once: what an interruption can lose. Take more for large sweeps; each chunk
    is a file of every variable."""
    rtol: float = 1e-9
    """Tolerance of a step, in clearances and m/s."""
    scheduler: str | None = None
    """Address of a Dask scheduler, as tcp://host:8786, or a number of local worker processes;
    this process without."""
    netcdf: bool = False
    """Also write OUT/NAME/sweep.nc at the end."""
    results: Results = field(default_factory=lambda: Results("sweep"))

    def run(self, console: Console) -> int:
        """Sweep and print a closing line; ValueError for bad options."""
        values, axes = self.crusher.values(), read_axes(self.over)
        base = {name: value for name, value in values.items() if name not in axes}
        folder = self.results.folder()
        designs = math.prod(len(axis) for axis in axes.values())
        with progress(console) as bars, _workers(self.scheduler) as scheduler:
            bar = bars.add_task("designs", total=designs)
            grid = sweep_to_store(
                folder / "sweep.zarr",
                axes,
                self.settle,
                self.turns,
                base=base,
                chunk=self.chunk,
                rtol=self.rtol,
                scheduler=scheduler,
                progress=lambda finished, _: bars.update(bar, completed=finished),
            )
        written = [folder / "sweep.zarr"]
        if self.netcdf:
            written.append(folder / "sweep.nc")
            write_netcdf(written[-1], grid.load())
        console.print(closing(grid), highlight=False, soft_wrap=True)
        console.print(", ".join(map(str, written)), highlight=False)
        return 0


@contextlib.contextmanager
def _workers(scheduler: str | None) -> "Iterator[str | distributed.Client | None]":
    """A cluster of worker processes for a number; an address, or None, as it is."""
    if scheduler is None or not scheduler.isdecimal():
        yield scheduler
        return
    require(int(scheduler) >= 1, "scheduler", "be an address or a number >= 1", scheduler)
    try:
        import distributed
    except ImportError:
        raise ValueError(
            "Argument `scheduler` needs Dask: pip install 'jaxcrusher[cluster]'."
        ) from None
    cluster = distributed.LocalCluster(
        n_workers=int(scheduler),
        threads_per_worker=1,
        dashboard_address=None,  # pyright: ignore
        silence_logs=logging.ERROR,
    )
    with cluster, distributed.Client(cluster, set_as_default=False) as client:
        yield client


def closing(grid: xr.Dataset) -> str:
    """How the designs fared, and the one that shakes least."""
    grid = grid[["foundation_rms", "success", "whirl", "inside_model"]].load()
    success, whirl = grid.success.to_numpy(), grid.whirl.to_numpy()
    outside = int((success & ~whirl & ~grid.inside_model.to_numpy()).sum())
    counts = (
        f"{grid.success.size} designs: {int((~success).sum())} failed, {int(whirl.sum())} "
        f"whirl, {outside} more outside the contact model"
    )
    good = grid.foundation_rms.where(grid.success & ~grid.whirl)
    if not bool(good.notnull().any()):
        return counts
    best = good.isel(good.argmin(...))  # pyright: ignore
    units = {name: str(axis.attrs.get("units", "")) for name, axis in best.coords.items()}
    design = ", ".join(
        f"{name} {_text(best.coords[name].item())} {units[name]}".rstrip() for name in grid.sizes
    )
    return f"{counts}; least RMS {best.item():.0f} N at {design}"


def _text(value: float | str) -> str:
    return value if isinstance(value, str) else f"{np.float64(value):.6g}"
