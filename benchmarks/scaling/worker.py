"""`python -m benchmarks.scaling.worker`: the rows of one process, a line of JSON each."""

from typing import Annotated

import tyro

from jaxcrusher.files.program import program


def main(what: Annotated[str, tyro.conf.Positional]) -> None:
    """Measure and print.

    Args:
        what: designs, turns, or how to differentiate.
    """
    import json

    from benchmarks.scaling.measure import measure

    for row in measure(what):
        print(json.dumps(row), flush=True)


if __name__ == "__main__":
    program(main)
