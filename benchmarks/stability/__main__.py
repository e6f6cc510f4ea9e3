"""`python -m benchmarks.stability`: stiff and extreme cases, judged."""

from pathlib import Path

from jaxcrusher.commands.program import program


def main(out: Path = Path("results/stability"), table: Path | None = None) -> None:
    """Judge every stiff and extreme case; about eleven minutes.

    Args:
        out: Folder of stability.md, .csv and .png.
        table: The csv of an earlier run, to draw its figure again without judging.
    """
    from benchmarks.stability.run import redraw, run

    if table is None:
        run(out)
    else:
        redraw(out, table)


if __name__ == "__main__":
    program(main)
