"""`python -m benchmarks.stability`: stiff and extreme cases, judged."""

from pathlib import Path
from typing import Annotated, Literal

import tyro

from jaxcrusher.files.program import program


def main(
    of: Annotated[tuple[Literal["bearing", "seats"], ...], tyro.conf.Positional] = (),
    out: Path = Path("results/stability"),
    table: Path | None = None,
) -> None:
    """Judge every stiff and extreme case of the bearing A, and of the seats B and C.

    Three quarters of an hour on two cores, of which the bearing takes eleven minutes.

    Args:
        of: The bearing A, the seats B and C, or both.
        out: Folder of stability.md, .csv and .png, and the same of stability_seats.
        table: A csv of an earlier run, to draw its figure again without judging.
    """
    from benchmarks.stability.run import redraw, run

    if table is not None:
        redraw(out, table)
        return
    for what in of or ("bearing", "seats"):
        run(what, out)


if __name__ == "__main__":
    program(main)
