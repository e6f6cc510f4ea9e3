"""`python -m benchmarks.work_precision`: error against run time, every program and scene."""

from pathlib import Path

from benchmarks.setting import set_up_to_time
from jaxcrusher.commands.program import program


def main(
    out: Path = Path("results/work_precision"), scenes: tuple[str, ...] = (), small: bool = False
) -> None:
    """Measure error against run time, for every program and scene; ten minutes.

    Writes work_precision.csv as it goes, then work_precision.md and .png. Needs the extra `bench`.

    Args:
        out: Folder of the three.
        scenes: Some of quiet, impacting, whirl and "ideal joint"; all without one.
        small: A few settings only, to try it.
    """
    from benchmarks.work_precision.run import run

    run(out, scenes, small)


if __name__ == "__main__":
    program(main, set_up_to_time)
