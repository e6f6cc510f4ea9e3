"""What programs write: labelled netCDF and JSON, whole or not at all, with their provenance."""

import json
import math
import os
import shlex
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import jax
import numpy as np
import xarray as xr
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from jaxcrusher.basics.checks import require
from jaxcrusher.files.provenance import environment, machine


def results_folder(out: Path, name: str) -> Path:
    """Make OUT/NAME; ValueError if it cannot be written."""
    folder = out / name
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(
            f"Argument `out` must be a folder that can be written, but {folder} is not: "
            f"{error.strerror}."
        ) from None
    require(os.access(folder, os.W_OK), "out", "be a folder that can be written", folder)
    return folder


def provenance(title: str, values: Mapping[str, Any]) -> dict[str, str]:
    """Attributes of a result: the command, the crusher (SI units, as JSON), versions, machine."""
    program = environment()
    return {
        "title": title,
        "source": f"jaxcrusher {program['versions']['jaxcrusher']}",
        "history": f"{datetime.now(UTC).isoformat(timespec='seconds')}: {command()}",
        "scene": json.dumps(dict(values)),
        "environment": json.dumps(program),
        "machine": machine(),
    }


def command() -> str:
    """The command line, as a shell takes it."""
    return shlex.join(["python", "-m", "jaxcrusher", *sys.argv[1:]])


def write_netcdf(path: Path, dataset: xr.Dataset) -> None:
    """Write at once or not at all; logical variables become 0 and 1."""
    partial = path.with_suffix(".partial")
    logical = [name for name, values in dataset.items() if values.dtype == bool]
    dataset = dataset.assign({name: dataset[name].astype("int8") for name in logical})
    dataset.to_netcdf(partial, engine="scipy")
    os.replace(partial, path)


def write_json(path: Path, content: dict) -> None:
    """Write at once or not at all; NaN becomes null."""

    def clean(value):
        if isinstance(value, np.ndarray | np.generic | jax.Array):
            return clean(np.asarray(value).tolist())
        if isinstance(value, dict):
            return {key: clean(entry) for key, entry in value.items()}
        if isinstance(value, list | tuple):
            return [clean(entry) for entry in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps(clean(content), indent=2) + "\n")
    os.replace(partial, path)


def progress(console: Console) -> Progress:
    """Bars with what is done and the time left."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    return Progress(*columns, console=console)
