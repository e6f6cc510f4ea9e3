"""report.html: the results of a search, in one file that opens without a network."""

import base64
import json
import shlex
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path

import jinja2
import numpy as np
import xarray as xr
from markupsafe import Markup

from jaxcrusher.files.results import write_text
from jaxcrusher.files.text import Table, as_text, is_number
from jaxcrusher.scenes.parameters import in_words
from jaxcrusher.scenes.units import said, unit_of
from optimize.answer import Answer
from optimize.ask.constraints import may_be_stable
from optimize.search.motions import INSTANTS
from optimize.tell import tables
from optimize.tell import words as formatting
from optimize.tell.words import shown

# Captions of the figures of a finished run, in the order of the page.
FIGURES = {
    "curve.svg": "The objective over the free number that changes it most, along the line of the "
    "map next to the optimum.",
    "motion.svg": "The pin's path in its bore, and the force over two turns, of the optimum and of "
    "the design it is compared with: on the periodic orbit, or after the long run of the worse "
    "start where there is none.",
    "pareto.svg": "The objective against what has to be traded for it; the front is what nothing "
    "beats in both.",
    "capacity.svg": "Capacity over driving speed, with its floor and the box searched. By "
    "laminating crushing theory a slower shaft crushes more, for a layer has more time to fall.",
    "bearings.svg": "The two bearings of |R_O| + |R_C|, the force on the foundation: the frame "
    "carries the shaft at O with R_O and the toggle at C with R_C. The main bearing A, whose "
    "clearance counts here, is the joint of jaw and eccentric, and no part of the frame. Jaw and "
    "face are drawn for the eye.",
    "settling.svg": "Turns in which a disturbance of the periodic orbit falls to 1/e.",
    "landscape.svg": "Averages over the first turns, from the worse of both starts: oscillations "
    "have not decayed in them. They show where a start whirls or fails.",
    "orbits.svg": "The objective of the periodic orbits, with the paths of the descents.",
}
# The page loads nothing: a browser refuses all sources that this policy does not name.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
# Greatest number of bytes of motions in a page; base64 adds a third to them.
MOST_BYTES = 1_800_000
# The int16 value for a missing number.
NO_VALUE = -32768
COLOURS = 64
# Columns of the map that the page does not offer as a variable.
UNSEEN = ("path", "force", "ideal_force", "ideal_objective", "slope")
# Keys of numbers and choices that the options of a search fix.
OPTIONS = ("friction", "slip", "load_law", "impact_law", "impact_velocity")


def write_page(
    folder: Path,
    answer: Answer,
    figures: Sequence[str],
    omitted: Mapping[str, str] | None = None,
) -> Path:
    """Write report.html, completely or not at all, and return its path.

    **Arguments:**

    - `folder`: the folder of the run; its name is the title.
    - `answer`: the answer, which may be incomplete; the page names missing stages.
    - `figures`: names in `FIGURES` that this run drew: other files may be from an earlier run.
    - `omitted`: the reasons for omitted figures, by name.
    """
    failed, count = sum(not check.passed for check in answer.checks), len(answer.checks)
    orbits = None if answer.maps is None else answer.maps.orbits
    data = None if orbits is None else pack(orbits, answer)
    page = _template().render(
        name=folder.name,
        policy=POLICY,
        style=Markup(_part("page.css")),
        code=Markup(_part("page.js")),
        data=data,
        json=None if data is None else _script(data),
        answer=answer,
        sentence=formatting.answer(answer),
        headline=tables.headline(answer),
        remarks=[f"{name}: {formatting.limits(one)}" for name, one in answer.designs.items()],
        caution=tables.caution(answer),
        error=formatting.error(answer) if answer.designs else "",
        verdict=f"{failed} of {count} checks failed." if failed else f"All {count} checks passed.",
        active=[
            formatting.active(one, answer.problem.objective.unit, answer.problem.units)
            for one in answer.active
        ],
        tables=_tables(answer),
        captions=FIGURES,
        drawn={name: _picture(folder, name) for name in figures},
        omitted=omitted or {},
        limits=tables.limits(answer),
    )
    path = folder / "report.html"
    write_text(path, page)
    return path


def _template() -> jinja2.Template:
    """Return the template; it escapes every text, and an undefined name is an error."""
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    environment.filters["as_text"] = as_text
    environment.tests["number_cell"] = is_number
    return environment.from_string(_part("report.html"))


def _tables(answer: Answer) -> dict:
    return {
        "answer": tables.answer(answer) if answer.designs else None,
        "motions": tables.motions(answer) if answer.designs else None,
        "coexisting": tables.coexisting(answer),
        "load_sheet": tables.load_sheet(answer),
        "checks": Table(
            ("check", "verdict", "detail"),
            [(check.name, check.verdict, check.detail) for check in answer.checks],
        ),
        "slopes": tables.slopes(answer),
        "fronts": tables.fronts(answer),
        "candidates": tables.candidates(answer),
        "descents": tables.descents(answer),
        "box": tables.box(answer),
        "stages": tables.stages(answer),
        "fixed": tables.fixed(answer),
        "versions": Table(("", "version"), list(answer.versions.items())),
    }


def _picture(folder: Path, name: str) -> Markup:
    """Return a picture as an SVG element of the page."""
    text = (folder / name).read_text(encoding="utf-8")
    named = Markup('<svg class="picture" role="img" aria-label="{}" ').format(FIGURES[name])
    return Markup(text[text.index("<svg ") :]).replace(Markup("<svg "), named, 1)


def _part(name: str) -> str:
    return files("optimize.tell.page").joinpath(name).read_text(encoding="utf-8")


def _script(content: dict) -> Markup:
    """Return JSON for a script element of the page; no text in it can close the element."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", r"\u003c"))


def pack(orbits: xr.Dataset, answer: Answer) -> dict:
    """Return all data of the map of orbits that the script draws, ready for JSON.

    Cells are numbered in the order of memory: the last dim varies fastest.
    """
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    dims, units = tuple(map(str, orbits.objective.dims)), answer.problem.units
    sequence = dims == ("sample",)
    free = [n for n, v in orbits.coords.items() if v.dims == dims] if sequence else dims
    numbers = xr.broadcast(*(orbits[name] for name in free))
    values = {
        str(name): shown(str(name), one.to_numpy().ravel().astype(float), units)
        for name, one in zip(free, numbers, strict=True)
    }
    best, motions = answer.optimum, ("path", "force", "ideal_force")
    small = 2 * sum(orbits[name].size for name in motions) <= MOST_BYTES
    return {
        "parameters": [
            {
                "name": name,
                "label": in_words(name),
                "unit": unit_of(name, units)[0],
                "values": of_cells.tolist(),
            }
            for name, of_cells in values.items()
        ],
        "shape": None if sequence else list(orbits.objective.shape),
        "variables": [
            _variable(one)
            for name, one in orbits.items()
            if one.dtype.kind == "f" and name not in UNSEEN
        ],
        "designs": [
            {
                "at": [shown(n, value, units) for n, value in design.values.items()][:2],
                "optimum": title == "optimum",
            }
            for title, design in answer.designs.items()
        ],
        "hatched": (~may_be_stable(orbits)).astype(int).ravel().tolist(),
        "states": _states(orbits),
        "more": _more(answer),
        "first": 0 if best is None else _nearest(values, best.values, units),
        "force": "|R_O| + |R_C|" if "foundation_rms" in orbits else "shaking force",
        "instants": INSTANTS,
        "motions": {name: _small(orbits[name]) for name in motions} if small else None,
        "colours": [to_hex(colour) for colour in colormaps["cividis"](np.linspace(0, 1, COLOURS))],
    }


def _variable(variable: xr.DataArray) -> dict:
    """Return name, meaning, unit and values of a variable of the orbits."""
    values = variable.to_numpy()
    return {
        "name": str(variable.name),
        "label": str(variable.attrs["long_name"]).replace("$", ""),
        "units": str(variable.attrs["units"]).removesuffix("1"),
        "packed": _base64(values.astype("<f4")),
    }


def _states(orbits: xr.Dataset) -> list[str]:
    """Describe the orbit of each cell, or say why the cell has no orbit."""
    names = ("success", "stable", "undecided", "counts", "inside_model")
    columns = [orbits[name].to_numpy().ravel().astype(bool) for name in names]
    failures = orbits.failure.to_numpy().ravel().tolist()
    motions = orbits.motion.to_numpy().ravel() if "motion" in orbits else [""] * orbits.counts.size
    multipliers = orbits.largest_multiplier.to_numpy().ravel().tolist()
    said_so = []
    for cell, (success, stable, undecided, counts, inside) in enumerate(zip(*columns, strict=True)):
        if not success:
            told = [f"No orbit of one turn: {failures[cell]}".rstrip(".")]
        elif stable:
            told = ["Stable"]
        else:
            grows = f"Unstable: a disturbance grows {multipliers[cell]:.4g} times in a turn"
            told = ["Not known to be stable" if undecided else grows]
        told += ["out of the contact model"] if success and not inside else []
        told += ["outside a constraint"] if (stable or undecided) and not counts else []
        said_so.append(". ".join(filter(None, ("; ".join(told), motions[cell].rstrip(".")))))
    return said_so


def _more(answer: Answer) -> str:
    """Return the command that names the motion of a design, without its free numbers.

    It is empty if other numbers of the machine depend on the free ones.
    """
    if any(design.follows for design in answer.designs.values()):
        return ""
    words, kept = shlex.split(answer.command), ["python", "-m", "jaxcrusher", "regimes"]
    for i, word in enumerate(words):
        kept += words[i : i + {"--scene": 2, "--set": 3}.get(word, 0)]
    for name in OPTIONS:
        if name in answer.problem.design.fixed:
            kept += ["--set", name, said(name, answer.problem.design.fixed[name], {})]
    return shlex.join(kept)


def _nearest(
    values: Mapping[str, np.ndarray], design: Mapping[str, float], units: Mapping[str, str]
) -> int:
    """Return the number of the cell nearest to a design, in shares of each parameter's range."""
    offsets = [
        (cells - shown(name, design[name], units)) / (np.ptp(cells) or 1.0)
        for name, cells in values.items()
    ]
    return int(np.argmin(np.square(offsets).sum(axis=0)))


def _small(variable: xr.DataArray) -> dict:
    """Return 16-bit integers with a row and a scale for each cell; a path has all x, then all y."""
    by_axis = variable.transpose(..., "axis", "instant") if "axis" in variable.dims else variable
    values = by_axis.to_numpy().reshape(-1, INSTANTS * variable.sizes.get("axis", 1))
    finite = np.isfinite(values)
    known = np.where(finite, values, 0)
    largest = np.abs(known).max(axis=-1, keepdims=True)
    scale = np.where(largest > 0, largest, 1) / 32767
    whole = np.where(finite, np.rint(known / scale), NO_VALUE)
    return {"values": _base64(whole.astype("<i2")), "scale": _base64(scale.astype("<f4"))}


def _base64(values: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode()
