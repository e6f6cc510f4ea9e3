"""`python -m benchmarks.mutants`: random faults, and whether the tests of their room see them."""

import tempfile
from pathlib import Path

from jaxcrusher.files.program import program

SCRATCH = Path(tempfile.gettempdir()) / "mutants"


def main(
    seed: int = 1,
    count: int = 200,
    rooms: tuple[str, ...] = (),
    seconds: float = 120.0,
    out: Path = Path("results/mutants"),
    scratch: Path = SCRATCH,
) -> None:
    """Put random faults into a copy of the tree, one at a time, and run the tests of their room.

    Half a minute a fault. Interrupted, the same command goes on where it was: OUT/mutants.jsonl
    has a line for each fault. A fault whose tests were stopped is judged again.

    Args:
        seed: Seed of the draw.
        count: How many faults are drawn.
        rooms: Rooms to draw from, as joint, crusher or optimize; all if none is named.
        seconds: A room's tests are stopped after this processor time.
        out: Folder of the journal.
        scratch: Folder of the copy and of its compiled programs.
    """
    from benchmarks.mutants.run import run

    run(out, scratch, seed, count, rooms, seconds)


if __name__ == "__main__":
    program(main, prepare=None)
