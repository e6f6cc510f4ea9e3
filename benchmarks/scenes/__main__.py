"""`python -m benchmarks.scenes`: what each thing left out of a scene saves."""

from pathlib import Path

from benchmarks.setting import set_up_to_time
from jaxcrusher.files.program import program


def main(out: Path = Path("results/scenes")) -> None:
    """Measure what each thing left out of a scene saves; about a minute.

    Operations of the traced program, trace and compile time, and the time of a run: one turn of
    the quiet motion at 30 rad/s, 0.06 mm.

    Args:
        out: Folder that scenes.md and scenes.csv are written to.
    """
    from benchmarks.scenes.run import run

    run(out)


if __name__ == "__main__":
    program(main, set_up_to_time)
