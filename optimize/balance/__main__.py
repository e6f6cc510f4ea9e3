"""`python -m optimize.balance`: the counterweight and links that shake the foundation least."""

from typing import Annotated

import tyro

from jaxcrusher.files.program import keeping, program
from optimize.balance.options import Options


def study(options: Annotated[Options, tyro.conf.arg(name="study")]) -> None:
    """Choose counterweight, mass centre and links of a PE250x400 that shake its foundation least,
    at equal stroke, capacity and speed: a gradient search against two rivals without gradients.
    Interrupted, the same command goes on where it was.
    """  # noqa: D205
    from rich.console import Console

    from optimize.balance.study import run

    with keeping(options.folder):
        run(options, Console())


if __name__ == "__main__":
    program(study)
