"""`python -m benchmarks.reproduction`: the paper's figures and numbers."""

from pathlib import Path

from jaxcrusher.files.program import program


def main(out: Path = Path("results/reproduction")) -> None:
    """Redraw every figure of the paper's results and check its numbers; about five minutes.

    Needs EXUDYN (extra `bench`).

    Args:
        out: Folder of the figures and of claims.md.
    """
    from benchmarks.reproduction.run import run

    run(out)


if __name__ == "__main__":
    program(main)
