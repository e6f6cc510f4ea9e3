"""How a program ends that cannot go on."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.markup import escape


@contextmanager
def told_in_one_line(console: Console, kept: Callable[[], str]) -> Iterator[None]:
    """Exit with 2 for an error, with 130 for Ctrl-C, and a line on `console`.

    After Ctrl-C it says what is `kept`.
    """
    try:
        yield
    except (ValueError, RuntimeError, OSError, ImportError) as error:
        line = escape(" ".join(str(error).split()))
        console.print(f"[red]error:[/] {line}", highlight=False, soft_wrap=True)
        sys.exit(2)
    except KeyboardInterrupt:
        console.print(f"interrupted: {escape(kept())}", highlight=False, soft_wrap=True)
        sys.exit(130)
