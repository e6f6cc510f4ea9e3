"""`python notebooks/make.py`: runs the notebooks and keeps what they show in them, small.

With `--html` it writes them as pages that need no network and no Python.
"""

import base64
import hashlib
import io
import os
import re
import runpy
from collections.abc import Iterator
from pathlib import Path

from jaxcrusher.files.program import program

HERE = Path(__file__).parent
# Of a kept picture: lines and maps stay readable.
COLOURS = 24
# Names the sources that made the kept pictures.
DIGEST = "shown_by"

# Formulas in Markdown, displayed and in a line.
_DISPLAYED, _INLINE = re.compile(r"\$\$(.+?)\$\$", re.DOTALL), re.compile(r"\$(.+?)\$")
# JupyterLab's page without the scripts that it would load from the network.
_PAGE = """{% extends "lab/index.html.j2" %}
{% block html_head_js %}{% endblock %}
{% block html_head_js_mathjax %}{% endblock %}
{% block html_head_js_mermaidjs %}{% endblock %}
"""


def main(only: str = "", html: Path | None = None) -> None:
    """Run the notebooks, each in a process of its own, and keep text and pictures in them.

    Args:
        only: The beginning of the names of those that are run, such as 03; all if empty.
        html: A folder for the notebooks as pages, with what is kept in them; nothing is run.
    """
    if html is not None:
        export(only, html)
        return
    import nbformat

    # Programs draw to files, notebooks into themselves.
    os.environ.pop("MPLBACKEND", None)
    for path in sorted(HERE.glob(f"{only}*.ipynb")):
        notebook = nbformat.read(path, as_version=4)
        metadata, before = dict(notebook.metadata), os.times()
        execute(notebook)
        for cell in notebook.cells:
            if cell.cell_type == "code":
                cell.outputs, cell.execution_count = list(kept(cell.outputs)), None
        notebook.metadata = nbformat.from_dict(metadata | {DIGEST: digest(notebook)})
        nbformat.write(notebook, path)
        after = os.times()
        used = sum(after[2:4]) - sum(before[2:4])
        print(f"{path.name}: {used:.0f} s of processor, {path.stat().st_size / 1e3:.0f} kB")


def execute(notebook) -> None:
    """Put in what a notebook's code shows now, in a kernel of its own."""
    from nbclient import NotebookClient

    client = NotebookClient(notebook, timeout=600, record_timing=False)
    client.resources = {"metadata": {"path": str(HERE)}}
    client.execute()


def export(only: str, folder: Path) -> None:
    """Write the notebooks as pages, with formulas as MathML and pictures inside."""
    import nbformat
    from jinja2 import DictLoader
    from nbconvert import HTMLExporter

    loader = DictLoader({"page.html.j2": _PAGE})
    exporter = HTMLExporter(extra_loaders=[loader], template_file="page.html.j2")
    folder.mkdir(parents=True, exist_ok=True)
    for path in sorted(HERE.glob(f"{only}*.ipynb")):
        notebook = nbformat.read(path, as_version=4)
        for cell in notebook.cells:
            if cell.cell_type == "markdown":
                cell.source = alone(cell.source)
        page, _ = exporter.from_notebook_node(notebook, {"metadata": {"name": path.stem}})
        (folder / f"{path.stem}.html").write_text(page, encoding="utf-8")


def alone(markdown: str) -> str:
    """Turn formulas into MathML, put pictures in, and lead links to pages.

    The documentation's pages are expected in build/site where these are in build/notebooks.
    """
    mathml = runpy.run_path(str(HERE.parent / "docs" / "hooks.py"))["mathml"]

    def made(display: str):
        # A bar would end a cell of a table.
        return lambda found: mathml(found[1], display).replace("|", "&#124;")

    def put_in(found: re.Match[str]) -> str:
        encoded = base64.b64encode((HERE / found[2]).read_bytes()).decode()
        return f"![{found[1]}](data:image/png;base64,{encoded})"

    shown = _INLINE.sub(made("inline"), _DISPLAYED.sub(made("block"), markdown))
    shown = re.sub(r"!\[([^]]*)\]\(([^)]+\.png)\)", put_in, shown)
    shown = re.sub(r"\]\(\.\./(docs/)?", "](../site/", shown)
    return re.sub(r"(\]\([\w./]+)\.(md|ipynb)", r"\1.html", shown)


def digest(notebook) -> str:
    """Of the code that shows something: with another one the kept pictures are not current."""
    sources = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    return hashlib.sha256("\0".join(sources).encode()).hexdigest()[:16]


def kept(outputs) -> Iterator[dict]:
    """What is printed, and pictures, or else the plain text of what is shown."""
    from nbformat.v4 import new_output

    for output in outputs:
        if output.output_type == "stream" and output.name == "stdout":
            yield output
        elif output.output_type in ("display_data", "execute_result"):
            data = output.data
            found = {"text/plain": data.get("text/plain", "")}
            if "image/png" in data:
                found = {"image/png": in_few_colours(data["image/png"])}
            yield new_output("display_data", found)


def in_few_colours(encoded: str) -> str:
    """A PNG in base64 as a smaller one."""
    from PIL import Image

    picture = Image.open(io.BytesIO(base64.b64decode(encoded))).convert("RGB")
    small = io.BytesIO()
    # By coverage: what is small keeps its colour.
    few = picture.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    few.save(small, "PNG", optimize=True)
    return base64.b64encode(small.getvalue()).decode()


if __name__ == "__main__":
    program(main, prepare=None)
