"""The reproduction of the paper: the rule of its verdicts, what must hold, and its tables."""

import math

import numpy as np
import pytest
import xarray as xr

from benchmarks.reproduction import tables
from benchmarks.reproduction.claims import CHOICE, Evidence, claims
from benchmarks.reproduction.readings import (
    DECIDED,
    POINTS,
    READINGS,
    SINGLE_CHANGES,
    Measured,
    Reading,
    ideal_statistics,
    measure,
)
from benchmarks.reproduction.verdict import (
    INCONSISTENT,
    NOT_REPRODUCED,
    REPRODUCED,
    UNCHECKED,
    Estimate,
    estimate,
    printed,
    verdict,
)


def certain(value: float) -> Estimate:
    return Estimate(value, value, value)


@pytest.mark.parametrize(
    "text, value, rounding",
    [("7.4e4", 74e3, 500), ("40", 40, 0.5), ("4e4", 4e4, 5e3), ("41.45", 41.45, 0.005)],
)
def test_last_digit(text, value, rounding):
    # Decimal fractions in binary.
    assert printed(text).value == pytest.approx(value, rel=1e-15)
    assert printed(text).rounding == pytest.approx(rounding, rel=1e-15)


@pytest.mark.parametrize(
    "number, found, implied, word",
    [
        ("1.8e4", certain(18_127), None, REPRODUCED),
        ("100", certain(104.9), None, REPRODUCED),
        ("100", certain(105.1), None, NOT_REPRODUCED),
        ("100", certain(94.9), None, NOT_REPRODUCED),
        ("4e4", certain(35_100), None, REPRODUCED),  # by its one digit
        ("4.0e4", certain(35_100), None, NOT_REPRODUCED),
        ("100", certain(math.nan), None, NOT_REPRODUCED),
        ("100", Estimate(math.nan, 99, 101), None, NOT_REPRODUCED),
        ("100", Estimate(150, 90, 160), None, NOT_REPRODUCED),  # a wide range helps nobody
        ("100", None, None, UNCHECKED),
        ("100", certain(100), (101, 102), INCONSISTENT),
        ("100", certain(100), (100.5, 102), REPRODUCED),
        ("9e4", certain(9e4), (7.5e5, math.inf), INCONSISTENT),
        ("9e4", certain(9e4), (1e4, math.inf), REPRODUCED),
        ("100", None, (101, 102), INCONSISTENT),
    ],
)
def test_verdict(number, found, implied, word):
    assert verdict(printed(number), found, implied) == word


def test_a_failed_run_is_not_left_out():
    assert math.isnan(estimate(np.array([1.0, math.nan, 1.0])).value)
    assert estimate(np.array([3.0, 1.0, 8.0])) == (3, 1, 8)


def synthetic() -> Evidence:
    """Evidence in which every peak is 2000 N times its reading's place, every mean 500 N."""
    measured = {}
    for place, reading in enumerate(READINGS):
        speeds = {speed for speed, _ in POINTS}
        for point in [*POINTS, *((speed, 0.0) for speed in speeds)]:
            values = {f"{reading.force}_{name}": np.full(3, 500.0) for name in ("mean", "rms")}
            peaks = 2e3 * (1 + place) * np.ones((3, 4))
            values |= {f"{reading.force}_peak": peaks, "collision_peak": peaks}
            measured[reading, point] = Measured(values | {"hertzian": np.array([True] * 3)})
    forces = {
        name: (("n",), np.array([2e4, 2e5])) for name in ("foundation_rms", "foundation_peak")
    }
    box = xr.Dataset(forces)
    return Evidence(measured, box, box)


@pytest.fixture(scope="module")
def listed():
    return claims()


def test_arithmetic_of_the_source(listed):
    """What follows from printed numbers alone."""
    evidence = synthetic()
    words = {c.number.value: tables.judged(c, evidence, DECIDED)[1] for c in listed if c.by.implied}
    assert words[25.0] == words[41.45] == words[9e4] == INCONSISTENT
    assert words[5.63] == REPRODUCED
    # Consistent in themselves, though not met by the made-up forces.
    assert words[45.0] == words[48.6] == NOT_REPRODUCED
    # 12.106 s and 12.099 s, in turns at 30 rad/s, as the claims have them.
    for time in (12.106, 12.099):
        turns = 30 * time / (2 * math.pi) % 1
        assert any(c.number.value == pytest.approx(turns, abs=5e-4) for c in listed)


def told(rows):
    return tables.reading_table(rows).splitlines()[2:]


def test_tables(listed):
    evidence = synthetic()
    lines = tables.verdict_table(listed, evidence).splitlines()
    assert len(lines) == len(listed) + 2
    kinds = (REPRODUCED, NOT_REPRODUCED, INCONSISTENT, UNCHECKED)
    words = [line.split("|")[-2].strip() for line in lines[2:]]
    assert set(words) <= set(kinds)
    counted = [line.split(" | ") for line in tables.counts_table(listed, evidence).splitlines()[2:]]
    assert [(k.strip("| "), int(n.strip("| "))) for k, n in counted] == [
        (kind, words.count(kind)) for kind in kinds
    ]
    # Smallest and largest contour of Figure 15b are what the made-up sweep holds.
    assert words[[c.number.value for c in listed].index(2e5)] == REPRODUCED
    assert words[[c.number.value for c in listed].index(2e4)] == REPRODUCED
    changed = tables.reading_rows(listed, evidence)
    able = [claim.text for claim in listed if claim.by.by_reading]
    assert len(changed) == len(able) * len(SINGLE_CHANGES)
    # The made-up peaks differ from reading to reading: each row has its own, and says if it meets.
    rows = [row for row in changed if "25 rad/s, 0.06 mm" in row["claim"]]
    places = [1 + READINGS.index(reading) for reading in SINGLE_CHANGES.values()]
    assert [row["value"] for row in rows] == [2e3 * place for place in places]
    assert [row["met"] for row in rows] == [place in (11, 12) for place in places]
    counts = {line.split(" | ")[0].strip("| "): line.split(" | ")[1] for line in told(changed)}
    for name, count in counts.items():
        met = sum(row["met"] for row in changed if row["reading"] == name)
        assert count.strip(" |") == f"{met} of {len(able)}"
    assert sorted(counts) == sorted({row["reading"] for row in changed})
    ranked = tables.ranking(listed, evidence).splitlines()[2:]
    met = [int(line.split(" | ")[4].split("of")[0]) for line in ranked]
    assert met == sorted(met, reverse=True) and len(met) == 16 and met[0] > met[-1]


def test_every_claim_reads_its_own_reading(listed):
    evidence = synthetic()
    places = {reading: place for place, reading in enumerate(READINGS)}
    peak = next(claim for claim in listed if claim.number.value == 2.3e4)
    for reading in READINGS:
        assert peak.by.compute(evidence, reading).value == 2e3 * (1 + places[reading])


def test_numbers_that_hold():
    """The ideal joint's mean of 1.8e4 N, and 2.19e4 N as the RMS of the paper's choice."""
    ideal = ideal_statistics(30.0, "along_jaw")
    assert verdict(printed("1.8e4"), estimate(ideal["sum_mean"])) == REPRODUCED
    # Five digits given.
    assert float(ideal["sum_rms"]) == pytest.approx(19_099, rel=1e-4)
    readings = [Reading(start="contact", settle=2), Reading(settle=2)]
    measured = measure(readings, [CHOICE], turns=2)
    chosen, centred = (measured[reading, CHOICE] for reading in readings)
    # One start in contact and three centred ones, still impacting, from the same program.
    assert chosen["sum_rms"].shape == (1,) and centred["sum_rms"].shape == (3,)
    assert centred["sum_peak"].min() > chosen["sum_peak"].max()
    assert np.ptp(centred["sum_peak"]) > 0
    assert verdict(printed("2.19e4"), estimate(chosen["sum_rms"])) == REPRODUCED
    assert verdict(printed("2.19e4"), estimate(chosen["sum_mean"])) == NOT_REPRODUCED
