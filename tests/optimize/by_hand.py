"""Periodic orbits whose numbers are given by hand, for what is made of them."""

import jax.numpy as jnp

import jaxcrusher as jc
from jaxcrusher.orbits.result import RESULTS, WAYS, PeriodicOrbit, built, missing
from optimize.answer import Orbit

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
