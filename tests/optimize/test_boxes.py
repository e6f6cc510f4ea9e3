"""Searches of boxes in which little or nothing can be found end in an answer and a report."""

import io
import json

import numpy as np
import pytest
from rich.console import Console

from optimize.ask import constraints as counts
from optimize.ask.options import Options
from optimize.ask.resolve import resolve
from optimize.design_search import design_search
from optimize.search import confirm, orbits, stages
from optimize.search.descents import Descent
from optimize.tell import figures
from optimize.tell import words as formatting

# No motion of this box must be waited for, and no orbit needs more nodes.
NARROW = (("speed", "25", "40rad/s"), ("clearance", "0.04", "0.06mm"))
SMALL = dict(design=NARROW, cells=(4, 3), grid=(2, 2), settle=1, turns=2, steps=2, refine=1, runs=3)


def searched(tmp_path, monkeypatch, **options):
    """The answer, its page, and what the search printed into a file."""
    # What random starts come to takes a minute, and has tests of its own.
    monkeypatch.setattr(orbits, "coexisting", lambda *_: ())
    written = io.StringIO()
    console = Console(file=written, width=200)
    answer = design_search(Options(out=tmp_path, name="box", **SMALL, **options), console)
    folder = tmp_path / "box"
    assert json.loads((folder / "result.json").read_text())["status"] == "finished"
    return answer, (folder / "report.html").read_text(), written.getvalue()


def test_losses_are_counted_by_their_reason():
    """Four designs: two fail from a start, one whirls, one is slow and has no number."""
    ones = np.ones((2, 4))
    rows = {"success": ones.copy(), "whirl": 0 * ones, "inside_model": ones, "objective": 1 * ones}
    rows["success"][0, 0] = rows["success"][:, 1] = 0
    rows["whirl"][1, 2] = 1
    rows["objective"][0, 3] = np.nan
    problem = resolve(Options(capacity_floor=6.0))
    assert counts.losses(problem, rows, np.array([7.0, 7.0, 7.0, 5.0]), "designs") == (
        "of 4 designs 2 failed to integrate, 1 come to a friction whirl, "
        "1 have no number of the objective, 1 are below the capacity of 6 m3/h (the highest is 7 "
        "m3/h)"
    )


def nothing_counts(problem, found, capacity):
    return np.zeros(np.shape(found["success"]), bool)


@pytest.mark.slow
def test_a_box_without_a_design(tmp_path, monkeypatch):
    monkeypatch.setattr(counts, "of_runs", nothing_counts)
    solved = orbits.solve
    monkeypatch.setattr(
        orbits,
        "solve",
        lambda problem, units, *rest, **more: (
            solved(problem, units, *rest, **more) | {"counts": np.zeros(len(units), bool)}
        ),
    )
    answer, page, written = searched(tmp_path, monkeypatch)
    assert answer.optimum is None and answer.empty.startswith("of 4 points of the landscape")
    assert formatting.answer(answer).startswith("No design may be chosen: of 4 points")
    assert [check.passed for check in answer.checks] == [False]
    # The design to compare with is looked at all the same, and no gap is called an interruption.
    assert answer.reference is not None and "paper&#39;s choice" in page
    assert "No design may be chosen" in page and "ended before" not in page
    assert "pareto.svg is not drawn: there is no periodic orbit that may be chosen" in page
    # Into a file a line for each stage, as it begins, and no bars.
    begun = [line for line in written.splitlines() if line.endswith(" to do")]
    assert begun[-1] == "confirmation: 6 to do"
    assert {"landscape: 8 to do", "orbits: 12 to do"} < {*begun}
    assert "━" not in written


@pytest.mark.slow
def test_a_box_without_an_orbit(tmp_path, monkeypatch):
    solved = orbits.solve

    def fails(problem, units, *rest, **more):
        rows = solved(problem, units, *rest, **more)
        none = {"objective": np.nan, "settling_turns": np.nan, "stable": False, "counts": False}
        return rows | {name: np.full(len(units), value) for name, value in none.items()}

    monkeypatch.setattr(orbits, "solve", fails)
    monkeypatch.setattr(orbits, "orbit_of", lambda problem, unit: None)
    monkeypatch.setattr(
        stages,
        "_by_fits",
        lambda problem, starts, *_: [
            Descent(starts[:1], 1.0, 1.0, np.full(starts.shape[1], np.nan), 1)
        ],
    )
    answer, page, _ = searched(tmp_path, monkeypatch)
    assert answer.maps.stable_orbits == 0 and answer.optimum is not None
    assert formatting.answer(answer).startswith(
        "The map of the box found no stable orbit of one turn: the best is"
    )
    # Nothing has slopes that could be believed or not.
    assert not any("slopes" in check.name for check in answer.checks)
    assert "settling.svg is not drawn: no point of the map has a stable orbit of one turn" in page
    assert not (tmp_path / "box" / "settling.svg").exists()


@pytest.mark.slow
def test_candidates_none_of_which_survives(tmp_path, monkeypatch):
    # From contact they stay on their orbit, so that what counts is how they end.
    monkeypatch.setattr(confirm, "end_well", lambda rows: np.zeros(np.shape(rows["success"]), bool))
    answer, page, _ = searched(tmp_path, monkeypatch)
    assert answer.optimum is None and answer.candidates
    assert "ends of descents" in answer.empty
    assert "No design may be chosen" in page


@pytest.mark.slow
def test_a_failure_is_not_called_finished(tmp_path, monkeypatch):
    def breaks(*_):
        raise ValueError("no such picture")

    monkeypatch.setattr(figures, "draw_all", breaks)
    with pytest.raises(ValueError, match="no such picture"):
        searched(tmp_path, monkeypatch)
    result = json.loads((tmp_path / "box" / "result.json").read_text())
    assert result["status"] == "failed: no such picture"
    assert "This run is not finished" in (tmp_path / "box" / "report.html").read_text()


@pytest.mark.slow
def test_a_joint_that_is_ideal_in_the_paper_is_compared_with_its_default():
    """The paper has no clearance of the pivot to compare with, and the search ends all the same."""
    free = (("speed", "25", "40rad/s"), ("pivot.clearance", "0.02", "0.1mm"))
    options = Options(design=free)
    problem = resolve(options)
    assert problem.reference == {"speed": 39.0, "pivot.clearance": 0.06e-3}
    title = "paper's choice with clearance 0.06 mm and pivot clearance 0.06 mm"
    assert problem.compared_with == title
