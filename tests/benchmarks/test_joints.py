"""The arithmetic of `benchmarks.joints` on signals with known answers; its tables and figure."""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.text import Text

from benchmarks.joints import signature
from benchmarks.joints.cases import ACROSS, ALONG, alone, together
from benchmarks.joints.figure import draw, series
from benchmarks.joints.measure import BEFORE, Row
from benchmarks.joints.tables import tables
from jaxcrusher.pictures.page import SMALLEST

TURNS = 4
ANGLE = 2 * np.pi * TURNS * np.arange(TURNS * 64) / (TURNS * 64)


def test_high_share_is_that_of_what_is_above_the_third_harmonic():
    # Variances 9/2 and 4/2 below and 1/2 above, in two directions; a mean is no variance.
    low = 3 * np.cos(ANGLE) + 2 * np.sin(3 * ANGLE) + 50
    found = signature.high_share(np.stack([low, np.cos(4 * ANGLE)], axis=1), TURNS)
    # Sums of 256 numbers to rounding.
    assert found == pytest.approx(1 / 14, rel=1e-12)
    # A quarter of a harmonic above the third counts, too: whole turns resolve it.
    aside = np.stack([np.cos(ANGLE), np.cos(3.25 * ANGLE)], axis=1)
    assert signature.high_share(aside, TURNS) == pytest.approx(1 / 2, rel=1e-12)


def test_bursts_are_counted_when_they_come_not_when_they_go():
    size = np.where(np.sin(5 * ANGLE + 0.1) > 0, 100.0, 0.9 * signature.NOTICED)
    forces = np.stack([0.6 * size, -0.8 * size], axis=1)
    # Five a turn; the first is there when the record begins.
    assert signature.bursts(forces, TURNS) == 5 - 1 / TURNS


def test_ratios_are_of_lengths():
    one = np.stack([3 * np.cos(ANGLE), 4 * np.cos(ANGLE)], axis=1)
    other = np.stack([np.cos(ANGLE), np.sin(ANGLE)], axis=1)
    # To rounding; the mean square of a cosine is half that of a circle.
    assert signature.peak_ratio(one, other) == pytest.approx(5, rel=1e-12)
    assert signature.rms_ratio(one, other) == pytest.approx(5 / np.sqrt(2), rel=1e-12)


def test_a_low_ratio_leaves_out_means_and_fast_parts():
    fine = 2 * np.pi * TURNS * np.arange(TURNS * 1024) / (TURNS * 1024)
    fast = 7 * np.cos((signature.LOW + 1) * fine)
    one = np.stack([3 * np.cos(signature.LOW * fine) + fast, 4 * np.cos(fine) + 9], axis=1)
    other = np.stack([np.cos(fine), np.sin(fine) - 9], axis=1)
    assert signature.low_ratio(one, other, TURNS) == pytest.approx(5 / np.sqrt(2), rel=1e-12)


def test_error_of_a_mean_is_that_of_independent_starts():
    assert signature.mean_and_error(np.array([1.0, 3.0])) == pytest.approx((2, 1), rel=1e-12)


def test_one_joint_wears_at_a_time_and_all_at_last():
    new, *worn, last = together()
    for case in worn:
        changed = [j for j, c in case.clearances.items() if c != new.clearances[j]]
        assert changed == [case.worn]
    assert all(last.clearances[j] > new.clearances[j] for j in "ABC")
    assert {"joint": "ideal", "pivot.clearance": 0.5e-3}.items() <= alone("C")[1].description(
        ALONG
    ).items()


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    """Of every machine, with numbers that are alike but for the RMS."""
    names = ["rms_ratio", "peak_ratio", "bursts", "high_share_bearing", "high_share_pivot"]
    names += [
        "bursts_coarse",
        "low_ratio",
        "foundation_peak",
        "settling_turns",
        *(f"slope_{joint}" for joint in "ABC"),
    ]
    of_joints = ("joint_peak", "impact_speed", "sliding_power")
    names += [before + name for before in BEFORE.values() for name in of_joints]
    cases = [*together(), *(case for joint in "ABC" for case in alone(joint))]
    return [
        Row(load, case, how, True, dict.fromkeys(names, 0.1) | {"foundation_rms": 1e3 * i}, errors)
        for load, how, errors in ((ALONG, "average", {"bursts": 0.01}), (ACROSS, "settled", {}))
        for i, case in enumerate(cases, start=1)
    ]


def test_a_series_goes_from_new_to_worn_with_the_others_new(rows):
    found = [row.case.clearances for row in series(rows, "B", ACROSS)]
    assert [round(1e3 * c["B"], 9) for c in found] == [0.03, 0.1, 0.2, 0.5]
    assert {(c["A"], c["C"]) for c in found} == {(0.03e-3, 0.03e-3)}


def test_the_tables_have_each_row_once(rows):
    sizes = {name: len(text.splitlines()) - 2 for name, text in tables(rows).items()}
    assert sizes.pop("alone") == 2 * 6
    assert len(sizes) == 5 and set(sizes.values()) == {len(together())}


def test_the_figure_is_legible(rows):
    fig = draw(rows)
    shown = [t for t in fig.findobj(Text) if t.get_visible() and t.get_text()]
    assert len(shown) > 20 and min(float(t.get_fontsize()) for t in shown) >= SMALLEST
    plt.close(fig)
