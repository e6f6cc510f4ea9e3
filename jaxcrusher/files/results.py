"""Files of results, written whole or not at all, and messages of programs on standard error."""

import csv
import io
import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jaxcrusher.files.durable import replace, writing

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def run_folder(out: Path, name: str) -> Path:
    """Return a run's folder inside the folder `out`; ValueError for a name that leaves `out`."""
    good = name not in ("", ".", "..") and not set(name) & {"/", "\\", "\0"}
    if not good:
        raise ValueError(
            f"Argument `name` must be the name of one folder, without separators, but is {name!r}."
        )
    return out / name


def results_folder(folder: Path) -> Path:
    """Make a folder for results; ValueError if it cannot be written."""
    fault = ""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK):
            fault = "it may not be written"
    except OSError as error:
        fault = error.strerror or str(error)
    if fault:
        raise ValueError(
            f"Argument `out` must be a folder that can be written, but {folder} is not: {fault}."
        )
    return folder


def listed(folder: Path, names: Iterable[str]) -> str:
    """Return the paths of the named files that exist in a folder, in one line."""
    return ", ".join(str(folder / name) for name in names if (folder / name).exists())


def write_text(path: Path, text: str) -> None:
    """Write text in UTF-8 on every system."""
    replace(path, text.encode())


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write content as JSON, as `as_kept` has it."""
    write_text(path, json.dumps(as_kept(content), indent=2) + "\n")


def as_kept(value: Any) -> Any:
    """Return what JSON keeps of a value: null in place of NaN, lists in place of arrays."""
    if hasattr(value, "tolist"):
        return as_kept(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): as_kept(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [as_kept(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_netcdf(path: Path, dataset: "xr.Dataset") -> None:
    """NetCDF 3; logical variables become 0 and 1."""
    logical = [name for name, values in dataset.items() if values.dtype == bool]
    dataset = dataset.assign({name: dataset[name].astype("int8") for name in logical})
    with writing(path) as partial:
        dataset.to_netcdf(partial, engine="scipy")


def write_mat(path: Path, dataset: "xr.Dataset") -> None:
    """MATLAB's format 5: each variable by its name, in which a dot becomes an underscore.

    The structures `units`, `long_names` and `dims` have for each its unit, its meaning and the
    names of its axes; `attributes` has those of the dataset.
    """
    import numpy as np
    from scipy.io import savemat

    def told(of: Callable[["xr.DataArray"], Any]) -> dict[str, Any]:
        return {str(name).replace(".", "_"): of(dataset[name]) for name in dataset.variables}

    content = told(np.asarray) | {
        "units": told(lambda column: column.attrs.get("units", "1")),
        "long_names": told(lambda column: column.attrs.get("long_name", "")),
        "dims": told(lambda column: ", ".join(map(str, column.dims)).replace(".", "_")),
        "attributes": dataset.attrs,
    }
    with writing(path) as partial, open(partial, "wb") as file:
        savemat(file, content, long_field_names=True, oned_as="column")


def write_table(path: Path, rows: Iterable[Mapping[str, Any]], remark: str = "") -> None:
    """Rows of named values as CSV, `remark` in a first line of its own behind a "#"."""
    rows = list(rows)
    text = io.StringIO(f"# {remark}\n" if remark else "", newline="")
    text.seek(0, io.SEEK_END)
    writer = csv.DictWriter(text, list(dict.fromkeys(name for row in rows for name in row)))
    writer.writeheader()
    writer.writerows(rows)
    write_text(path, text.getvalue())


def write_figure(path: Path, figure: "Figure", dpi: int = 150) -> None:
    """A picture of a figure, which is closed."""
    import matplotlib.pyplot as plt

    with writing(path) as partial:
        figure.savefig(partial, dpi=dpi)
    plt.close(figure)


def tell(line: str) -> None:
    """Print a line on standard error."""
    print(" ".join(line.split()), file=sys.stderr)
