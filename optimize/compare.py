"""`python -m optimize.compare`: machines of several scene files side by side."""

from pathlib import Path
from typing import Annotated

import tyro

from jaxcrusher.files.program import keeping, program
from jaxcrusher.files.results import run_folder


def compare(
    scenes: Annotated[tuple[Path, ...], tyro.conf.Positional],
    settle: int = 40,
    turns: int = 40,
    bulk_density: str | None = None,
    name: str = "compare",
    out: Path = Path("results"),
) -> None:
    """Compare crushers: capacity, shaking, peaks, wear and energy, in one table and one picture.

    Writes OUT/NAME/compare.csv and compare.png. The numbers are those of the periodic orbit where
    the machine comes to one, else means over turns of the shaft. About half a minute, most of it
    compilation.

    Args:
        scenes: TOML files of the crushers.
        settle: Turns of the shaft before means start, where there is no orbit.
        turns: Turns of the shaft that means cover, where there is no orbit.
        bulk_density: Bulk density of the crushed rock, as in "1.6 t/m3", for a capacity in t/h.
        name: Name of the comparison: results go to OUT/NAME/.
        out: Folder of all results.
    """
    from rich.console import Console

    from optimize.machines import run

    folder = run_folder(out, name)
    with keeping(folder):
        run(scenes, settle, turns, bulk_density, folder, Console())


if __name__ == "__main__":
    program(compare)
