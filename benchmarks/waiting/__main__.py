"""`python -m benchmarks.waiting`: the error of the settled RMS against run time."""

from pathlib import Path

from jaxcrusher.files.program import program


def main(out: Path = Path("results/waiting"), seconds: float = 20.0) -> None:
    """The settled RMS solved for, and by programs that integrate until the motion settles.

    Writes waiting.md and waiting.png; three minutes. Needs the extra `bench`.

    Args:
        out: Folder of the two.
        seconds: No run is begun that will take longer.
    """
    from benchmarks.waiting.run import run

    run(out, seconds)


if __name__ == "__main__":
    program(main)
