"""The scene that a file describes, a crusher's or that of any linkage."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from jaxcrusher.basics.checks import require_choice
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.scenes.build import build_scene, by_stroke
from jaxcrusher.scenes.echo import units_of, units_of_file
from jaxcrusher.scenes.linkages import read_linkage, require_closing
from jaxcrusher.scenes.parameters import complete
from jaxcrusher.scenes.scene_file import (
    naming,
    read_entries,
    read_overrides,
    read_scene_file,
    scene_of,
)

KINDS = ("crusher", "linkage")


class Described(NamedTuple):
    """A scene, the numbers and choices that describe it, and what makes another one of others."""

    values: dict[str, Any]
    scene: AbstractScene
    make: Callable[..., AbstractScene] | None  # None: `jaxcrusher.build_scene`
    given: dict[str, Any]  # those of the values that were written
    units: dict[str, str]  # that they were written in
    defaults: tuple[str, ...] = ()  # of a linkage, names that were not

    @property
    def structure(self) -> dict[str, str]:
        """Return what besides the values decides what a scene does."""
        return {} if self.make is None else {"drawing": repr(self.make)}

    def build(self, values: dict[str, Any]) -> AbstractScene:
        """Return the scene of other numbers and choices."""
        return build_scene(values) if self.make is None else self.make(**values)


def kind_of(path: Path | None) -> str:
    """Return the `kind` of a scene file, a crusher's where it says none.

    Raises ValueError for another one.
    """
    kind = dict(() if path is None else read_entries(path)).get("kind", KINDS[0])
    with naming(path):
        require_choice("kind", kind, KINDS)
    return kind


def described(path: Path | None, overrides: Sequence[tuple[str, str]] = ()) -> Described:
    """Return the scene of a file and of what overrides it; None is the paper's crusher.

    Raises ValueError of one line for what cannot be read or built.
    """
    if kind_of(path) == "linkage":
        assert path is not None
        drawing, values, defaults = read_linkage(path)
        changed = read_overrides(overrides)
        values = drawing.whole(values | changed)
        left = tuple(name for name in defaults if name not in changed)
        scene = drawing(**values)
        require_closing(scene)
        return Described(values, scene, drawing, values, _units(path, overrides), left)
    given = given_by(path, overrides)
    values = complete(given)
    return Described(values, scene_of(values, path, given), None, given, _units(path, overrides))


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
    return described(Path(path)).scene
