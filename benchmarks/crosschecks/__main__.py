"""`python -m benchmarks.crosschecks`: jaxcrusher against other programs."""

from pathlib import Path
from typing import Annotated, Literal

import tyro

from jaxcrusher.files.program import program

Case = Literal[
    "instants", "ideal", "clearance", "smoothing", "torque", "loose", "impacts", "swings", "whirl"
]


def main(
    cases: Annotated[tuple[Case, ...], tyro.conf.Positional] = (),
    out: Path = Path("results/crosschecks"),
) -> None:
    """Compare jaxcrusher with closed forms, SciPy, SUNDIALS and EXUDYN; seven minutes.

    Prints a table for each case, and writes crosschecks.md and .csv where all are run.

    Args:
        cases: What to compare; everything without one.
        out: Folder of crosschecks.md and .csv.
    """
    from benchmarks.crosschecks.run import run

    run(cases, out)


if __name__ == "__main__":
    program(main)
