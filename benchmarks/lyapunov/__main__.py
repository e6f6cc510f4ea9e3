"""`python -m benchmarks.lyapunov`: exponents from tangents against those from a series alone."""

from pathlib import Path

from jaxcrusher.files.program import program


def main(out: Path = Path("results/lyapunov")) -> None:
    """Measure largest exponents from tangents, beside published ones and nolds' estimators.

    Four systems of the field and a chaotic crusher. Needs nolds (extra `bench`); 0.6.3 cannot be
    imported under Python 3.11, 0.6.2 can. Some minutes.

    Args:
        out: Folder that lyapunov.md is written to.
    """
    from benchmarks.lyapunov.run import run

    run(out)


if __name__ == "__main__":
    program(main)
