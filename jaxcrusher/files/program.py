"""How every program begins and ends: options, Ctrl-C, errors, a console of any encoding.

Nothing here imports JAX, and what a program needs it imports after its options are read: `--help`
and a mistyped option are answered at once.
"""

import atexit
import contextlib
import functools
import gc
import io
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import NoReturn

from jaxcrusher.basics.setup import UnusualNumbers, set_up
from jaxcrusher.files.provenance import program_words
from jaxcrusher.files.results import tell
from jaxcrusher.files.resume import SETTINGS

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
    # To look for garbage among all that was traced takes a second at the end of the process.
    atexit.register(gc.freeze)
    # Figures go to files.
    os.environ["MPLBACKEND"] = "Agg"
    # Commands tell what is unusual of the crusher that they are given, in a line of their own.
    warnings.simplefilter("ignore", UnusualNumbers)
    try:
        run = parse(main)
        if prepare is not None:
            prepare()
        status = run()
    except (ValueError, RuntimeError, OSError, ImportError) as error:
        if sys.flags.dev_mode:
            raise
        missing = isinstance(error, ModuleNotFoundError)
        tell(f"error: {f'{error.name} is missing; {EXTRA}' if missing else error}")
        status = 2
    except KeyboardInterrupt as stop:
        tell(": ".join(["interrupted", *map(str, stop.args)]))
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

    name = " ".join(program_words())
    words = list(sys.argv[1:] if arguments is None else arguments)

    def read(words: Sequence[str]) -> Callable[[], int | None]:
        return tyro.cli(  # pyright: ignore
            bound,
            prog=name,
            args=words,
            config=(tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes),
        )

    def told(words: Sequence[str]) -> str:
        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(io.StringIO()):
            with contextlib.suppress(SystemExit):
                read([*words, "--help"])
        return said.getvalue()

    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return read(words)
    except SystemExit as stop:
        if stop.code == 0:
            raise
        raise ValueError(_in_one_line(said.getvalue(), words, name, told)) from None


def _in_one_line(
    message: str, words: list[str], name: str, told: Callable[[Sequence[str]], str]
) -> str:
    """Return tyro's message in one line, and known words that resemble unknown ones.

    `told` is the help after some words of the program `name`.
    """
    commands = re.search(r"\{(\w+(?:,\w+)+)\}", told([]).split("\n\n")[0])
    offered = commands[1].split(",") if commands else []
    if offered and (not words or words[0] not in offered):
        given = words[0] if words else "none"
        near = _like(given, offered)
        return f"The first word must be a command, but is {given}.{near} {name} --help tells all."
    line = [name, *(words[:1] if offered else [])]
    lines = [line.strip("│ ") for line in message.splitlines()[1:-1]]
    # A terminal without such signs has a line of hyphens, also below the title.
    parts = re.split(r"^[─-]+$", "\n".join(lines), flags=re.MULTILINE)
    wrong = next(" ".join(part.split()) for part in parts if part.strip())
    near = ""
    if wrong.startswith("Unrecognized"):
        known = re.findall(r"^[│ ]*(--[a-z][\w-]*)", told(line[1:]), re.MULTILINE)
        unknown = [word for word in words if word.startswith("--") and word not in known]
        if unknown:
            wrong, near = f"There is no {unknown[0]}", _like(unknown[0], [*dict.fromkeys(known)])
        else:
            wrong = f"What is meant by {wrong.partition(':')[2].strip()}?"
    elif found := re.match(
        r"Error parsing (\S+): no type matching (?:{None}\|)?{?(.+?)}? could .*? from \[(.*?)\]",
        wrong,
    ):
        wrong = f"{found[1]} must be {found[2]}, but is {found[3] or 'nothing'}"
    end = "" if wrong[-1] in ".?" else "."
    return f"{wrong}{end}{near} {' '.join(line)} --help tells all."


def _like(word: str, offered: Sequence[str]) -> str:
    near = get_close_matches(word, offered, n=2)
    return f" Is it {' or '.join(near)}?" if near else f" There are {', '.join(offered)}."


@contextlib.contextmanager
def keeping(folder: Path) -> Iterator[None]:
    """Let the line after Ctrl-C say what is left in `folder`."""
    try:
        yield
    except KeyboardInterrupt:
        found = sorted(folder.iterdir()) if folder.exists() else []
        names = [
            path.name for path in found if path.name != SETTINGS and ".partial" not in path.name
        ]
        kept = f"what was finished is in {folder}/: {', '.join(names)}"
        raise KeyboardInterrupt(kept if names else "nothing was written") from None
