"""How every program begins and ends: options, Ctrl-C, errors, a console of any encoding.

Nothing here imports JAX, and what a program needs it imports after its options are read: `--help`
and a mistyped option are answered at once.
"""

import contextlib
import functools
import io
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NoReturn

from jaxcrusher.basics.setup import set_up
from jaxcrusher.files.provenance import program_words

EXTRA = "the extra `bench` has all: pip install 'jaxcrusher[bench]'."


def program(
    main: Callable[..., int | None], prepare: Callable[[], None] | None = set_up
) -> NoReturn:
    """Run `main` with the options of the command line; its signature and docstring are the help.

    Exits with what `main` returns, with 2 for an error and with 130 for Ctrl-C, each of these with
    one line on stderr (`python -X dev` shows where an error is from). `prepare` is called between
    the options and `main`.
    """
    # A file or a pipe may be of any encoding: what it has no sign for becomes a "?".
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    # Figures go to files.
    os.environ["MPLBACKEND"] = "Agg"
    try:
        run = parse(main)
        if prepare is not None:
            prepare()
        status = run()
    except (ValueError, RuntimeError, OSError, ImportError) as error:
        if sys.flags.dev_mode:
            raise
        missing = isinstance(error, ModuleNotFoundError)
        _tell(f"error: {f'{error.name} is missing; {EXTRA}' if missing else error}")
        status = 2
    except KeyboardInterrupt as stop:
        _tell(": ".join(["interrupted", *map(str, stop.args)]))
        status = 130
    sys.exit(status)


def parse(
    main: Callable[..., int | None], arguments: Sequence[str] | None = None
) -> Callable[[], int | None]:
    """`main` bound to the options of a command line, of `sys.argv` if none are given.

    Raises ValueError of one line for options that `main` does not have.
    """
    import tyro

    @functools.wraps(main)
    def bound(*positional: object, **named: object) -> Callable[[], int | None]:
        return functools.partial(main, *positional, **named)

    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return tyro.cli(  # pyright: ignore
                bound,
                prog=" ".join(program_words()),
                args=arguments,
                config=(tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes),
            )
    except SystemExit as stop:
        if stop.code == 0:
            raise
        raise ValueError(_in_one_line(said.getvalue())) from None


def _in_one_line(message: str) -> str:
    """What tyro says in a frame of several parts: what is wrong, and which options are like it."""
    lines = [line.strip("│ ") for line in message.splitlines()[1:-1]]
    parts = re.split(r"^─+$", "\n".join(lines), flags=re.MULTILINE)
    wrong = " ".join(parts[0].split()).removesuffix(".")
    similar = dict.fromkeys(re.findall(r"^--[\w-]+", "\n".join(parts[1:]), re.MULTILINE))
    hint = f" Is it {' or '.join(similar)}?" if similar else ""
    return f"{wrong}.{hint} --help tells all."


@contextlib.contextmanager
def keeping(folder: Path) -> Iterator[None]:
    """Let the line after Ctrl-C say what is left in `folder`."""
    try:
        yield
    except KeyboardInterrupt:
        kept = f"what was finished is in {folder}/" if folder.exists() else "nothing was written"
        raise KeyboardInterrupt(kept) from None


def _tell(line: str) -> None:
    print(" ".join(line.split()), file=sys.stderr)
