"""`python -m optimize.balance`: the counterweight and links that shake the foundation least."""

import tyro
from rich.console import Console

import jaxcrusher as jc
from jaxcrusher.commands.ending import told_in_one_line
from optimize.balance.options import Options
from optimize.balance.study import run


def main() -> None:
    """Entry point of the command line."""
    jc.set_up()
    options = tyro.cli(Options, prog="python -m optimize.balance")
    console = Console()
    folder = options.out / options.name
    kept = f"what was finished is in {folder}/; the same command goes on"
    with told_in_one_line(console, lambda: kept):
        run(options, console)


if __name__ == "__main__":
    main()
