"""`python -m benchmarks.engines`: programs by lanes, and one motion after the other."""

from benchmarks.setting import set_up_to_time
from jaxcrusher.files.program import program


def main() -> None:
    """Print what programs that integrate many designs take by lanes, and in turn by diffrax.

    This is a table of docs/lanes.md; some minutes.
    """
    from benchmarks.engines.run import run

    run()


if __name__ == "__main__":
    program(main, set_up_to_time)
