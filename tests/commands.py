"""Commands of the package, called as from a shell."""

import contextlib
import io

import pytest

from jaxcrusher import __main__
from jaxcrusher.files.program import parse


def run(*arguments) -> tuple[int | None, str]:
    """Exit status and what was printed, in this process."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "200")
        status = parse(__main__.run, [str(argument) for argument in arguments])()
    return status, printed.getvalue()
