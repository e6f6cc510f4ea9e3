"""The search's figures show the designs that it found."""

from types import SimpleNamespace
from typing import Any, cast

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from matplotlib.text import Text

from jaxcrusher.crusher.capacity import CrushingChamber
from jaxcrusher.pictures.plots import SMALLEST, WIDTH
from optimize.answer import Front
from optimize.ask.objectives import OBJECTIVES
from optimize.ask.options import Options
from optimize.ask.resolve import resolve
from optimize.tell import figures

# RMS and peak of a map of 3 x 2 points, N; the first point beats all others in everything.
RMS = np.array([[18e3, 18.5e3], [20e3, 20.5e3], [22e3, np.nan]])
CAPACITY = np.array([[9.0, 9.0], [7.0, 7.0], [6.0, 6.0]])


def design(rms, capacity, **changes) -> Any:
    """As the search confirms one: from the worse of two starts 1 kN more than the orbit's."""
    runs = [
        SimpleNamespace(first={"objective": rms + k, "foundation_peak": 1.5 * rms + k}.get)
        for k in (1e3, 0.0)
    ]
    orbit = SimpleNamespace(objective=rms, solution={"foundation_peak": 1.5 * rms})
    crushing = SimpleNamespace(capacity=capacity)
    known = {"crushing": crushing, "orbit": orbit, "transient": dict(enumerate(runs))}
    return SimpleNamespace(**known | changes)


@pytest.fixture
def kept(monkeypatch):
    """The figures that the search would write."""
    written = []
    monkeypatch.setattr(figures, "write_figure", lambda path, figure: written.append(figure))
    yield written
    plt.close("all")


@pytest.fixture
def drawn(kept, tmp_path):
    """Draws a Pareto figure and keeps it."""

    def draw(data: xr.Dataset, fronts=(), **designs):
        problem = SimpleNamespace(
            capacity=lambda units: units,
            chamber=CrushingChamber(),
            objective=OBJECTIVES["rms"],
            rival=OBJECTIVES["peak"],
        )
        answer = SimpleNamespace(designs=designs, fronts=fronts, problem=problem)
        figures.draw_pareto(tmp_path, cast(Any, problem), CAPACITY.ravel(), data, cast(Any, answer))
        return kept[-1]

    return draw


def grid(start: bool) -> xr.Dataset:
    """Periodic orbits, or the landscape from two starts, the worse of which is the same."""
    dims, counts = ("speed", "clearance"), np.isfinite(RMS)
    data = xr.Dataset(
        {"objective": (dims, RMS), "foundation_peak": (dims, 1.5 * RMS), "counts": (dims, counts)}
    )
    return xr.concat([data, data], "start") if start else data


@pytest.mark.parametrize("start, extra", [(False, 0.0), (True, 1.0)], ids=["orbits", "landscape"])
def test_pareto_marks_optimum_and_rival(drawn, start, extra):
    fig = drawn(grid(start), optimum=design(18e3, 9.0), rival=design(22e3, 6.0))
    for ax, second in zip(fig.axes, ((9.0, 6.0), (27.0 + extra, 33.0 + extra)), strict=True):
        lines = {line.get_label(): line.get_xydata().tolist() for line in ax.lines}
        assert lines["optimum"] == [[18.0 + extra, second[0]]]
        assert lines["rival"] == [[22.0 + extra, second[1]]]
        assert len(lines["front"]) == 1 and lines["front"][0][0] == 18.0
        assert len({(line.get_color(), line.get_marker()) for line in ax.lines}) == 4
    shown = [text for text in fig.findobj(Text) if text.get_visible() and text.get_text()]
    assert fig.get_figwidth() <= WIDTH and min(t.get_fontsize() for t in shown) >= SMALLEST
    fig.draw_without_rendering()
    (legend,) = fig.legends
    over = legend.get_window_extent()
    assert not any(over.overlaps(ax.get_window_extent()) for ax in fig.axes)


def test_pareto_of_a_design_without_an_orbit(drawn):
    fig = drawn(grid(False), optimum=design(18e3, 9.0, orbit=None))
    (mark,) = (line for line in fig.axes[0].lines if line.get_label() == "optimum")
    assert np.isnan(mark.get_xdata()).all()


def test_pareto_draws_the_fronts_of_the_answer(drawn):
    ends = np.array([18e3, 19e3])
    fronts = [Front("capacity", "m3/h", "capacity", ends, np.array([7.0, 9.0]), {}, {})]
    fronts.append(Front("foundation_peak", "N", "peak", ends, np.array([27e3, 25e3]), {}, {}))
    fig = drawn(grid(False), tuple(fronts), optimum=design(18e3, 7.0))
    for ax, other in zip(fig.axes, ([7.0, 9.0], [27.0, 25.0]), strict=True):
        (line,) = (line for line in ax.lines if line.get_label() == "front")
        np.testing.assert_array_equal(line.get_xydata(), np.transpose([[18.0, 19.0], other]))


@pytest.mark.parametrize("shown", ["orbits", "settling", "landscape"])
def test_descents_are_drawn_on_the_map_of_orbits_alone(shown, kept, tmp_path):
    """The other maps show the designs, and no way to them."""
    axes = {"speed": [25.0, 30.0, 40.0], "clearance": [4e-5, 6e-5]}
    dims, whole = ("start", *axes), np.ones((2, 3, 2), bool)
    data = xr.Dataset(
        {
            "objective": (dims, np.stack([RMS, 1.1 * RMS]), {"units": "N", "long_name": "RMS"}),
            "counts": (dims, whole),
            "success": (dims, whole),
            "whirl": (dims, ~whole),
            "inside_model": (dims, whole),
        },
        axes,
    )
    orbits = data.isel(start=0).assign(stable=data.success[0])
    orbits["settling_turns"] = tuple(axes), np.array([[9.0, 90.0], [20.0, 30.0], [40.0, 50.0]])
    values = {"speed": 30.0, "clearance": 5e-5}
    descent = SimpleNamespace(path={name: [value, value] for name, value in values.items()})
    answer: Any = SimpleNamespace(
        problem=resolve(Options()),
        refinement=(descent,),
        designs={"optimum": SimpleNamespace(values=values)},
    )
    if shown == "orbits":
        figures.draw_orbits(tmp_path, answer, orbits)
    elif shown == "settling":
        figures.draw_settling(tmp_path, answer, orbits)
    else:
        figures.draw_landscape(tmp_path, answer, data)
    (legend,) = [ax.get_legend() for ax in kept[0].axes if ax.get_legend() is not None]
    texts = [text.get_text() for text in legend.get_texts()]
    assert "optimum" in texts and ("descents" in texts) == (shown == "orbits")
    assert "no stable periodic orbit found" not in texts  # all are stable


def test_the_speed_at_which_the_capacity_falls_to_its_floor_is_drawn(kept, tmp_path):
    problem = resolve(Options(capacity_floor=6.0))
    figures.draw_capacity(tmp_path, CrushingChamber(), problem)
    ax, speed = kept[0].axes[0], float(CrushingChamber().highest_speed(6.0))
    (line,) = (one for one in ax.lines if one.get_linestyle() == ":")
    assert line.get_xdata()[0] == speed and f"{speed:.4g} rad/s" in str(line.get_label())
