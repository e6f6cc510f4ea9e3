"""The search's figures show the designs that it found."""

from types import SimpleNamespace
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import LogNorm
from matplotlib.text import Text

from jaxcrusher.crusher.capacity import CrushingChamber
from jaxcrusher.pictures.plots import SMALLEST, WIDTH
from optimize.answer import Front
from optimize.ask.objectives import OBJECTIVES
from optimize.ask.options import Options
from optimize.ask.resolve import resolve
from optimize.tell import figures
from tests.optimize.by_hand import maps_of

# RMS and peak of a map of 3 x 2 points, N; the first point beats all others in everything.
RMS = np.array([[18e3, 18.5e3], [20e3, 20.5e3], [22e3, np.nan]])
CAPACITY = np.array([[9.0, 9.0], [7.0, 7.0], [6.0, 6.0]])


def design(rms, capacity, **changes) -> Any:
    """As the search confirms one."""
    orbit = SimpleNamespace(objective=rms, solution={"foundation_peak": 1.5 * rms})
    crushing = SimpleNamespace(capacity=capacity)
    return SimpleNamespace(**{"crushing": crushing, "orbit": orbit} | changes)


def fronts_by_hand(rms, capacities, peaks) -> tuple[Front, Front]:
    """Fronts of the RMS against the capacity and against the peak."""
    of_capacity = Front("capacity", "m3/h", "capacity", rms, np.array(capacities), {}, {})
    of_peak = Front("foundation_peak", "N", "peak of the force", rms, np.array(peaks), {}, {})
    return of_capacity, of_peak


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

    def draw(fronts, **designs):
        dims, counts = ("speed", "clearance"), RMS < 21e3
        columns = {"objective": RMS, "foundation_peak": 1.5 * RMS, "counts": counts}
        orbits = xr.Dataset({name: (dims, column) for name, column in columns.items()})
        problem = SimpleNamespace(capacity=lambda units: units, objective=OBJECTIVES["rms"])
        maps = maps_of(CAPACITY.ravel(), orbits)
        answer = SimpleNamespace(designs=designs, fronts=fronts, problem=problem, maps=maps)
        with plt.rc_context(figures.STYLE):
            figures.draw_fronts(tmp_path, answer)
        return kept[-1]

    return draw


def test_pareto_marks_optimum_and_rival(drawn):
    fronts = fronts_by_hand(np.array([18e3]), [9.0], [27e3])
    fig = drawn(fronts, optimum=design(18e3, 9.0), rival=design(22e3, 6.0))
    for ax, second in zip(fig.axes, ((9.0, 6.0), (27.0, 33.0)), strict=True):
        lines = {line.get_label(): line.get_xydata().tolist() for line in ax.lines}
        assert lines["optimum"] == [[18.0, second[0]]]
        assert lines["rival"] == [[22.0, second[1]]]
        assert lines["front"] == [[18.0, second[0]]]
        assert len({(line.get_color(), line.get_marker()) for line in ax.lines}) == 4
        # The point of 22 kN does not count, and another one has no orbit.
        assert np.isfinite(lines["points of the map"]).all(axis=1).sum() == 4
    assert [ax.get_ylabel() for ax in fig.axes] == ["capacity (m³/h)", "peak of the force (kN)"]
    shown = [text for text in fig.findobj(Text) if text.get_visible() and text.get_text()]
    with plt.rc_context(figures.STYLE):
        fig.draw_without_rendering()
    assert fig.get_figwidth() <= WIDTH and min(t.get_fontsize() for t in shown) >= SMALLEST
    (legend,) = fig.legends
    over = legend.get_window_extent()
    assert not any(over.overlaps(ax.get_window_extent()) for ax in fig.axes)


def test_pareto_of_a_design_without_an_orbit(drawn):
    fronts = fronts_by_hand(np.array([18e3]), [9.0], [27e3])
    fig = drawn(fronts, optimum=design(18e3, 9.0, orbit=None))
    (mark,) = (line for line in fig.axes[0].lines if line.get_label() == "optimum")
    assert np.isnan(mark.get_xdata()).all()


def test_pareto_draws_the_fronts_of_the_answer(drawn):
    fronts = fronts_by_hand(np.array([18e3, 19e3]), [7.0, 9.0], [27e3, 25e3])
    fig = drawn(fronts, optimum=design(18e3, 7.0))
    for ax, other in zip(fig.axes, ([7.0, 9.0], [27.0, 25.0]), strict=True):
        (line,) = (line for line in ax.lines if line.get_label() == "front")
        np.testing.assert_array_equal(line.get_xydata(), np.transpose([[18.0, 19.0], other]))


def test_a_figure_without_a_front_is_left_out_with_its_reason():
    """No point of the map gains; there is no orbit to trade from; the optimum does not settle."""
    problem, known = resolve(Options()), xr.Dataset({"counts": ("cell", [True])})
    one = fronts_by_hand(np.array([18e3]), [9.0], [27e3])
    for fronts, orbits, why in (
        (one, known, "no point of the map has a higher capacity than the optimum, nor a lower"),
        ((), None, "there is no periodic orbit that may be chosen"),
        ((), known, "the optimum is not known to come to its periodic orbit"),
    ):
        maps = maps_of(np.zeros((1, 2)), orbits)
        answer = SimpleNamespace(problem=problem, maps=maps, fronts=fronts, optimum="one")
        assert why in figures._no_front(answer)


def test_descents_are_drawn_on_the_map_of_orbits_alone(kept, tmp_path):
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
    answer = SimpleNamespace(
        problem=resolve(Options()),
        refinement=(descent,),
        designs={"optimum": SimpleNamespace(values=values)},
    )
    figures.draw_orbits(tmp_path, answer, orbits)
    figures.draw_landscape(tmp_path, answer, data)
    for shown, figure in zip(("orbits", "settling", "landscape"), kept, strict=True):
        (legend,) = [ax.get_legend() for ax in figure.axes if ax.get_legend() is not None]
        texts = [text.get_text() for text in legend.get_texts()]
        assert "optimum" in texts and ("descents" in texts) == (shown == "orbits")
        assert "no stable periodic orbit found" not in texts  # all are stable
    # Turns span decades.
    assert isinstance(kept[1].axes[0].collections[0].norm, LogNorm)


def test_the_speed_at_which_the_capacity_falls_to_its_floor_is_drawn(kept, tmp_path):
    problem = resolve(Options(capacity_floor=6.0))
    figures.draw_capacity(tmp_path, problem)
    ax, speed = kept[0].axes[0], float(CrushingChamber().highest_speed(6.0))
    (line,) = (one for one in ax.lines if one.get_linestyle() == ":")
    assert line.get_xdata()[0] == speed and f"{speed:.4g} rad/s" in str(line.get_label())
