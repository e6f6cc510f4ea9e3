"""The benchmarks' figures, from their committed rows: legible at the width of a page."""

from collections import Counter

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import pytest
from matplotlib.text import Text

from benchmarks.pages import DOCS
from benchmarks.stability import figure as stability
from benchmarks.stability.judgement import Judged
from benchmarks.work_precision import figure as work_precision
from benchmarks.work_precision.measure import Row
from jaxcrusher.pictures.plots import SMALLEST, WIDTH
from tests.tables import read_table


@pytest.fixture(scope="module")
def rows():
    return read_table(DOCS / "work_precision.csv", Row)


@pytest.fixture(scope="module")
def figures(rows):
    found = {
        "first": work_precision.draw_first(rows),
        "rest": work_precision.draw_rest(rows, "rms_error"),
        "stability": stability.draw(read_table(DOCS / "stability.csv", Judged)),
        "seats": stability.draw_seats(read_table(DOCS / "stability_seats.csv", Judged)),
    }
    yield found
    for fig in found.values():
        plt.close(fig)


every = pytest.mark.parametrize("name", ["first", "rest", "stability", "seats"])


@every
def test_type_is_large_enough_at_the_width_of_a_page(figures, name):
    fig = figures[name]
    # A4's height less its margins.
    assert fig.get_figwidth() <= WIDTH and fig.get_figheight() <= 10
    shown = [t for t in fig.findobj(Text) if t.get_visible() and t.get_text()]
    assert len(shown) > 20
    assert min(text.get_fontsize() for text in shown) >= SMALLEST
    # Raised and lowered letters are smaller.
    assert not [text.get_text() for text in shown if "$" in text.get_text()]
    # Nothing is cut off, to a pixel.
    drawn = fig.get_tightbbox()
    assert min(drawn.p0) >= -0.01
    assert drawn.x1 <= fig.get_figwidth() + 0.01 and drawn.y1 <= fig.get_figheight() + 0.01


@every
def test_legends_cover_no_curve(figures, name):
    fig = figures[name]
    fig.draw_without_rendering()
    legends = [*fig.legends, *(ax.get_legend() for ax in fig.axes if ax.get_legend())]
    assert legends
    for legend in legends:
        over = legend.get_window_extent()
        # The stability figure's legend has axes of its own, without a picture.
        panels = [ax for ax in fig.axes if ax.axison and ax.get_visible()]
        assert not any(over.overlaps(ax.get_window_extent()) for ax in panels)


@pytest.mark.parametrize("name", ["first", "rest"])
def test_every_series_has_its_own_colour_and_marker(figures, name):
    for ax in figures[name].axes:
        colours = [line.get_color() for line in ax.lines]
        looks = [(line.get_color(), line.get_marker(), line.get_linestyle()) for line in ax.lines]
        names = [line.get_label() for line in ax.lines]
        assert not [what for what in (colours, names) if max(Counter(what).values()) > 1]
        for look, label in zip(looks, names, strict=True):
            others = {
                other.get_label()
                for panel in figures[name].axes
                for other in panel.lines
                if (other.get_color(), other.get_marker(), other.get_linestyle()) == look
            }
            assert others == {label}


def test_every_program_is_drawn(rows, figures):
    groups = (work_precision.FIRST, *work_precision.REST.values())
    known = {name for group in groups for name in group}
    # The ideal joint's other solvers are in its table alone.
    drawn = {row.program for row in rows if row.scene != "ideal joint"}
    assert drawn <= known
    lines = sum(len(ax.lines) for ax in figures["rest"].axes)
    # Three scenes: ours in three panels each, and what is not in the first figure.
    assert lines == 3 * (3 + len(drawn - set(work_precision.FIRST)))
    assert [len(ax.lines) for ax in figures["first"].axes] == [4, 4, 4, 3]


@pytest.mark.parametrize(
    "name, table, verdicts", [("stability", "stability", 5), ("seats", "stability_seats", 3)]
)
def test_every_verdict_is_a_cell(figures, name, table, verdicts):
    motions = [row for row in read_table(DOCS / f"{table}.csv", Judged) if row.start]
    axes = [ax for ax in figures[name].axes if ax.images]
    assert sum(len(ax.texts) for ax in axes) == len(motions)
    # A place without a case is masked.
    shown = Counter(int(code) for ax in axes for code in ax.images[0].get_array().compressed())
    told = Counter(stability.ORDER.index(row.verdict) for row in motions)
    assert shown == told and len(told) == verdicts
