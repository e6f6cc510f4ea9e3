"""Searches with gradients and without, on a bowl whose bottom is known."""

import numpy as np
import pytest

from benchmarks.optimisers.methods import METHODS, Improvement, Objective, Searched, search
from benchmarks.optimisers.run import Contest, best_so_far, cost_table, methods_table, starts

CENTRE = np.array([0.3, 1.2, 0.6])  # the second is outside the box
START = np.array([0.9, 0.1, 0.1])


def value(point):
    return 1 + float(np.sum((point - CENTRE) ** 2))


# Least at CENTRE, projected on the box; a gradient counts as two values.
BOWL = Objective(value, lambda point: (value(point), 2 * (point - CENTRE)), 1.0, 2.0)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_finds_the_bottom_of_a_bowl(method):
    found = search(method, BOWL, START, 600, 1)
    # The bowl is 1.04 at its least in the box; the evolution's spread shrinks slowest.
    assert found.best == pytest.approx(1.04, abs=1e-4)
    np.testing.assert_allclose(found.point, [0.3, 1.0, 0.6], atol=1e-2)
    work, _, best = np.transpose(found.improvements)
    assert all(np.diff(best) < 0) and all(np.diff(work) > 0)
    each = 2 if method in ("L-BFGS-B", "Adam") else 1
    assert found.work == each * found.evaluations <= 600
    again = search(method, BOWL, START, 600, 1)
    assert again.point == found.point and again.evaluations == found.evaluations


def test_a_search_stops_at_its_budget():
    found = search("L-BFGS-B", BOWL, START, 3.9)
    assert found.evaluations == 1 and found.work == 2.0


def test_no_number_is_never_the_best():
    nowhere = Objective(lambda _: np.nan, lambda _: (np.nan, np.full(3, np.nan)), 1.0, 1.0)
    for method in ("L-BFGS-B", "CMA-ES"):
        found = search(method, nowhere, np.full(3, 0.5), 20)
        assert found.improvements == [] and np.isnan(found.best) and found.evaluations > 0


def test_searches_start_from_machines_that_move():
    some = Objective(lambda p: np.nan if p[0] < 0.7 else 1.0, BOWL.gradient, 1.0, 1.0)
    found = starts(some, 3, 2)
    assert len(found) == 3 and all(start[0] >= 0.7 for start in found)


def test_the_best_so_far_is_that_of_the_work_done():
    found = Searched("Adam", 0, [Improvement(1.0, 0.1, 3.0), Improvement(4.0, 0.4, 2.0)])
    at = np.array([0.5, 1.0, 3.9, 4.0, 9.0])
    np.testing.assert_array_equal(best_so_far(found, at), [np.nan, 3, 3, 2, 2])


def test_table_of_methods_counts_what_never_arrived():
    improved = [Improvement(2.0, 0.1, 0.9), Improvement(4.0, 0.2, 0.8)]
    searches = [
        Searched("L-BFGS-B", 0, improved, evaluations=2),
        Searched("CMA-ES", 0, [Improvement(1.0, 0.1, 0.95)], evaluations=9),
        # One that found no number at all.
        Searched("CMA-ES", 1),
    ]
    every = [*searches, Searched("Adam", 0, improved), Searched("Py-BOBYQA", 0, improved)]
    contest = Contest("balance", 1000.0, BOWL, every)
    rows = [line.strip("| ").split(" | ") for line in methods_table(contest).splitlines()]
    columns = dict(zip(rows[0], zip(*rows[2:], strict=True), strict=True))
    assert columns["L-BFGS-B"][:3] == ("800.00 (800.00 to 800.00)", "1 of 1", "4 (4 to 4)")
    assert columns["CMA-ES"][:3] == (
        "never (950.00 to never)",
        "0 of 2",
        "never (never to never)",
    )
    assert "| balance | 1000.0 | 2000.0 | 2.0 |" in cost_table([contest])
