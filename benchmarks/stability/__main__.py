"""`python -m benchmarks.stability`: stiff and extreme cases, judged."""

from pathlib import Path
from typing import Annotated, Literal

import tyro

from jaxcrusher.files.program import program

What = Literal["bearing", "seats", "drawn", "mechanisms", "orbits", "linkage_orbits", "answers"]


def main(
    of: Annotated[
        tuple[What, ...],
        tyro.conf.Positional,
    ] = (),
    out: Path = Path("results/stability"),
    count: int = 2000,
    seed: int = 1,
) -> None:
    """Judge every stiff and extreme case of the bearing A, and of the seats B and C, or drawn ones.

    Three quarters of an hour on two cores, of which the bearing takes eleven minutes.

    Args:
        of: The bearing A, the seats B and C, or crushers of every kind drawn at random, other
            mechanisms, or periodic orbits of crushers or of linkages, or times of answers; else the
            first two.
        out: Folder of stability.md, .csv and .png, and the same of stability_seats.
        count: How many crushers or mechanisms are drawn.
        seed: Seed of the draw.
    """
    from benchmarks.stability.drawn_orbits import run_answers, run_orbits
    from benchmarks.stability.drawn_run import run_drawn
    from benchmarks.stability.linkage_orbits import run_linkage_orbits
    from benchmarks.stability.mechanisms import run_mechanisms
    from benchmarks.stability.run import run

    draws = {
        "drawn": run_drawn,
        "mechanisms": run_mechanisms,
        "orbits": run_orbits,
        "linkage_orbits": run_linkage_orbits,
        "answers": run_answers,
    }
    for what in of or ("bearing", "seats"):
        if what in draws:
            draws[what](out, seed, count)
        else:
            run(what, out)


if __name__ == "__main__":
    program(main)
