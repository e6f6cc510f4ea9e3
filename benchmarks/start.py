"""The beginning of a benchmark that has a folder for its only option."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import NoReturn

from jaxcrusher.basics.setup import set_up
from jaxcrusher.files.program import program


def start(package: str, writes: str, prepare: Callable[[], None] = set_up) -> NoReturn:
    """Call `run(out)` of a package's module `run`; the package's docstring is the help.

    `writes` names what is written to the folder. `prepare` is that of `program`.
    """
    folder = Path("results") / package.rpartition(".")[2]

    def main(out: Path = folder) -> None:
        import_module(f"{package}.run").run(out)

    about = import_module(package).__doc__
    main.__doc__ = f"{about}\n\nArgs:\n    out: Folder of {writes}.\n"
    program(main, prepare)
