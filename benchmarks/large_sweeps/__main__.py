"""`python -m benchmarks.large_sweeps`: what a large sweep costs, and what its bits depend on."""

from benchmarks.setting import set_up_to_time
from jaxcrusher.files.program import program


def main() -> None:
    """Print what a large sweep costs in time and storage, and what its bits depend on.

    These are the figures of docs/large_sweeps.md; some minutes.
    """
    from benchmarks.large_sweeps.run import run

    run()


if __name__ == "__main__":
    program(main, set_up_to_time)
