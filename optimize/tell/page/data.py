"""The numbers of the report's interactive landscape, packed for its script."""

import base64
import json
from collections.abc import Mapping

import numpy as np
import xarray as xr
from markupsafe import Markup

from jaxcrusher.scenes.parameters import in_words
from jaxcrusher.scenes.units import unit_of
from optimize.answer import Answer
from optimize.tell.words import shown

# Bytes of motions in a page before base64 makes a third more of them, and the fewest instants
# a turn that still show an orbit.
MOST_BYTES, FEWEST_SAMPLES = 2_500_000, 32
# What int16 says where there is no number.
NO_VALUE = -32768
COLOURS = 64

# Outlines of the markers, as the path's commands after its first point.
DIAMOND = "m-7 0l7 -7l7 7l-7 7"
STAR = "m0 -10l2.4 6.8h7.1l-5.7 4.3l2.1 6.9l-5.9 -4.1l-5.9 4.1l2.1 -6.9l-5.7 -4.3h7.1"


def pack(landscape: xr.Dataset, motions: xr.Dataset | None, answer: Answer) -> dict:
    """Everything that the script draws, ready for JSON.

    Cells are numbered as they lie in memory, the last dim fastest. Motions are thinned to
    `MOST_BYTES`, or left out if too few instants a turn would remain.
    """
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    dims = _cell_dims(landscape)
    units = answer.problem.units
    parameters = _parameters(landscape, dims, units)
    best = answer.optimum
    return {
        "parameters": parameters,
        "shape": None if dims == ("sample",) else [landscape.sizes[name] for name in dims],
        "starts": [str(start) for start in landscape.start.to_numpy()],
        "variables": [
            _variable(values, dims)
            for values in landscape.values()
            if "coordinate" not in values.dims
        ],
        "designs": [
            {
                "at": [shown(name, value, units) for name, value in design.values.items()][:2],
                "shape": STAR if title == "optimum" else DIAMOND,
            }
            for title, design in answer.designs.items()
        ],
        "forces": _forces(landscape),
        "first": 0 if best is None else _nearest(parameters, best.values, units),
        "colours": [to_hex(colour) for colour in colormaps["cividis"](np.linspace(0, 1, COLOURS))],
        "motions": None if motions is None else _pack_motions(motions, dims),
    }


def _forces(landscape: xr.Dataset) -> dict[str, str]:
    """Return what a cell's account calls its leading force and what shakes; a crusher has both."""
    named = {"foundation_rms": "RMS", "shaking_rms": "shaking RMS"}
    return {name: words for name, words in named.items() if name in landscape}


def script(content: dict) -> Markup:
    """JSON for a script element of the page, which no text in it can end."""
    text = json.dumps({"landscape": content}, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", r"\u003c"))


def _cell_dims(landscape: xr.Dataset) -> tuple[str, ...]:
    """The dims of the cells: `sample`, or the parameters in the order of the variables."""
    dims = next(iter(landscape.values())).dims
    return tuple(str(name) for name in dims if name != "start")


def _parameters(
    landscape: xr.Dataset, dims: tuple[str, ...], units: Mapping[str, str]
) -> list[dict]:
    """Name, meaning, unit of each parameter, and its number in every cell."""
    if dims == ("sample",):
        names = [str(name) for name, values in landscape.coords.items() if values.dims == dims]
    else:
        names = list(dims)
    numbers = xr.broadcast(*(landscape[name] for name in names))
    return [
        {
            "name": name,
            "label": in_words(name),
            "unit": unit_of(name, units)[0],
            "values": shown(name, values.to_numpy().ravel().astype(float), units).tolist(),
        }
        for name, values in zip(names, numbers, strict=True)
    ]


def _variable(variable: xr.DataArray, dims: tuple[str, ...]) -> dict:
    """Name, meaning, unit and values of a variable of the landscape, start by start."""
    values = variable.transpose("start", *dims).to_numpy()
    return {
        "name": str(variable.name),
        "label": str(variable.attrs["long_name"]).replace("$", ""),
        "units": str(variable.attrs["units"]),
        "logical": values.dtype == bool,
        "packed": _base64(values.astype("<f4")),
    }


def _nearest(parameters: list[dict], design: dict[str, float], units: Mapping[str, str]) -> int:
    """The number of the cell next to a design, in shares of each parameter's range."""
    distance = 0.0
    for parameter in parameters:
        values = np.array(parameter["values"])
        name = parameter["name"]
        offset = values - shown(name, design[name], units)
        distance = distance + (offset / (np.ptp(values) or 1.0)) ** 2
    return int(np.argmin(distance))


def _pack_motions(motions: xr.Dataset, dims: tuple[str, ...]) -> dict | None:
    kept = _thinned(motions)
    if kept is None:
        return None
    turns = [float(f"{turn:.5g}") for turn in kept.turn.to_numpy()]
    names = {"x": "eccentricity_x", "y": "eccentricity_y", "force": "force", "ideal": "ideal_force"}
    # The ideal joints' force is of no start.
    kept = kept.transpose("start", *dims, "instant")
    return {"turn": turns} | {short: _small(kept[name].to_numpy()) for short, name in names.items()}


def _thinned(motions: xr.Dataset) -> xr.Dataset | None:
    """Every n-th instant, n as small as the page allows; None if that shows nothing."""
    instants = motions.sizes["instant"]
    numbers = sum(motions[name].size for name in motions) // instants
    stride = -(-instants // max(MOST_BYTES // (2 * numbers), 1))
    kept = motions.isel(instant=slice(None, None, stride))
    turns = float(motions.turn[-1] - motions.turn[0])
    return kept if kept.sizes["instant"] >= FEWEST_SAMPLES * turns else None


def _small(values: np.ndarray) -> dict:
    """16-bit whole numbers, each row (last axis) by a scale of its own."""
    finite = np.isfinite(values)
    largest = np.abs(np.where(finite, values, 0)).max(axis=-1, keepdims=True)
    scale = np.where(largest > 0, largest, 1) / 32767
    whole = np.where(finite, np.rint(np.where(finite, values, 0) / scale), NO_VALUE)
    return {"values": _base64(whole.astype("<i2")), "scale": _base64(scale.astype("<f4"))}


def _base64(values: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode()
