"""A bound of how far below the optimum the least objective of its box may lie.

Points of the map are the corners of cells. A cell whose objective may be below the optimum by more
than `within` is halved, and the orbits of its new corners are solved for. At points without a
stable orbit long runs are made. A longer search for their orbits follows only if the runs may lie
below the optimum.
"""

from dataclasses import dataclass, replace
from decimal import ROUND_CEILING, Context

import numpy as np
import scipy.spatial
from jaxtyping import Bool, Float, Int

from jaxcrusher.files.text import quantity, with_error
from optimize.answer import Bound, Confirmed, Maps, OpenPoint
from optimize.ask.design import GRID_DIMENSIONS
from optimize.ask.problem import DesignProblem
from optimize.search.cells import ROUGHER, Cells, beside
from optimize.search.confirm import Repeats, interval, long_runs
from optimize.search.evaluate import NOWHERE, Rows, Tracking
from optimize.search.landscape import counting
from optimize.search.orbits import solve, widths

# Greatest number of orbits besides those of the map, and about how many a halved cell needs.
MOST, OF_A_CELL = 1500, 3
# With more points without a stable orbit than this, the box has another kind of motion, and none of
# these points is run.
MOST_OPEN = 64
# An effect of second derivatives below this share of `within` is rounding.
NOTHING = 1e-3
# Places of the unit box at most this far apart are the same point.
SAME = 1e-9


class Points:
    """Points of the unit box, with the known objectives and slopes of their motions.

    `runs` describes the long runs of points without a stable orbit.
    """

    def __init__(
        self,
        problem: DesignProblem,
        places: Float[np.ndarray, "points n"],
        rows: Rows,
        runs: Repeats,
        tracking: Tracking = NOWHERE,
    ) -> None:
        self.problem, self._runs, self._told = problem, runs, tracking.progress
        self._tracking = replace(tracking, progress=NOWHERE.progress)
        self.begun, self.places = len(places), np.zeros((0, places.shape[1]))
        self.values, self.least, self.slopes = np.zeros(0), np.zeros(0), np.zeros(places.shape)[:0]
        self.open: dict[int, OpenPoint] = {}  # points judged by runs, by their number
        self.waited: set[int] = set()
        self.add(places, rows)

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.places)

    def add(self, places: Float[np.ndarray, "points n"], rows: Rows) -> None:
        """Add points with their rows from `optimize.search.orbits.solve`, and run the open ones."""
        which = np.arange(len(self), len(self) + len(places))
        self.places = np.concatenate([self.places, places])
        nothing = np.full(len(places), np.nan)
        self.values, self.least = (np.append(old, nothing) for old in (self.values, self.least))
        self.slopes = np.concatenate([self.slopes, np.full(places.shape, np.nan)])
        left = self._put(which, rows)
        if left.any() and len(self.open) + left.sum() <= MOST_OPEN:
            self._run(which[left], {name: column[left] for name, column in rows.items()})

    def _put(self, which: Int[np.ndarray, " some"], rows: Rows) -> Bool[np.ndarray, " some"]:
        """Store values and slopes from rows, and tell which points have no stable orbit.

        A stable orbit that breaks a constraint, and any orbit below the capacity's floor, leave
        NaN. Where an orbit counts, `least` is infinite: no run is needed.
        """
        stable, counts = (np.asarray(rows[name], bool) for name in ("stable", "counts"))
        open_ = ~stable & self.problem.reaches(self.problem.capacity(self.places[which]))
        known = np.asarray(rows["success"], bool) & (counts | open_)
        self.values[which] = np.where(known, rows["objective"], np.nan)
        self.slopes[which] = np.where(known[:, None], rows["slope"] * widths(self.problem), np.nan)
        self.least[which] = np.where(counts, np.inf, self.least[which])
        for n in which[counts].tolist():
            self.open.pop(n, None)
        return open_

    def _run(self, which: Int[np.ndarray, " some"], rows: Rows) -> None:
        """Judge points by long runs from both starts."""
        runs = long_runs(self.problem, self.places[which], self._runs, self._tracking)
        for i, (n, row) in enumerate(zip(which.tolist(), runs, strict=True)):
            least = _least(row["objective"], self.problem.objective.lowest)
            values = self.problem.design.numbers(self.places[n])
            self.open[n] = OpenPoint(values, _motion(rows, i), least, n)
            self.least[n] = least

    def at(self, cells: Cells) -> Int[np.ndarray, "cells corners"]:
        """Return the numbers of the points at corners; orbits of new corners are solved for."""
        corners = cells.corners
        places = corners.reshape(-1, corners.shape[2])
        apart, at = scipy.spatial.KDTree(self.places).query(places)
        if (apart > SAME).any():
            new = np.unique(np.round(places[apart > SAME], 12), axis=0)
            self.add(new, solve(self.problem, new, tracking=self._tracking))
            self._told(len(self) - self.begun, MOST)
            at = scipy.spatial.KDTree(self.places).query(places)[1]
        return np.reshape(at, corners.shape[:2])

    def search_longer(self, which: Int[np.ndarray, " some"]) -> None:
        """Search for the orbits of points with the usual effort; name motions without an orbit."""
        self.waited |= {*which.tolist()}
        rows = solve(self.problem, self.places[which], effort="usual", tracking=self._tracking)
        self._put(which, rows)
        for i, n in enumerate(which.tolist()):
            if n in self.open:
                self.open[n] = replace(self.open[n], motion=_motion(rows, i))

    def lowest(
        self, cells: Cells, at: Int[np.ndarray, "cells corners"]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return lower bounds of the objective on orbits and on all motions near each corner.

        The third array is the effect of curvature in each cell. Half a cell away from a run, the
        objective is assumed to be lower by at most `ROUGHER` times the fall of orbits beside it.
        """
        orbits, hidden = cells.lowest(at, self.values, self.slopes)
        falls = np.fmax.reduce(self.values[at] - orbits, axis=1)
        runs = self.least[at] - ROUGHER * beside(falls, at, len(self))[:, None]
        motions = np.where(np.isnan(orbits), runs, np.minimum(orbits, runs))
        return orbits, np.where(self.least[at] == np.inf, orbits, motions), hidden


def _least(objective: Float[np.ndarray, "starts runs"], lowest: float) -> float:
    """Return the least lower end of the starts' intervals; NaN if a run has no objective.

    The wide interval of two runs may reach below the objective's lower bound `lowest`.
    """
    ends = [mean - width for mean, width in map(interval, objective)]
    return float(np.maximum(np.min(ends), lowest))


def _motion(rows: Rows, i: int) -> str:
    """Say why a point has no stable orbit and, after a longer search, name its motion."""
    said = {name: column[i] for name, column in rows.items()}
    verdict = "is not known to be stable" if said["undecided"] else "is unstable"
    why = said["failure"] or (
        f"The orbit of one turn {verdict}: its largest multiplier is "
        f"{said['largest_multiplier']:.6g}, with an error of {said['multipliers_error']:.1g}."
    )
    if not said.get("motion"):
        return str(why)
    return (
        f"{why} {said['motion']} Its RMS is {with_error(said['run_rms'], said['run_rms_error'])} N."
    )


@dataclass(frozen=True, eq=False)
class Refined:
    """The cells of the box after their refinement."""

    points: Points
    cells: Cells
    at: Int[np.ndarray, "cells corners"]  # numbers of the points at corners
    # Second derivatives near the optimum, as a multiple of those measured in the previous cells;
    # infinite if no halved cells confirmed them.
    rougher: float


def refined(points: Points, cells: Cells, best: Confirmed, within: float) -> Refined:
    """Halve cells that may contain an objective more than `within` below the best.

    Then halve cells near the optimum until second derivatives are within the assumed factor, or
    `MOST` orbits are solved for.
    """
    place, floor = points.problem.design.unit(best.values), best.objective - within
    assumed = np.zeros(0)
    while True:
        at = points.at(cells)
        _, motions, hidden = points.lowest(cells, at)
        lowest, rougher = motions.min(axis=1), np.inf
        if len(assumed):
            own = cells.hidden(cells.bends(points.slopes[at]))[-len(assumed) :]
            share = own / np.maximum(assumed, NOTHING * within)
            rougher = ROUGHER * float(np.fmax.reduce(share, initial=0.0))
        chosen = lowest < floor
        asked = {*at[chosen].ravel().tolist()} & {*points.open} - points.waited
        if asked:
            points.search_longer(np.array(sorted(asked)))
            continue
        # If the objective of a corner itself is below the floor, smaller cells do not help.
        chosen &= (np.fmin(points.values, points.least)[at] >= floor).all(axis=1)
        confirms = not chosen.any()
        if confirms:
            chosen = (lowest < best.objective) | cells.hold(place)
        room = (MOST - len(points) + points.begun) // OF_A_CELL
        if room < 1 or (confirms and rougher <= ROUGHER):
            return Refined(points, cells, at, rougher)
        order = np.argsort(np.where(chosen, lowest, np.inf), kind="stable")
        chosen[order[room:]] = False
        # The effect of the same second derivatives in cells half as large.
        assumed = np.repeat(hidden[chosen] / 4, cells.corners.shape[1] if confirms else 0)
        cells = cells.halved(chosen)


def optimality_bound(found: Refined, best: Confirmed) -> Bound:
    """Bound the objective between points by the values and slopes at the points.

    The bound is relative to the present objective of `best`, which a worse motion may have raised
    since the refinement.
    """
    points, at, rougher = found.points, found.at, found.rougher
    orbits, motions, hidden = points.lowest(found.cells, at)
    unit, count = points.problem.objective.unit, len(points)
    gain = float(np.nanmin(points.values[points.least == np.inf])) - best.objective
    unsaid = len(np.unique(at[np.isnan(motions)]))
    if np.isnan(motions).all():
        statement = (
            "The best of what was tried: no two points of the map beside each other have a stable "
            "orbit that counts, and nothing is said of what lies between."
        )
        return Bound(None, None, unsaid, gain, statement)
    of_orbits = max(0.0, best.objective - float(np.nanmin(orbits)))
    # If the corners lie above the optimum, curvature exceeds the possible fall below it.
    hides = float(hidden[np.nanargmin(np.fmin.reduce(orbits, axis=1))])
    curvature = min(of_orbits, hides)
    problem = points.problem
    keeps = " that keeps the constraints" * bool(problem.limits or problem.inside_model)
    statement = (
        f"No other periodic orbit of the box{keeps} is more than {_at_most(of_orbits, unit)} "
        f"below the optimum, of which {_at_most(curvature, unit)} are what second derivatives can "
        f"hide: these are assumed to be at most {ROUGHER:g} times those between neighbouring "
        "points."
    )
    if np.isfinite(rougher):
        statement += f" In cells half as large about the optimum they are {rougher:.2g} times."
    by_runs = tuple(points.open[n] for n in sorted(points.open) if np.isfinite(points.least[n]))
    within = max(0.0, best.objective - float(np.nanmin(motions)))
    if by_runs:
        least = min(point.least for point in by_runs)
        statement += (
            f" At {len(by_runs)} of {count} points no stable orbit of one turn is known: "
            f"runs there come to {least:.6g} {unit} or more, {_against(best, least, unit)}. "
            f"Half a cell away they are assumed to be lower by at most {ROUGHER:g} times what the "
            "objective may fall about the points beside."
        )
    if unsaid:
        statement += (
            f" Nothing is said of {unsaid} of {count} points. At such a point, or at "
            "all points beside it, no stable orbit in contact was found, or a constraint is broken."
        )
    else:
        statement += f" So the optimum is global within the box to {_at_most(within, unit)}."
    return Bound(within, curvature, unsaid, gain, statement, by_runs)


def unbounded(problem: DesignProblem, maps: Maps, best: Confirmed) -> Bound | None:
    """Return the reason as a `Bound` if no bound can be computed, else None."""
    mapped = maps.orbits
    if mapped is None or not mapped.counts.any():
        unsaid = 0 if mapped is None else int((~mapped.counts).sum())
        why = "no periodic orbits could be mapped"
        if not maps.contact:
            why = "no design that was looked at keeps contact, and so none has an orbit to map"
        statement = f"The best of what was tried: {why}."
        return Bound(None, None, unsaid, 0.0, statement)
    if not best.settles:
        statement = (
            "The best of what was tried: it does not come to its periodic orbit from every start, "
            "and nothing is said of what lies between."
        )
        # Compare only with points where descents may start.
        begun = counting(maps.landscape, maps.cells, maps.points)
        values = mapped.objective.where(mapped.counts).to_numpy().ravel()[begun]
        least = np.fmin.reduce(values, initial=np.inf)
        gain = float(least) - best.objective if np.isfinite(least) else 0.0
        return Bound(None, None, int((~mapped.counts).sum()), gain, statement)
    if len(problem.design.names) <= GRID_DIMENSIONS:
        return None
    statement = (
        f"The best of {mapped.counts.size} points of a Sobol sequence and of the descents from "
        f"them, known to {best.half_width:.2g} {problem.objective.unit}; nothing is said of what "
        "lies between."
    )
    gain = float(mapped.objective.where(mapped.counts).min()) - best.objective
    return Bound(None, None, int((~mapped.counts).sum()), gain, statement)


def _at_most(value: float, unit: str) -> str:
    """Return a bound rounded up to two digits, with its unit."""
    up = Context(prec=2, rounding=ROUND_CEILING)
    return quantity(float(up.create_decimal(repr(float(value)))), unit)


def _about(value: float, unit: str) -> str:
    """Return a number rounded to two digits, with its unit."""
    return quantity(float(f"{value:.2g}"), unit)


def _against(best: Confirmed, least: float, unit: str) -> str:
    """Return how far the `least` objective of runs lies from the optimum, and what it means."""
    above = least - best.objective
    if above >= 0:
        return f"{_about(above, unit)} above the optimum"
    return (
        f"{_about(-above, unit)} below the optimum: they scatter too much to tell whether a better "
        "motion is there, and more --runs tell more"
    )
