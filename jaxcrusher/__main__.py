"""`python -m jaxcrusher`: simulate, sweep, classify and differentiate a crusher."""

import importlib

from jaxcrusher.commands.options import Command
from jaxcrusher.files.program import keeping, program


def run(command: Command) -> int:
    """Simulate a jaw crusher whose main bearing has clearance."""
    from rich.console import Console

    # Each command is a module of its own, and needs only what it computes with.
    module = importlib.import_module(f"jaxcrusher.commands.{type(command).__name__.lower()}")
    with keeping(command.results.folder):
        return module.run(command, Console(highlight=False, soft_wrap=True))


def main() -> None:
    """Entry point of the command line."""
    program(run)


if __name__ == "__main__":
    main()
