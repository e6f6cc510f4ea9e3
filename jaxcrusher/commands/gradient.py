"""`python -m jaxcrusher gradient`: slopes of a statistic, and whether to believe them."""

import dataclasses
from dataclasses import dataclass, field
from typing import Annotated, Any

import jax
import numpy as np
import tyro
from rich.console import Console

import jaxcrusher as jc
from jaxcrusher.basics.checks import require, require_choice, require_positive, require_whole
from jaxcrusher.batch.sweep import VARIABLES
from jaxcrusher.commands.options import Crusher, Results
from jaxcrusher.files.results import provenance, write_json
from jaxcrusher.scenes.parameters import PARAMETERS
from jaxcrusher.scenes.scene_file import require_parameter

# Name -> unit and meaning of what may be differentiated.
METRICS = {
    **{name: VARIABLES[name] for name in jc.STATISTICS},
    "foundation_smooth_peak": ("N", "peak of |R_O| + |R_C|, smoothed"),
    "joint_peak": ("N", "largest force in the main bearing"),
    "sliding_power": ("W", "mean of F_n |surface slip|: wear"),
    "drive_power": ("W", "mean power of the drive"),
}
_LISTED = "; ".join(f"{name}, {meaning} ({unit})" for name, (unit, meaning) in METRICS.items())
Metric = Annotated[str, tyro.conf.Positional, tyro.conf.arg(help=f"The statistic: {_LISTED}.")]


@dataclass(frozen=True)
class Gradient:
    """Slopes of a statistic by some parameters, each with a verdict: ok, doubtful or refused.

    Writes OUT/NAME/gradient.json. With the default turns one to four minutes, most of it
    compilation; a chaotic motion takes longer than a periodic one.
    """

    metric: Metric = "foundation_rms"
    crusher: Crusher = field(default_factory=Crusher)
    by: tuple[str, ...] = ("speed", "clearance")
    """Keys of the scene file to differentiate by; slopes are in SI units."""
    settle: int = 50
    """Turns of the shaft before the statistic starts."""
    turns: int = 50
    """Turns of the shaft that the statistic covers."""
    radius: float = 0.01
    """Radius of the fit beside the derivative, as a share of each parameter's value."""
    pairs: int = 32
    """Pairs of runs of a fit of a chaotic motion."""
    seed: int = 0
    """Seed of the fit's random runs."""
    rtol: float = 1e-9
    """Tolerance of a step, in clearances and m/s."""
    results: Results = field(default_factory=lambda: Results("gradient"))

    def run(self, console: Console) -> int:
        """Differentiate, print, write; 1 if the motion failed. ValueError for bad options."""
        values = self.crusher.moving()
        self._check(values)
        folder = self.results.folder()

        def scene(**numbers) -> jc.Scene:
            return jc.build_scene({**values, **numbers})

        with console.status("compiling and integrating: minutes"):
            report = jc.gradient_report(
                scene,
                self.metric,
                {name: values[name] for name in self.by},
                settle_turns=self.settle,
                turns=self.turns,
                radius=self.radius,
                pairs=self.pairs,
                seed=self.seed,
                rtol=self.rtol,
            )
        write_json(folder / "gradient.json", provenance("Slopes", values) | content(report))
        console.print(str(report), highlight=False, markup=False, soft_wrap=True)
        units = ", ".join(f"{name} {_unit(self.metric, name)}" for name in self.by)
        console.print(
            f"units: {units}; {folder / 'gradient.json'}", highlight=False, soft_wrap=True
        )
        return 1 if report.regime.name == "failed" else 0

    def _check(self, values: dict[str, Any]) -> None:
        require_choice("metric", self.metric, tuple(METRICS))
        require(
            len(set(self.by)) == len(self.by) > 0,
            "by",
            "name parameters, each once",
            " ".join(self.by),
        )
        for name in self.by:
            require_parameter(name)
            # The fit's radius is a share of the value.
            require(values[name] != 0, name, "not be 0 where a slope is wanted", values[name])
        for name, least in (("settle", 0), ("turns", 1), ("pairs", 2), ("seed", 0)):
            require_whole(name, getattr(self, name), least)
        require_positive("radius", self.radius, "")
        require_positive("rtol", self.rtol, "")


def content(report: jc.GradientReport) -> dict[str, Any]:
    """A report as JSON keeps it."""
    slopes = {}
    for name, slope in report.slopes.items():
        numbers = jax.tree.map(_plain, dataclasses.asdict(slope))
        slopes[name] = {"units": _unit(report.metric, name), **numbers}
    return {
        "metric": report.metric,
        "regime": report.regime.name,
        "evidence": list(report.regime.evidence),
        "horizon_turns": report.horizon,
        "growth": dict(zip(("value", "standard_error"), map(float, report.growth), strict=True)),
        "usable": report.usable,
        "slopes": slopes,
    }


def _unit(metric: str, name: str) -> str:
    """The unit of a slope."""
    return f"({METRICS[metric][0]})/({PARAMETERS[name].unit})"


def _plain(value: Any) -> Any:
    """A NumPy scalar as Python's."""
    return value.item() if isinstance(value, np.generic | np.ndarray) else value
