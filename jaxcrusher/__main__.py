"""`python -m jaxcrusher`: simulate, sweep, classify and differentiate a crusher."""

import sys
from collections.abc import Sequence
from typing import Annotated

import matplotlib
import tyro
from rich.console import Console

import jaxcrusher as jc
from jaxcrusher.commands.ending import told_in_one_line
from jaxcrusher.commands.gradient import Gradient
from jaxcrusher.commands.regimes import Regimes
from jaxcrusher.commands.simulate import Simulate
from jaxcrusher.commands.sweep import Sweep

Command = (
    Annotated[Simulate, tyro.conf.subcommand("simulate")]
    | Annotated[Sweep, tyro.conf.subcommand("sweep")]
    | Annotated[Regimes, tyro.conf.subcommand("regimes")]
    | Annotated[Gradient, tyro.conf.subcommand("gradient")]
)


def parse(arguments: Sequence[str] | None = None) -> Simulate | Sweep | Regimes | Gradient:
    """The command with its options, of `sys.argv` if none are given."""
    return tyro.cli(
        Command,  # pyright: ignore
        prog="python -m jaxcrusher",
        description="Simulate a jaw crusher whose main bearing has clearance.",
        args=arguments,
        config=(tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes),
    )


def main() -> None:
    """Entry point of the command line: 0, 1 for a failed run, 2 for an error, 130 for Ctrl-C."""
    matplotlib.use("Agg")
    jc.set_up()
    command = parse()

    def kept() -> str:
        path = command.results.path
        return f"what was finished is in {path}/" if path.exists() else "nothing was written"

    with told_in_one_line(Console(stderr=True), kept):
        sys.exit(command.run(Console()))


if __name__ == "__main__":
    main()
