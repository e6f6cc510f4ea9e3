"""Options that commands share: which crusher, which grid of crushers, where results go."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from jaxcrusher.basics.checks import require, require_choice
from jaxcrusher.files.results import results_folder
from jaxcrusher.scenes.parameters import CHOICES, PE250X400, build_scene
from jaxcrusher.scenes.scene_file import read_scene_file, read_text, require_parameter

# Repeated options: KEY VALUE pairs, and NAME LOW HIGH COUNT.
Pairs = Annotated[
    tuple[tuple[str, str], ...],
    tyro.conf.UseAppendAction,
    tyro.conf.arg(name="set", metavar="KEY VALUE"),
]
Ranges = Annotated[
    tuple[tuple[str, ...], ...],
    tyro.conf.UseAppendAction,
    tyro.conf.arg(metavar="NAME LOW HIGH COUNT"),
]


@dataclass(frozen=True)
class Crusher:
    """Which crusher."""

    scene: Path | None = None
    """TOML file of the crusher; what it leaves out is the PE250x400's."""
    overrides: Pairs = ()
    """A key of the scene file and its value, over the file's: an SI number or a quantity, as in
    --set clearance "0.06 mm" --set jaw.mass 500. May be repeated."""

    def values(self) -> dict[str, Any]:
        """Every name of `jaxcrusher.PE250X400` with its value; ValueError as a scene file's."""
        values = dict(PE250X400)
        if self.scene is not None:
            values |= read_scene_file(self.scene)
        values |= {name: read_text(name, text) for name, text in self.overrides}
        build_scene(values)
        return values

    def moving(self) -> dict[str, Any]:
        """`values` of a crusher whose pin can move in its bore; ValueError for an ideal joint."""
        values = self.values()
        good = values["joint"] == "clearance"
        require(good, "joint", "have clearance to move in", values["joint"])
        return values


@dataclass(frozen=True)
class Results:
    """Where results go."""

    name: str
    """Name of the run: results go to OUT/NAME/."""
    out: Path = Path("results")
    """Folder of all results."""

    @property
    def path(self) -> Path:
        """The folder of this run."""
        return self.out / self.name

    def folder(self) -> Path:
        """Make the run's folder; ValueError if it cannot be written."""
        return results_folder(self.out, self.name)


def read_axes(over: Ranges) -> dict[str, list]:
    """The axes of a grid: name -> values in SI units, or choices.

    Raises ValueError for an unknown or repeated name, a bad bound or count, and no axis at all.
    """
    require(len(over) > 0, "over", "be given at least once: NAME LOW HIGH COUNT", "missing")
    axes: dict[str, list] = {}
    for name, *rest in over:
        require(name not in axes, "over", "name a parameter once", f"given twice for {name}")
        if name in CHOICES:
            for choice in rest:
                require_choice(name, choice, CHOICES[name])
            require(len(rest) > 0, "over", f"name choices of {name}", "empty")
            axes[name] = rest
            continue
        require_parameter(name)
        require(len(rest) == 3, "over", f"be {name} LOW HIGH COUNT", " ".join([name, *rest]))
        low, high = (float(read_text(name, text)) for text in rest[:2])
        count = rest[2]
        require(
            count.isdecimal() and int(count) >= 2,
            "over",
            f"have a whole COUNT >= 2 for {name}",
            count,
        )
        require(low < high, "over", f"have LOW < HIGH for {name}", f"{rest[0]} {rest[1]}")
        axes[name] = np.linspace(low, high, int(count)).tolist()
    return axes
