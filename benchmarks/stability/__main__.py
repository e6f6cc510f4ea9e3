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
        of: Of what; of both without one.
        out: Folder of stability.md, .csv and .png, and the same of stability_seats.
        table: A csv of an earlier run, to draw its figure again without judging.
    """
    from benchmarks.stability.run import redraw, run, run_seats

    if table is not None:
        redraw(out, table)
        return
    for what, judge in (("bearing", run), ("seats", run_seats)):
        if what in of or not of:
            judge(out)


if __name__ == "__main__":
    program(main)
