"""Sets of free numbers at equal stroke: what they free, what follows, and their slopes."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.scenes.parameters import NUMBERS
from optimize.ask.design import Design
from optimize.ask.options import Options
from optimize.ask.resolve import resolve
from optimize.search import confirm, orbits
from optimize.search import descents as local
from tests.optimize.by_hand import rows_of_three_runs


def refused(message: str, *lines: tuple[str, ...], **more) -> None:
    """Tell that the lines are refused before a search begins, in one line."""
    with pytest.raises(ValueError, match=message) as error:
        resolve(Options(design=lines, **more))
    assert "\n" not in str(error.value)


@pytest.fixture(scope="module")
def balance():
    return resolve(Options(design=(("balance",),)))


@pytest.mark.slow
def test_slopes_of_all_nine_numbers(balance):
    problem, step = balance, 0.01
    point = np.array([0.3, 0.6, 0.7, 0.3, 0.4, 0.6, 0.5, 0.4, 0.6])
    first, beside = problem.design.unit(balance.reference), step * np.eye(9)
    rows = orbits.solve(problem, np.concatenate([[first, point], point + beside, point - beside]))
    # Printed for the ideal joint by two independent programs as 19 099 N; clearance adds 0.02 %.
    assert rows["objective"][0] == pytest.approx(19_099, rel=5e-4)
    assert rows["shaking_rms"][0] == pytest.approx(4513.63, rel=1e-3)
    above, below = np.split(rows["objective"][2:], 2)
    slope = rows["slope"][1] * orbits.widths(problem)
    # The third derivative over a hundredth of the box leaves 1e-4 of the largest slope.
    largest = np.abs(slope).max()
    np.testing.assert_allclose(slope, (above - below) / (2 * step), rtol=0, atol=2e-4 * largest)
    # So that no parameter's slope hides in that: each is above it.
    assert (np.abs(slope) > 5e-3 * largest).all() and rows["counts"].all()


def test_the_machine_has_twelve_numbers_more(balance):
    problem = resolve(Options(design=(("machine",),)))
    few, many = balance.design, problem.design
    assert len(few.names) == 9 and len(many.names) == 21 and {*few.names} < {*many.names}
    point = many.unit(problem.reference)
    assert ((point > 0) & (point < 1)).all()
    heavy = many.description(np.where(np.array(many.names) == "load", 1.0, point))
    assert float(heavy["load"]) == pytest.approx(1.1 * 8800)


def test_equal_stroke_is_equal_capacity(balance):
    """At one speed; where the speed is free, the floor is the box's corner as without links."""
    points = np.random.default_rng(0).uniform(size=(5, 9))
    problem = balance
    assert np.ptp(problem.capacity(points)) == 0 and not problem.links_free
    assert float(problem.capacity(points)[0]) == pytest.approx(7.844, abs=5e-4)
    refused("`capacity_floor` must be reached", ("balance",), capacity_floor=8.0)
    options = Options(design=(("balance",), ("speed", "25", "40 rad/s")))
    fast = resolve(options)
    assert fast.upper[:9].tolist() == [1.0] * 9
    # The floor is reached at 25 rad/s times the factor of affluence, outside of the box.
    assert fast.upper[9] == 1.0
    low = resolve(replace(options, capacity_floor=7.0))
    assert low.upper[9] == pytest.approx((9.4128692 * 25 / 7 - 25) / 15, rel=1e-6)


def test_a_line_goes_before_a_set():
    problem = resolve(Options(design=(("balance",), ("toggle.length", "295", "305 mm"))))
    assert problem.design.bounds["toggle.length"] == (0.295, 0.305)
    assert problem.design.bounds["jaw.length"] == pytest.approx((0.66025, 0.72975))
    assert problem.units["toggle.length"] == "mm" and len(problem.design.bounds) == 9


def test_a_set_lies_about_the_machine_of_a_scene_file(tmp_path):
    """Its numbers, its counterweight by the moment, and its stroke."""
    path = tmp_path / "mine.toml"
    path.write_text(
        'speed = "200 rpm"\n[shaft]\neccentricity = "15 mm"\n'
        '[jaw]\nmass_centre_distance = "350 mm"\n'
        '[counterweight]\nmass = "10 kg"\nradius = "0.2 m"\nangle = "180 deg"\n'
    )
    changed = (("clearance", "0.08 mm"), ("jaw.length", "0.7 m"))
    problem = resolve(Options(design=(("balance",),), scene=path, overrides=changed))
    made = problem.design
    described = made.description(made.unit(problem.reference))
    assert made.fixed["clearance"] == 0.08e-3
    assert made.bounds["jaw.mass_centre_distance"] == pytest.approx((0.315, 0.385), rel=1e-12)
    assert made.bounds["jaw.length"] == pytest.approx((0.665, 0.735), rel=1e-12)
    # Newton's method on the stroke ends at rounding of a length of 1 m, 1e-14 of 15 mm.
    assert float(described["shaft.eccentricity"]) == pytest.approx(0.015, rel=1e-12)
    assert float(described["counterweight.mass"]) == pytest.approx(10.0, rel=1e-12)
    assert abs(float(described["counterweight.angle"])) == pytest.approx(np.pi, rel=1e-12)
    assert float(described["speed"]) == pytest.approx(200 * np.pi / 30, rel=1e-12)
    # Nothing of what follows is told as given.
    assert not {*made.following} & {*made.fixed}


def test_a_design_knows_what_follows_from_its_numbers(balance):
    """A moment of 3 kg m along and 4 across is one of 5, at an angle that has a tangent of 4/3."""
    moment = (
        ("counterweight.moment_along", "0", "6 kg m"),
        ("counterweight.moment_across", "0", "8 kg m"),
    )
    problem = resolve(Options(design=moment))
    one = confirm.confirmed(problem, np.full(2, 0.5), rows_of_three_runs(), None)
    radius = NUMBERS["counterweight.radius"].default
    assert one.follows == pytest.approx(
        {"counterweight.mass": 5 / radius, "counterweight.angle": np.arctan2(4, 3)}, rel=1e-12
    )
    # The links of a set have the throw that keeps their stroke.
    assert balance.design.following == (*one.follows, "shaft.eccentricity")


def test_a_stroke_that_is_kept_is_another_question(balance):
    """Results of free links are not those of links at equal stroke, with the same bounds."""
    kept = balance
    lines = tuple(
        (name, repr(float(low)), f"{float(high)!r} {NUMBERS[name].unit}")
        for name, (low, high) in kept.design.bounds.items()
    )
    free = resolve(Options(design=lines))
    assert free.settings["bounds"] == kept.settings["bounds"] and free.links_free
    assert free.settings != kept.settings


def test_lines_that_are_refused():
    moment = ("counterweight.moment_along", "0", "5 kg m")
    refused("`design` must be one of .*balance.*machine.*, but is 'balanced'", ("balanced",))
    refused("`design` must be NAME LOW HIGH, or one of balance, machine", ("speed", "25rad/s"))
    refused("`design` must be NAME LOW HIGH, or one of balance, machine", ())
    refused("`bounds` must name both parts of the moment", moment)
    eccentricity = ("shaft.eccentricity", "8", "12 mm")
    refused("`bounds` must name nothing that follows", ("balance",), eccentricity)
    refused("`cells` must not be given with more than two", ("balance",), cells=(9, 9))
    refused("`speed` must be a line --design", ("balance",), speed=("20", "40rad/s"))
    refused("must have a joint with clearance", ("balance",), overrides=(("joint", "ideal"),))
    refused("`clearance` must", ("balance",), overrides=(("clearance", "200 mm"),))


def test_counterweight_of_a_shaft_alone():
    """With a jaw of no mass R_O is the shaft's: weight W and rotating unbalance U.

    (m1 + m)^2 g^2 + omega^4 (m1 l11 - m r)^2, opposite to S1, is least at
    m = (omega^4 r m1 l11 - m1 g^2) / (g^2 + omega^4 r^2).
    """
    fixed = {
        "joint": "ideal",
        "load_law": "none",
        "jaw.mass": 1e-9,
        "jaw.inertia": 1e-9,
        "toggle.mass": 1e-9,
        "toggle.inertia": 1e-9,
        "counterweight.radius": 0.2,
    }
    moment = ("counterweight.moment_along", "counterweight.moment_across")
    design = Design(dict.fromkeys(moment, (-1.5, 1.5)), jc.paper_machine(**fixed))

    @jax.jit
    def rms(unit):
        result = jc.statistics(design.scene(unit), 0, 1, outputs=("foundation_rms",))
        return result.foundation_rms

    both = jax.jit(jax.value_and_grad(rms))

    def function(unit):
        value, slope = both(jnp.asarray(unit))
        return float(value), np.asarray(slope)

    found = local.descend(function, np.array([0.9, 0.1]), np.ones(2), 60)
    fast, arm = 30.0**4, 0.2
    best = (fast * arm * 95 * 0.006 - 95 * 9.81**2) / (9.81**2 + fast * arm**2)
    described = design.description(found.path[-1])
    # The search ends where a slope over the box is 1e-9 of the RMS; a parabola is 1e-5 wide there.
    assert float(described["counterweight.mass"]) == pytest.approx(best, rel=1e-4)
    assert float(described["counterweight.angle"]) % (2 * np.pi) == pytest.approx(
        np.radians(210), abs=1e-4
    )
    unbalance = fast * (95 * 0.006 - best * arm) ** 2
    least = np.sqrt((95 + best) ** 2 * 9.81**2 + unbalance)
    assert found.last == pytest.approx(least, rel=1e-7)
