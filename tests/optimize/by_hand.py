"""Periodic orbits and runs whose numbers are given by hand, for what is made of them."""

import io

import jax.numpy as jnp
import numpy as np
import xarray as xr
from rich.console import Console

import jaxcrusher as jc
from jaxcrusher.batch.sweep import columns_of_row
from jaxcrusher.crusher.template import STATISTIC, STATISTICS
from jaxcrusher.orbits.result import RESULTS, WAYS, PeriodicOrbit, built, missing
from optimize.answer import Answer, Maps, Orbit
from optimize.tell.result import print_answer

VALUES = {"foundation_rms": 8.0, "foundation_peak": 9.0, "shaking_rms": 5.0, "shaking_peak": 6.0}


def solution_by_hand(
    multiplier: float = 0.5, error: float = 1e-9, period: int = 1, **values: float
) -> PeriodicOrbit:
    """Return an orbit of the paper's crusher at 25 rad/s with these statistics."""
    scene = jc.paper_scene(25.0, 0.03e-3)
    numbers = missing(scene, period, RESULTS.not_closed)
    known = {name: jnp.asarray(value) for name, value in (VALUES | values).items()}
    return built(
        scene,
        period,
        numbers.eccentricity,
        numbers.section,
        dict(numbers.values) | known,
        result=RESULTS.successful,
        error=jnp.asarray(error),
        least_penetration=jnp.asarray(0.1),
        multipliers=jnp.array([multiplier, 0.0, 0.0, 0.0]),
        multipliers_error=jnp.asarray(0.0),
        way=WAYS.rest,
    )


def orbit_by_hand(
    multiplier: float = 0.5, objective: float = 7.0, slopes=None, slopes_apart=None, **values: float
) -> Orbit:
    """Return an orbit for a design to be judged by."""
    solution = solution_by_hand(multiplier, **values)
    return Orbit(solution, objective, slopes or {}, slopes_apart or {})


def no_orbit() -> Orbit:
    """Return what stands for an orbit where none was found."""
    return Orbit(
        missing(jc.paper_scene(25.0, 0.03e-3), 1, RESULTS.not_closed), float("nan"), {}, {}
    )


def rows_of_three_runs():
    """From both starts, in contact all the time."""
    rows = {
        name: np.ones((2, 3))
        for name in columns_of_row(
            {"main": ""}, tuple((name, STATISTIC[name]) for name in STATISTICS)
        )
    }
    return rows | {
        "state": np.zeros((2, 3, 4)),
        "whirl": np.zeros((2, 3), dtype=bool),
        "objective": np.array([[1.0, 2.0, 3.0], [1.0, 1.0, 1.0]]),
        "counts": np.ones((2, 3), dtype=bool),
    }


def maps_of(points: np.ndarray, orbits: xr.Dataset | None) -> Maps:
    """Return maps of orbits alone."""
    return Maps(np.zeros((0, 2)), xr.Dataset(), points, orbits)


def printed(answer: Answer, width: int = 80) -> str:
    """Return the closing screen of a search."""
    console = Console(record=True, file=io.StringIO(), width=width)
    print_answer(console, answer)
    return console.export_text()
