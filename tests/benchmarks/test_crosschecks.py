"""Live comparisons with SciPy, SUNDIALS and EXUDYN: the cheap ones of `benchmarks`.

The tolerances and their reasons are the comparisons' own.
"""

import numpy as np
import pytest

from benchmarks import comparison
from benchmarks.crosschecks import clearance, longrun, pointwise
from benchmarks.crosschecks.programs import CVODE, DOP853, EXUDYN, IDA
from benchmarks.peers.equations import Crusher
from tests.pairs import slow


def check(comparisons, programs):
    """All agree, and all the programs were there."""
    found = list(comparisons)
    assert {c.program for c in found} == set(programs)
    assert [c for c in found if not c.agrees] == []


def test_forces_in_one_instant():
    check(pointwise.instants(count=12), (pointwise.ANGLES, pointwise.NINE))


def test_ideal_joint():
    check(pointwise.ideal(speeds=(30.0,)), (pointwise.ANGLES, EXUDYN))


@pytest.mark.parametrize(
    ("comparison", "friction", "peers", "formulation"),
    [
        (clearance.clearance, None, (CVODE, EXUDYN), "eccentricity"),
        *slow(
            (clearance.clearance, 0.1, (DOP853, IDA, EXUDYN), "multiplier"),
            (pointwise.torque, 0.1, (DOP853, EXUDYN), "eccentricity"),
        ),
    ],
)
def test_motions(comparison, friction, peers, formulation):
    check(comparison((friction,), peers, (formulation,)), peers)


def test_statistics_of_impacts():
    crushers = (Crusher(speed=40.0, clearance=0.12e-3),)
    check(longrun.impacts(crushers, 6, settle=0, turns=1, exudyn_members=0), (CVODE,))


@pytest.mark.slow
def test_whirl():
    check(longrun.whirl(settle=2, turns=3), (CVODE,))


def test_a_difference_is_a_difference():
    """What does not agree is said not to."""
    times = np.linspace(0, 1, 11)
    vectors = np.stack([times, times], axis=1)
    off = comparison.histories("x", vectors + np.array([0, 1e-3]), vectors, "p", 1e-4, "r")
    assert off.difference == pytest.approx(1e-3 / np.sqrt(2)) and not off.agrees
    # As long, but the other way round.
    assert comparison.histories("x", -vectors, vectors, "p", 1, "r").difference == pytest.approx(2)
    assert not comparison.numbers("x", float("nan"), 1.0, "p", 1.0, "r").agrees
    assert not comparison.numbers("x", 1.0, 0.0, "p", 0.5, "r").agrees
    assert comparison.numbers("x", 0.0, 0.0, "p", 0.5, "r").agrees
    # Variances of 1, three samples each: the difference of means has an error of sqrt(2 / 3).
    close = comparison.samples("x", [1.0, 2.0, 3.0], [2.0, 3.0, 4.0], "p", "r")
    assert close.agrees and close.tolerance == pytest.approx(4 * np.sqrt(2 / 3) / 3)
    assert "**does not agree**" in comparison.table_of([off, close])
    with pytest.raises(ValueError, match="one shape"):
        comparison.histories("x", times, vectors, "p", 1.0, "r")
