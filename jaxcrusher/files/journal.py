"""Results of finished chunks of work, so that a run that was killed goes on where it was."""

import hashlib
import inspect
import io
import marshal
import re
import shutil
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any

import equinox as eqx
import numpy as np

from jaxcrusher.files.durable import read_checked, replace_checked
from jaxcrusher.files.provenance import PACKAGES, environment

Arrays = dict[str, np.ndarray]


class Journal:
    """A folder with the arrays of each finished chunk, found again by its inputs.

    The name of a chunk's file is the digest of its input, of the function that computes it, of the
    sources of this package and below the folders `sources`, and of the versions of other packages.
    Different chunks never share a file.
    """

    def __init__(self, folder: Path, *sources: Path) -> None:
        self._folder, self._sources = folder, sources

    def place(self, function: str, inputs: Iterable[Any]) -> Path:
        """Return the file of a chunk; `function` tells what is computed of the inputs.

        It is a text, as `text_of` returns it.
        """
        digest = hashlib.sha256(f"{function}\n{_programs(*self._sources)}".encode())
        for value in inputs:
            array = np.ascontiguousarray(value)
            digest.update(f"{array.dtype} {array.shape}\n".encode() + array.tobytes())
        return self._folder / f"{digest.hexdigest()[:32]}.chunk"

    def keep(self, place: Path, arrays: Arrays) -> None:
        """Write the arrays of a finished chunk."""
        self._folder.mkdir(parents=True, exist_ok=True)
        content = io.BytesIO()
        np.savez(content, **arrays)  # pyright: ignore
        replace_checked(place, content.getvalue())

    def discard(self) -> None:
        """Delete all that is kept: the work is finished and its result written."""
        shutil.rmtree(self._folder, ignore_errors=True)


def text_of(value: Any) -> str:
    """Return an object as text, with the values of its arrays.

    Addresses are left out, as they differ from process to process. Functions of one's own come with
    digests of their code and of what they close over.
    """
    return _text(value, {})


def digest_of(value: Any) -> str:
    """Return a digest of the text of an object."""
    return hashlib.sha256(text_of(value).encode()).hexdigest()[:16]


def _text(value: Any, codes: dict[FunctionType, str]) -> str:
    def look(node: Any) -> bool:
        function = inspect.unwrap(node) if callable(node) else node  # of `jax.jit` too
        if isinstance(function, FunctionType) and function not in codes:
            codes[function] = ""  # it may close over itself
            codes[function] = _code(function, codes)
        return False

    with np.printoptions(threshold=sys.maxsize, floatmode="unique"):
        text = eqx.tree_pformat(value, short_arrays=False, width=10**6, truncate_leaf=look)
    return " ".join([re.sub(" at 0x[0-9a-f]+", "", text), *filter(None, codes.values())])


def _code(function: FunctionType, codes: dict[FunctionType, str]) -> str:
    if (function.__module__ or "").partition(".")[0] in ("jaxcrusher", *PACKAGES):
        return ""  # sources or versions tell it
    # Of version 2 the bytes do not depend on what else refers to the constants.
    digest = hashlib.sha256(marshal.dumps(function.__code__, 2))
    closed = [cell.cell_contents for cell in function.__closure__ or ()]
    digest.update(_text((closed, function.__defaults__, function.__kwdefaults__), codes).encode())
    return digest.hexdigest()[:16]


def finished(place: Path) -> Arrays | None:
    """Return the arrays of a chunk's file, None where it is not there or damaged.

    The checksum is of the whole file: those of a zip file leave out its table of contents.
    """
    try:
        content = io.BytesIO(read_checked(place))
    except (OSError, ValueError):
        return None
    with np.load(content, allow_pickle=False) as file:
        return dict(file)


@cache
def _programs(*further: Path) -> str:
    """Return what decides the bits of a result besides its input."""
    sources = hashlib.sha256()
    for package in (Path(__file__).parents[1], *further):
        for path in sorted(package.rglob("*.py")):
            sources.update(path.read_bytes())
    return f"{environment()} {sources.hexdigest()}"
