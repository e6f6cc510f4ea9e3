"""`python -m benchmarks.smoothing`: the error of each smoothing width, against its run time."""

from pathlib import Path

from jaxcrusher.files.program import program


def main(out: Path = Path("results/smoothing")) -> None:
    """Measure the error of each smoothing width against its run time; two minutes.

    The reference is SciPy's DOP853 on the published laws without smoothing, stopped at every
    touch. The motion is the first 20 ms of a centred start with surface slip: impacts and free
    flight.

    Args:
        out: Folder that smoothing.md and smoothing.png are written to.
    """
    from benchmarks.smoothing.run import run

    run(out)


if __name__ == "__main__":
    program(main)
