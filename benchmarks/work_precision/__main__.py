"""`python -m benchmarks.work_precision`: error against run time, every program and scene."""

from pathlib import Path

from benchmarks.setting import set_up_to_time
from jaxcrusher.files.program import program


def main(
    out: Path = Path("results/work_precision"),
    scenes: tuple[str, ...] = (),
    small: bool = False,
    table: Path | None = None,
) -> None:
    """Measure error against run time, for every program and scene; ten minutes.

    Writes work_precision.csv as it goes, then work_precision.md and its figures. Needs the extra
    `bench`.

    Args:
        out: Folder of them all.
        scenes: Some of quiet, impacting, whirl and "ideal joint"; all without one.
        small: A few settings only, to try it.
        table: The csv of an earlier run, to draw its figures again without measuring.
    """
    from benchmarks.work_precision.run import redraw, run

    if table is None:
        run(out, scenes, small)
    else:
        redraw(out, table)


if __name__ == "__main__":
    program(main, set_up_to_time)
