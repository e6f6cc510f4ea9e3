"""Events of the crusher: their orbits, the branches that leave there, and curves of them."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.orbits import bifurcation_curve
from jaxcrusher.orbits.orbit_branch import Event
from jaxcrusher.orbits.scene_problems import problem_of
from jaxcrusher.orbits.shot import closed, least_penetrations_from
from jaxcrusher.periodic.branch import LOOP, follow
from jaxcrusher.periodic.events import special_points
from tests.periodic.maps import of_map

# Wide enough for a few steps.
BOUNDS = ((37.0, 38.5), (0.1e-3, 0.12e-3))
SCALES = (1.0, 3e-6)


def scene(speed, clearance):
    return jc.build_scene({"speed": speed, "clearance": clearance})


def over_speed(clearance):
    """Scenes over the speed; the clearance is a number of their program, so that one serves all."""
    return eqx.Partial(scene, clearance=jnp.asarray(clearance))


@pytest.mark.slow
def test_a_fold_by_few_nodes_and_over_two_parameters():
    """A point of the curve is the fold of a branch over the speed at its own clearance.

    96 nodes place the first one 2.1e-4 rad/s below; 192, 384 and 768 agree to 2e-9. A motion that
    begins on so few nodes does not close, and the branch goes on all the same: as one that comes
    from lower speeds.
    """
    few = {"scale": 1.0, "nodes": 96, "points": 7}
    found = jc.orbit_branch(over_speed(0.11e-3), "speed", 38.01, BOUNDS[0], **few)
    assert found.branches[0].points[0].u.shape == (96, 2)
    (fold,) = found.events
    assert fold.kind == "fold" and fold.error < 1e-8
    np.testing.assert_allclose(fold.parameter, 38.0276250, atol=1e-7)
    # The error across the branch is small where that at one speed is without bounds.
    orbit = fold.orbit()
    assert orbit.success and orbit.error < 1e-3
    # 384 nodes place the fold a little off along the branch: the exact orbit straight across has
    # the multiplier 1 + 1.405e-6 too, and by 768 nodes the fold's own is 1 to 5e-9. Two multipliers
    # all but meet, so that 1024 steps would leave 1.2e-4; more steps and the nodes leave 3e-9.
    least = np.abs(np.asarray(orbit.multipliers) - 1).min()
    assert orbit.multipliers_error < 1e-8
    np.testing.assert_allclose(least, 1.405e-6, atol=1e-8)

    given = scene, ("speed", "clearance")
    curve = jc.bifurcation_curve(*given, fold, 0.11e-3, BOUNDS, scales=SCALES, points=3)
    table = curve.table
    assert curve.events == () and len(curve.orbits) == 5
    assert curve.found == "by collocation with 96 nodes a turn"
    steps = np.diff(table.second), np.diff(table.parameter)
    assert np.all(steps[0] > 0) and np.all(np.sign(steps[1]) == np.sign(steps[1][0]))
    values = table.multiplier_real.values + 1j * table.multiplier_imag.values
    np.testing.assert_allclose(np.abs(values - 1).min(axis=1), 0.0, atol=1e-6)
    last = table.isel(point=-1)
    speed, clearance = float(last.parameter), float(last.second)
    guess = np.asarray(curve.orbits[-1].eccentricity)
    over = over_speed(clearance)
    again = jc.orbit_branch(over, "speed", speed - 0.02, BOUNDS[0], guess=guess, **few)
    near = min((one.parameter for one in again.events), key=lambda one: abs(one - speed))
    # 384 nodes tell of the branch, and 96 of the curve, at either end of it 2e-4 less. What is
    # left between both ends is 5e-6.
    moved = speed - float(table.parameter[2])
    np.testing.assert_allclose(near - fold.parameter, moved, atol=2e-5)


def closing(speed, clearance):
    """Loaded on the closing stroke: the load jumps, so that its orbits are shot for."""
    described = {"speed": speed, "clearance": clearance, "load_law": "closing_stroke"}
    return jc.build_scene(described)


@pytest.mark.slow
@pytest.mark.optimised
def test_lost_contact_is_followed_by_shooting():
    """On a branch, then over two parameters; single orbits on both sides of the curve tell."""
    over = eqx.Partial(closing, clearance=jnp.asarray(0.12e-3))
    problem = problem_of(over, jnp.asarray(34.33), 1, nodal=False)
    # A section point of the unstable motion of one turn, to four places; Newton's method goes on.
    states = problem.unknowns_from(np.array([0.6083, 0.8149, -0.0034, 0.0024]), 34.317)
    more = dict(scale=1.0, bounds=(34.31, 34.33), upwards=False, points=2)
    branch = follow(problem, states, 34.321, **more)
    (lost,) = special_points(branch)
    assert lost.kind == "contact lost"
    event = Event(lost.kind, lost.parameter, lost.error, branch, lost.point)
    names, bounds = ("speed", "clearance"), ((34.0, 34.6), (0.11e-3, 0.13e-3))
    curve = jc.bifurcation_curve(
        closing, names, event, 0.12e-3, bounds, scales=(0.3, 3e-7), points=2
    )
    assert len(curve.orbits) == 3 and np.ptp(curve.table.parameter.values) > 1e-4
    assert curve.found == "by shooting from 8 states a turn"
    # Two integrations differ by 1e-9 of a clearance.
    np.testing.assert_allclose(curve.table.least_penetration, 0.0, atol=1e-8)
    for speed, clearance, orbit in zip(
        curve.table.parameter.values, curve.table.second.values, curve.orbits, strict=True
    ):
        depths = []
        for side in (closing(speed - 1e-3, clearance), closing(speed + 1e-3, clearance)):
            found = closed(side, orbit.section, 1)
            depths.append(float(least_penetrations_from(side, found.state, 1)[0]))
        assert depths[0] < -1e-6 and depths[1] > 1e-6


@pytest.mark.usefixtures("unchecked")  # numbers in place of orbits
def test_a_closed_curve_is_followed_once(monkeypatch):
    """The folds of a sphere of orbits, x^2 + p^2 + q^2 = 1, are a circle."""

    def sphere(point, states):
        ((x,),) = states
        numbers = np.append(point, 0.6)[:2]
        ends = np.array([[x + 0.3 * (x**2 + numbers @ numbers - 1)]])
        return ends, np.array([[[1 + 0.6 * x]]]), 0.6 * numbers[None, None, : point.size]

    problem = of_map(sphere)
    branch = follow(problem, [0.6], np.sqrt(0.28), scale=1.0, bounds=(0.0, 2.0))
    (fold,) = special_points(branch)
    monkeypatch.setattr(bifurcation_curve, "problem_of", lambda *_: problem)
    monkeypatch.setattr(
        bifurcation_curve, "with_orbits", lambda way: (way, tuple(one.value for one in way.points))
    )
    monkeypatch.setattr(bifurcation_curve, "tabulated", lambda _, both: both)
    event = Event(fold.kind, fold.parameter, 0.0, branch, fold.point)
    made = lambda **_: scene(jnp.asarray(38.0), jnp.asarray(1e-4))  # noqa: E731
    bounds = ((-2, 2), (-2, 2))
    curve = jc.bifurcation_curve(made, ("p", "q"), event, 0.6, bounds, scales=(1.0, 1.0))
    first, second = curve.table["parameter"], curve.table["second"]
    np.testing.assert_allclose(first**2 + second**2, 1.0, atol=1e-9)
    # All the way round, as the second parameter grows at first where it ends.
    turned = np.unwrap(np.arctan2(second, first))
    np.testing.assert_allclose(turned[-1] - turned[0], 2 * np.pi, atol=1e-9)
    np.testing.assert_allclose(curve.orbits, second)
    assert curve.ended == LOOP and curve.events == ()


@pytest.mark.usefixtures("unchecked")  # objects in place of a branch and a point
def test_refusals():
    fold = Event("fold", 37.3, 0.0, branch=object(), point=object())  # pyright: ignore
    with pytest.raises(ValueError, match=r"`second` must lie in \["):
        jc.bifurcation_curve(scene, ("speed", "clearance"), fold, 0.2e-3, BOUNDS)
    with pytest.raises(ValueError, match="`kind` must be one of"):
        fold.other_branch()
    with pytest.raises(ValueError, match="`scales` must be finite and > 0"):
        names = "speed", "clearance"
        jc.bifurcation_curve(scene, names, fold, 0.1e-3, BOUNDS, scales=(1.0, 0.0))
