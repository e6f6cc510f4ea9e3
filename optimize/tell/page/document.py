"""report.html: all that a search found, in one file that opens without a network."""

import base64
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path

import jinja2
from markupsafe import Markup

from jaxcrusher.files.results import write_text
from jaxcrusher.files.text import as_text, is_number
from optimize.answer import Answer
from optimize.tell import tables
from optimize.tell import words as formatting
from optimize.tell.page import data as page_data

# The sketch that stands at the end of the answer, and what the figures of a finished run show.
SKETCH = "bearings.png"
FIGURES = {
    SKETCH: "The two bearings of |R_O| + |R_C|, the force on the foundation: the frame carries the "
    "shaft at O with R_O and the toggle at C with R_C. The main bearing A, whose clearance counts "
    "here, is the joint of jaw and eccentric, and no part of the frame. An arrow of less than a "
    "tenth of the longest has no name. Jaw and face are drawn for the eye.",
    "landscape.png": "The objective of the periodic orbit over the box, with the paths of the "
    "descents.",
    "settling.png": "Turns in which a disturbance of the periodic orbit falls to 1/e.",
    "starts.png": "The objective over the first turns, worse of both starts.",
    "capacity.png": "Capacity over driving speed, with its floor and the box searched. By "
    "laminating crushing theory a slower shaft crushes more, for a layer has more time to fall.",
    "pareto.png": "The objective against what has to be traded for it; the front is what nothing "
    "beats in both.",
    "motion.png": "Orbit of the pin and force on the foundation, or shaking force, of the optimum "
    "and of the design it is compared with, after their long runs.",
}
# The page may fetch nothing: a browser refuses what this does not name.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"


def write_page(
    folder: Path,
    answer: Answer,
    figures: Sequence[str],
    omitted: Mapping[str, str] | None = None,
) -> Path:
    """Write report.html, at once or not at all, and return its path.

    **Arguments:**

    - `folder`: of the run; its name is the title.
    - `answer`: as far as the search came; what is missing is named.
    - `figures`: of `FIGURES`, those that this run drew: others in the folder are an earlier run's.
    - `omitted`: why others had nothing to draw, by name.
    """
    maps = answer.maps
    data = None if maps is None else page_data.pack(maps.landscape, maps.motions, answer)
    failed, count = sum(not check.passed for check in answer.checks), len(answer.checks)
    page = _template().render(
        name=folder.name,
        policy=POLICY,
        style=Markup(_part("page.css")),
        code=Markup(_part("plot.js") + _part("page.js")),
        data=data,
        json=None if data is None else page_data.script(data),
        answer=answer,
        sentence=formatting.answer(answer),
        remarks=[
            f"{title}: {formatting.limits(design)}" for title, design in answer.designs.items()
        ],
        caution=tables.caution(answer),
        error=formatting.error(answer) if answer.designs else "",
        verdict=f"{failed} of {count} failed." if failed else f"All {count} passed.",
        active=[
            formatting.active(one, answer.problem.objective.unit, answer.problem.units)
            for one in answer.active
        ],
        tables=_tables(answer),
        figures=[_figure(folder, name) for name in figures if name != SKETCH],
        sketch=_figure(folder, SKETCH) if SKETCH in figures else None,
        omitted=omitted or {},
        limits=tables.limits(answer),
    )
    path = folder / "report.html"
    write_text(path, page)
    return path


def _template() -> jinja2.Template:
    """Every text is escaped; what is not there is an error."""
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
        "checks": tables.checks(answer),
        "slopes": tables.slopes(answer),
        "fronts": tables.fronts(answer),
        "candidates": tables.candidates(answer),
        "descents": tables.descents(answer),
        "runs": {title: tables.runs(answer, design) for title, design in answer.designs.items()},
        "box": tables.box(answer),
        "stages": tables.stages(answer),
        "fixed": tables.fixed(answer),
        "versions": tables.versions(answer),
    }


def _figure(folder: Path, name: str) -> dict[str, str]:
    content = base64.b64encode((folder / name).read_bytes()).decode()
    return {"content": content, "caption": FIGURES[name]}


def _part(name: str) -> str:
    return files("optimize.tell.page").joinpath(name).read_text(encoding="utf-8")
