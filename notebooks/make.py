"""`python notebooks/make.py`: runs the notebooks and keeps what they show in them, small."""

import base64
import hashlib
import io
import os
from collections.abc import Iterator
from pathlib import Path

from jaxcrusher.files.program import program

HERE = Path(__file__).parent
# Of a kept picture: lines and maps stay readable.
COLOURS = 24
# Names the sources that made the kept pictures.
DIGEST = "shown_by"


def main(only: str = "") -> None:
    """Run the notebooks, each in a process of its own, and keep text and pictures in them.

    Args:
        only: The beginning of the names of those that are run, such as 03; all if empty.
    """
    import nbformat
    from nbclient import NotebookClient

    # Programs draw to files, notebooks into themselves.
    os.environ.pop("MPLBACKEND", None)
    for path in sorted(HERE.glob(f"{only}*.ipynb")):
        notebook = nbformat.read(path, as_version=4)
        metadata, before = dict(notebook.metadata), os.times()
        client = NotebookClient(notebook, timeout=600, record_timing=False)
        client.resources = {"metadata": {"path": str(HERE)}}
        client.execute()
        for cell in notebook.cells:
            if cell.cell_type == "code":
                cell.outputs, cell.execution_count = list(kept(cell.outputs)), None
        notebook.metadata = nbformat.from_dict(metadata | {DIGEST: digest(notebook)})
        nbformat.write(notebook, path)
        after = os.times()
        used = sum(after[2:4]) - sum(before[2:4])
        print(f"{path.name}: {used:.0f} s of processor, {path.stat().st_size / 1e3:.0f} kB")


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
