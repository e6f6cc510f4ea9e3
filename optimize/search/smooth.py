"""Numbers of a design with their exact slopes, as descents take them."""

import functools
from dataclasses import replace

import numpy as np

from optimize.ask import constraints as counts
from optimize.ask.case import Case
from optimize.ask.limits import Limit
from optimize.ask.objectives import plain
from optimize.search.descents import Smooth
from optimize.search.orbits import solve, widths


def objective(case: Case) -> Smooth:
    """Return the objective of the orbit; NaN of one that `counts.solved` leaves out."""

    def function(unit: np.ndarray) -> tuple[float, np.ndarray]:
        rows = solve(case, unit[None])
        good = bool(counts.solved(case, rows)[0])
        value = float(rows["objective"][0]) if good else float("nan")
        return value, rows["slope"][0] * widths(case)

    return function


def capacity(case: Case) -> Smooth:
    """Return the crushing capacity, m3/h."""
    return lambda unit: (float(case.capacity(unit)), case.capacity_slope(unit))


# Stages ask again, and a program belongs to its case.
@functools.lru_cache(maxsize=8)
def limited(case: Case, limit: Limit) -> Smooth:
    """Return the statistic of the orbit that a limit is of."""
    of_limit = plain(limit.statistic, case.scene.statistics)
    return objective(replace(case, objective=of_limit, limits=()))


def constraints(case: Case) -> tuple[Smooth, ...]:
    """Return by how much a design is inside each constraint, as a share of it.

    The floor of the capacity is none where it is a corner of the box.
    """
    found = [above(negative(limited(case, limit)), -limit.most) for limit in case.limits]
    if case.links_free and case.capacity_floor > 0:
        found.append(above(capacity(case), case.capacity_floor))
    return tuple(found)


def above(number: Smooth, least: float) -> Smooth:
    """Return by how much a number is above its least, as a share of that."""

    def spare(unit: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = number(unit)
        return (value - least) / abs(least), slope / abs(least)

    return spare


def negative(number: Smooth) -> Smooth:
    """Return the negative of a number, which is to be large."""

    def function(unit: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = number(unit)
        return -value, -slope

    return function
