"""`python -m benchmarks.scaling`: cost by designs, turns, cores and differentiated parameters."""

from pathlib import Path

from jaxcrusher.files.program import program


def main(out: Path = Path("results/scaling")) -> None:
    """Measure how the cost grows with designs, turns, cores and differentiated parameters.

    In processes of their own, pinned to one core or to two; twelve minutes. Each measurement is
    written to scaling.csv as it comes, at the end scaling.md and scaling.png.

    Args:
        out: Folder of scaling.md, .csv and .png.
    """
    from benchmarks.scaling.run import run

    run(out)


if __name__ == "__main__":
    program(main)
