"""The machine that a file describes, a crusher or any linkage."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from jaxcrusher.basics.checks import require_choice
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.scenes.build import by_stroke
from jaxcrusher.scenes.crusher import Crusher
from jaxcrusher.scenes.echo import units_of, units_of_file
from jaxcrusher.scenes.linkages import read_linkage, require_closing
from jaxcrusher.scenes.machine import Machine
from jaxcrusher.scenes.parameters import complete
from jaxcrusher.scenes.scene_file import (
    naming,
    read_entries,
    read_overrides,
    read_scene_file,
    scene_of,
)

KINDS = ("crusher", "linkage")


def kind_of(path: Path | None) -> str:
    """Return the `kind` of a scene file, a crusher's where it says none.

    Raises ValueError for another one.
    """
    kind = dict(() if path is None else read_entries(path)).get("kind", KINDS[0])
    with naming(path):
        require_choice("kind", kind, KINDS)
    return kind


def read_machine(path: Path | str | None, overrides: Sequence[tuple[str, str]] = ()) -> Machine:
    """Return the machine of a TOML file, a crusher or, with `kind = "linkage"`, any linkage.

    `overrides` are names with texts that stand in the place of the file's. With no file they are of
    the paper's crusher. Raises ValueError of one line, with the file and the key, for what cannot
    be read or built.
    """
    path = None if path is None else Path(path)
    units = _units(path, overrides)
    if kind_of(path) == "linkage":
        assert path is not None
        found = replace(read_linkage(path), units=units)
        if overrides:
            found = found.replace(**read_overrides(overrides))
            require_closing(found.scene())
        return found
    given = given_by(path, overrides)
    scene_of(complete(given), path, given)
    return Machine(Crusher(), given, units)


def _units(path: Path | None, overrides: Sequence[tuple[str, str]]) -> dict[str, str]:
    return units_of_file(path) | units_of(overrides)


def given_by(path: Path | None, overrides: Sequence[tuple[str, str]] = ()) -> dict[str, Any]:
    """Return the values that a crusher's scene file and what overrides it give."""
    if path is None:
        return by_stroke(read_overrides(overrides))
    return read_scene_file(path, overrides)


def read_scene(path: Path | str) -> AbstractScene:
    """Return the scene of a TOML file, a crusher's or, with `kind = "linkage"`, of any linkage.

    Raises ValueError of one line, with the file and the key.
    """
    return read_machine(path).scene()
