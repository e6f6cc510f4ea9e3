"""Files of results, written whole or not at all; checksums and locks of files, and messages.

Messages of programs go to standard error. A lock dies with its process.
"""

import contextlib
import csv
import hashlib
import io
import json
import math
import os
import platform
import sys
import uuid
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


@contextlib.contextmanager
def named(what: str) -> Iterator[None]:
    """Say in front of an OSError what could not be done."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, f"{what}: {error.strerror or error}") from error


@contextlib.contextmanager
def writing(path: Path) -> Iterator[Path]:
    """A path to write to, beside `path`, whose place it takes at the end.

    So `path` is there whole or not at all, also through a power cut. Every call has a name of its
    own: two that write one file, or files that differ in their suffix, do not meet. After an error
    nothing is left of it.
    """
    partial = path.with_name(f"{path.stem}.{uuid.uuid4().hex}.partial{path.suffix}")
    try:
        with named(str(path)):
            yield partial
            with open(partial, "rb+") as file:
                os.fsync(file.fileno())
            os.replace(partial, path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


def replace(path: Path, content: bytes) -> None:
    """Put a file in place, whole or not at all, also through a power cut."""
    with writing(path) as partial:
        partial.write_bytes(content)


def checksum(path: Path, *, sync: bool = False) -> str:
    """SHA-256 of a file; with `sync`, of one that is on the disk when this returns."""
    with open(path, "rb") as file:
        if sync:
            os.fsync(file.fileno())
        return hashlib.file_digest(file, "sha256").hexdigest()


def broken(folder: Path, checksums: dict[str, str]) -> str:
    """Say what is wrong with the first bad file of a table of checksums, or nothing."""
    for name, expected in checksums.items():
        try:
            if checksum(folder / name) != expected:
                return f"{name} does not match its checksum"
        except OSError as error:
            return f"{name}: {error.strerror}"
    return ""


def lock(path: Path, what: str) -> int:
    """The descriptor of a locked file; closing it, or the process's end, frees the lock.

    Raises RuntimeError, with what the holder wrote into the file, if another one holds it.
    """
    import fcntl  # Not on Windows; the rest of the package works there.

    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = os.read(descriptor, 200).decode(errors="replace")
        os.close(descriptor)
        raise RuntimeError(f"{what} is in use by {holder or 'another run'}.") from None
    except OSError:
        os.close(descriptor)
        raise
    os.truncate(descriptor, 0)
    os.write(descriptor, f"process {os.getpid()} on {platform.node()}".encode())
    return descriptor


def run_folder(out: Path, name: str) -> Path:
    """The folder of a run inside that of all results; ValueError for a name that leaves it."""
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
    """Return the paths of those of the named files of a folder that were written, in one line."""
    return ", ".join(str(folder / name) for name in names if (folder / name).exists())


def write_text(path: Path, text: str) -> None:
    """Text in UTF-8, wherever the program runs."""
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
    """MATLAB's format 5: each variable by its name, and a structure `units` with their units."""
    import numpy as np
    from scipy.io import savemat

    values = {str(name): np.asarray(column) for name, column in dataset.variables.items()}
    units = {name: dataset[name].attrs.get("units", "1") for name in values}
    with writing(path) as partial, open(partial, "wb") as file:
        savemat(file, values | {"units": units}, long_field_names=True, oned_as="column")


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
