"""report.html: all that a search found, in one file that opens without a network."""

import base64
import html
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

import xarray as xr

from jaxcrusher.files.results import write_text
from optimize.answer import Answer
from optimize.page import data as page_data
from optimize.page import sections
from optimize.page.explorer import explorer
from optimize.page.markup import Html, element, join, missing, section

# What the figures of a finished run show.
FIGURES = {
    "landscape.png": "The objective of the settled motion over the box, with the paths of the "
    "descents.",
    "settling.png": "Turns in which a disturbance of the settled motion falls to 1/e.",
    "starts.png": "The objective over the first turns, worse of both starts.",
    "capacity.png": "Capacity over driving speed, with its floor and the box searched.",
    "pareto.png": "RMS of the foundation force against capacity and against its peak, with what "
    "no other cell beats in both.",
    "motion.png": "Orbit of the pin and foundation force of the optimum and of the paper's "
    "choice, after their long runs.",
}
# The page may fetch nothing: a browser refuses what this does not name.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"


def write_page(
    folder: Path,
    answer: Answer,
    landscape: xr.Dataset | None,
    motions: xr.Dataset | None,
    figures: Sequence[str],
) -> Path:
    """Write report.html, at once or not at all, and return its path.

    **Arguments:**

    - `folder`: of the run; its name is the title.
    - `answer`: as far as the search came; what is missing is named.
    - `landscape`: as `optimize.landscape.mapped` gives it, or None.
    - `motions`: of its cells, as `optimize.motions.cell_motions` returns them, or None.
    - `figures`: of `FIGURES`, those that this run drew: others in the folder are an earlier run's.
    """
    data = None if landscape is None else page_data.pack(landscape, motions, answer)
    content = element(
        "main",
        _head(folder.name, answer),
        sections.answer(answer),
        explorer(data),
        sections.checks(answer),
        sections.slopes(answer),
        sections.search(answer),
        _figures(folder, figures),
        sections.settings(answer),
        sections.limits(),
    )
    page = join(
        [
            Html("<!DOCTYPE html>\n"),
            Html('<html lang="en"><head><meta charset="utf-8">'),
            Html('<meta name="viewport" content="width=device-width, initial-scale=1">'),
            Html(f'<meta http-equiv="Content-Security-Policy" content="{html.escape(POLICY)}">'),
            element("title", f"Design search {folder.name}"),
            Html(f"<style>\n{_part('page.css')}</style></head><body>\n"),
            content,
            "" if data is None else page_data.script(data),
            "" if data is None else _script(),
            Html("\n</body></html>\n"),
        ]
    )
    path = folder / "report.html"
    write_text(path, page)
    return path


def _script() -> Html:
    code = _part("plot.js") + _part("page.js")
    return Html(f'<script>\n(() => {{\n"use strict";\n{code}}})();\n</script>')


def _part(name: str) -> str:
    return files("optimize.page").joinpath(name).read_text(encoding="utf-8")


def _head(name: str, answer: Answer) -> Html:
    parts = [
        element("h1", f"Design search “{name}”"),
        element("p", "Made by this command:"),
        element("code", answer.command, class_="command", tabindex="0"),
    ]
    if not answer.finished:
        warning = f"This run is not finished (status: {answer.status}). What it came to is below."
        parts.append(element("p", warning, class_="warning", role="alert"))
    return element("header", *parts)


def _figures(folder: Path, names: Sequence[str]) -> Html:
    parts = []
    for name in names:
        picture = base64.b64encode((folder / name).read_bytes()).decode()
        caption = html.escape(FIGURES[name])
        image = Html(f'<img src="data:image/png;base64,{picture}" alt="{caption}">')
        parts.append(element("figure", image, element("figcaption", FIGURES[name])))
    return section("Figures", *(parts or [missing("figures")]))
