"""`python -m benchmarks.settled`: a map of settled motions, and a branch round its fold."""

from pathlib import Path

from jaxcrusher.files.program import program


def main(out: Path = Path("results/settled")) -> None:
    """Solve 61 x 46 designs for both readings of slip, and follow a branch; about two minutes.

    Args:
        out: Folder of settled.png.
    """
    from benchmarks.settled.run import run

    run(out)


if __name__ == "__main__":
    program(main)
