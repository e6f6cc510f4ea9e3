"""`python -m benchmarks.kills`: runs killed at random moments, and whether they end the same."""

from pathlib import Path

from jaxcrusher.files.program import program


def main(
    seed: int = 1,
    count: int = 50,
    jobs: tuple[str, ...] = ("sweep", "map", "search", "identify"),
    out: Path = Path("results/kills"),
) -> None:
    """Kill a sweep, an orbit map, an identification and a small search, and go on with each.

    Half an hour. Each is also run twice at once in one folder, into a folder that may not be
    written, and on a disk that is full; for the last two only root may make the disks.

    Args:
        seed: Seed of the moments and the signals.
        count: How many kills, shared by the jobs.
        jobs: Which of the four.
        out: Folder of all runs; what is there is deleted.
    """
    from benchmarks.kills.run import run

    run(out, seed, count, jobs)


if __name__ == "__main__":
    program(main, prepare=None)
