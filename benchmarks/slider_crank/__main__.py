"""`python -m benchmarks.slider_crank`: a slider-crank with clearance against EXUDYN and SciPy."""

from pathlib import Path

from jaxcrusher.files.program import program


def main(out: Path = Path("results/slider_crank")) -> None:
    """Print a slider-crank with clearance beside EXUDYN and SciPy, and draw it; some minutes.

    Needs EXUDYN (extra `bench`).

    Args:
        out: Folder that slider_crank.png is written to.
    """
    from benchmarks.slider_crank.run import run

    run(out)


if __name__ == "__main__":
    program(main)
