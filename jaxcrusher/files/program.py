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

# What tyro adds of other commands and of what `--help` tells.
# A text that is no value of the option's type.
_WRONG = (
    r"Error parsing (\S+): (?:no type matching (?:{None}\|)?{?(.+?)}? could .*? from \[(.*?)\]"
    r"|invalid literal for int\(\) with base 10: (.*))"
)
_HELPS = ("Perhaps you meant", "Arguments similar to", "Argument helptext", "For full helptext")
_ASIDE = r"(Got errors:|Arguments are applied).*"
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

    said, usage = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return read(words)
    except SystemExit as stop:
        if stop.code == 0:
            raise
    with contextlib.redirect_stdout(usage), contextlib.suppress(SystemExit):
        read([*(word for word in words[:1] if not word.startswith("-")), "--help"])
    raise ValueError(_in_one_line(said.getvalue(), usage.getvalue()))


def _in_one_line(message: str, usage: str) -> str:
    """Return tyro's message in one line, and known words that resemble its first unknown one.

    `usage` is the help of the program, or of its command.
    """
    lines = [line.strip("│ ") for line in message.splitlines()[1:-1]]
    # A terminal without such signs has a line of hyphens, also below the title.
    parts = re.split(r"^[─-]+$", "\n".join(lines), flags=re.MULTILINE)
    name = " ".join(usage.partition("[-h]")[0].split()[1:])
    plain = [re.sub(_ASIDE, "", " ".join(part.split())) for part in parts]
    plain = [part.replace(f" (applied to {name})", "").strip() for part in plain]
    told = [part.rstrip(".") for part in plain if part and not part.startswith(_HELPS)]
    told[0] = re.sub(_WRONG, lambda wrong: _must_be(*wrong.groups()), told[0])
    unknown = re.match(r"Unrecognized.*?: ([\w-]+)", told[0])
    # Options, and commands in braces.
    known = {*re.findall(r"--[a-z][\w-]*|(?<=[{,])\w+(?=[,}])", usage)}
    near = get_close_matches(unknown[1], known, n=2) if unknown else []
    is_it = f" Is it {' or '.join(near)}?" if near else ""
    return f"{'. '.join(told)}.{is_it} {name} --help tells all."


def _must_be(option: str, types: str | None, given: str | None, no_integer: str | None) -> str:
    return f"{option} must be {types or 'INT'}, but is {given or no_integer or 'nothing'}"


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
