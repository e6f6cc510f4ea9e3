"""`python -m benchmarks.waiting`: the error of the steady-state RMS against run time."""

from pathlib import Path

from jaxcrusher.files.program import program


def main(out: Path = Path("results/waiting"), seconds: float = 20.0) -> None:
    """Solve for the steady-state RMS, and wait for it by programs that integrate; three minutes.

    Writes waiting.md, waiting.csv and waiting.png. Needs the extra `bench`.

    Args:
        out: Folder of the three.
        seconds: No run is begun that will take longer.
    """
    from benchmarks.waiting.run import run

    run(out, seconds)


if __name__ == "__main__":
    program(main)
