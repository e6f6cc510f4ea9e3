"""`python -m benchmarks.orbits.machines`: which motion crushers of other kinds come to."""

from pathlib import Path

from jaxcrusher.files.program import program


def main(out: Path = Path("results/orbits"), count: int = 150, seed: int = 0) -> None:
    """Draw crushers, ask for the orbit of each, and print two tables; a quarter of an hour.

    Args:
        out: Folder of machines.csv.
        count: How many crushers are drawn.
        seed: Seed of the draw.
    """
    from benchmarks.orbits.drawn_machines import run

    run(out, count, seed)


if __name__ == "__main__":
    program(main)
