"""`python -m optimize.run`: find the design that shakes the foundation least."""

from typing import Annotated

import tyro

from jaxcrusher.files.program import keeping, program
from optimize.ask.options import Options


def search(options: Annotated[Options, tyro.conf.arg(name="search")]) -> None:
    """Find the design of a jaw crusher that shakes its foundation least, within bounds. By default
    the driving speed and bearing clearance of a PE250x400 are free, and the objective is the RMS of
    |R_O| + |R_C|. --scene and --design search any linkage with a loose joint.
    """  # noqa: D205
    from rich.console import Console

    from optimize.design_search import design_search

    with keeping(options.folder):
        answer = design_search(options, Console())
    if not (answer.finished and all(check.passed for check in answer.checks)):
        raise SystemExit(1)


if __name__ == "__main__":
    program(search)
