"""`python -m benchmarks.stability`: stiff and extreme cases, judged."""

from pathlib import Path

from jaxcrusher.commands.program import program


def main(out: Path = Path("results/stability")) -> None:
    """Judge every stiff and extreme case; about eleven minutes.

    Args:
        out: Folder of stability.md, .csv and .png.
    """
    from benchmarks.stability.run import run

    run(out)


if __name__ == "__main__":
    program(main)
