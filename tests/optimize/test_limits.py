"""Limits of statistics: how they are read, and what the search makes of them."""

from types import SimpleNamespace

import numpy as np
import pytest

import jaxcrusher as jc
from optimize.ask.limits import OF_ORBIT, OF_RUN, Limit, read_limits
from optimize.ask.options import Options
from optimize.ask.resolve import resolve
from optimize.search import descents, orbits
from optimize.search.active import active_constraints

BLOCK = {"foundation.mass": 6000.0, "foundation.x": 0.3, "foundation.y": 0.2}


def test_limits_are_read_in_their_units():
    scene = jc.build_scene(BLOCK)
    written = (("frame_displacement_peak", "0.2 mm"), ("transmitted_rms", "3 kN"))
    assert read_limits(written, scene) == (
        Limit("frame_displacement_peak", 0.2e-3, "m"),
        Limit("transmitted_rms", 3000.0, "N"),
    )
    # Without a unit there is none to write.
    (share,) = read_limits((("contact_fraction", "0.9"),), scene)
    assert share == Limit("contact_fraction", 0.9, "1")


@pytest.mark.parametrize(
    ("written", "told"),
    [
        ((("frame_displacment_peak", "1 mm"),), "is 'frame_displacement_peak' meant"),
        ((("shaking_rms", "1 mm"),), "must have a unit of the kind N, but has 'mm'"),
        ((("shaking_rms", "0 N"),), "`limit of shaking_rms` must be finite and > 0, but is 0 N"),
        ((("shaking_rms", "1 N"), ("shaking_rms", "2 N")), "must name every statistic once"),
    ],
)
def test_limits_that_cannot_be_are_refused(written, told):
    with pytest.raises(ValueError, match=told):
        read_limits(written, jc.build_scene(BLOCK))


def test_objectives_and_limits_of_supports_need_supports():
    with pytest.raises(ValueError, match=r"must be another without foundation\.mass"):
        resolve(Options(objective="transmitted_rms"))
    with pytest.raises(ValueError, match="`transmitted_rms` must be a known name"):
        resolve(Options(limit=(("transmitted_rms", "1 kN"),)))


def test_a_number_that_is_none_keeps_no_limit():
    kept = Limit("shaking_rms", 100.0, "N").kept(
        {"shaking_rms": np.array([99.0, 102.0, np.nan])}, 0.01
    )
    assert kept.tolist() == [True, False, False]
    assert Limit("shaking_rms", 100.0, "N").kept({"shaking_rms": 100.0}, 0.0)  # the very limit
    assert OF_ORBIT < OF_RUN


def test_the_objective_of_an_orbit_knows_scene_and_chamber():
    """An energy over the capacity of the chamber at the scene's speed, J/m3."""
    problem = resolve(Options(objective="energy"))
    unit = np.full(2, 0.5)
    scene = problem.design.scene(unit)
    orbit = jc.periodic_orbit(scene)
    found = orbits._number(orbit, scene, unit, None, problem, "objective")
    capacity = problem.chamber_of(problem.design.description(unit)).capacity(scene.drive.speed)
    assert float(found) == pytest.approx(3600 * float(orbit.drive_power) / float(capacity))


@pytest.mark.slow
def test_multiplier_of_a_limit_is_what_its_last_newton_costs():
    """The slope of the least objective by the limit, by central differences of descents.

    They leave 1e-9 of the objective, 2e-5 N, over a step of 10 N: 4e-6 N/N. The difference's own
    error is the third derivative's, some 1e-4 of it.
    """
    limit, step = 1400.0, 5.0
    free = (("counterweight.mass", "0", "50 kg"), ("counterweight.angle", "120 deg", "240 deg"))
    problem = resolve(Options(design=free, limit=(("shaking_rms", f"{limit!r} N"),)))
    numbers = orbits.numbers(problem)
    of_limit = descents.negative(numbers["shaking_rms"])
    end, above, below = (
        descents.descend(numbers["objective"], np.array([0.9, 0.6]), problem.upper, 60, spares)
        for spares in (
            orbits.spares(problem, numbers),
            # Other limits of the same numbers.
            (descents.above(of_limit, -limit - step),),
            (descents.above(of_limit, -limit + step),),
        )
    )
    unit = end.path[-1]
    cost = (below.last - above.last) / (2 * step)
    rows = orbits.solve(problem, unit[None])
    assert rows["counts"][0] and rows["shaking_rms"][0] == pytest.approx(limit, rel=OF_ORBIT)
    slopes = dict(zip(problem.design.names, rows["slope"][0], strict=True))
    best = SimpleNamespace(
        values=problem.design.numbers(unit),
        orbit=SimpleNamespace(slopes=slopes),
        crushing=SimpleNamespace(capacity=9.0),
    )
    (one,), left = active_constraints(problem, best)
    assert (one.parameter, one.limit) == ("shaking_rms", "highest")
    assert one.multiplier == pytest.approx(cost, rel=1e-3) and one.multiplier > 0
    # What is left of the slopes, over the box, as the descent's end leaves it.
    rest = np.array(list(left.values())) * orbits.widths(problem)
    assert np.max(np.abs(rest)) < 1e-6 * end.last
    # Beyond the limit the same design does not count.
    beyond = orbits.solve(problem, np.array([[0.2, 0.5]]))
    assert beyond["stable"][0] and not beyond["counts"][0]
