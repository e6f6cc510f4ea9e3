"""`python -m benchmarks.joints`: which worn joint shakes the foundation, and how it is told."""

from pathlib import Path
from typing import Literal

from jaxcrusher.files.program import program


def main(out: Path = Path("results/joints"), slip: Literal["centre", "surface"] = "centre") -> None:
    """Foundation force, impacts and wear by the clearance of A, B and C, from new to worn.

    Writes which_joint.md, which_joint.png and which_joint.csv; four minutes on two cores.

    Args:
        out: Folder of the three.
        slip: What friction reads: of the centres, as in the paper, or of the surfaces.
    """
    from benchmarks.joints.run import run

    run(out, slip)


if __name__ == "__main__":
    program(main)
