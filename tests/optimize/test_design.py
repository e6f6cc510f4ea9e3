"""Designs: the unit box, what completes a description, and what is refused."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.crusher.capacity import stroke
from jaxcrusher.scenes.build import build_linkage
from optimize.ask.design import CounterweightMoment, Design, EqualStroke

LINKS = {
    "toggle.length": (0.285, 0.315),
    "bearing.distance": (0.608, 0.672),
    "bearing.inclination": (0.373, 0.412),
    "jaw.length": (0.66, 0.73),
}


@pytest.fixture(scope="module")
def design():
    return Design(LINKS, jc.paper_machine(), EqualStroke.of({}))


def test_unit_box_round_trip(design):
    points = np.random.default_rng(0).uniform(size=(7, 4))
    # Rounding of a product and a sum.
    np.testing.assert_allclose(design.unit(design.values(points)), points, rtol=0, atol=1e-13)
    assert design.names == tuple(LINKS)
    low = design.values(np.zeros(4))
    assert {name: float(v) for name, v in low.items()} == {n: b[0] for n, b in LINKS.items()}


@pytest.fixture(scope="module")
def solved(design):
    """Eccentricity, the stroke that it gives, and its slope, at many points of the box."""

    def eccentricity(unit):
        values = design.description(unit)
        return values["shaft.eccentricity"], stroke(build_linkage(values))

    return jax.jit(jax.vmap(jax.value_and_grad(eccentricity, has_aux=True)))


POINT, STEP = np.array([0.3, 0.6, 0.2, 0.7]), 1e-3
CORNERS = np.stack(np.meshgrid(*[[0.0, 1.0]] * 4), axis=-1).reshape(-1, 4)
# The corners, then a point with its neighbours.
POINTS = np.concatenate([CORNERS, [POINT], POINT + STEP * np.eye(4), POINT - STEP * np.eye(4)])


def test_equal_stroke_holds_in_the_whole_box(solved):
    (eccentricity, travel), _ = solved(POINTS)
    # Newton's last step leaves rounding of lengths of 0.7 m.
    np.testing.assert_allclose(travel, EqualStroke.of({}).target, rtol=1e-12)
    assert np.ptp(eccentricity) > 0.01


def test_eccentricity_has_the_right_derivative(solved):
    (eccentricity, _), slopes = solved(POINTS)
    differences = (eccentricity[17:21] - eccentricity[21:]) / (2 * STEP)
    # Central differences over 1e-3 of the box: third derivatives of order one leave 1e-6.
    np.testing.assert_allclose(slopes[16], differences, rtol=1e-5)


@pytest.mark.slow
def test_eccentricity_has_the_right_second_derivatives(design, solved):
    _, slopes = solved(POINTS)
    differences = (slopes[17:21] - slopes[21:]) / (2 * STEP)
    found = jax.jit(jax.hessian(lambda unit: design.description(unit)["shaft.eccentricity"]))(POINT)
    # As above; with one step of Newton's the curvature of the stroke is missing.
    np.testing.assert_allclose(found, differences, rtol=1e-4, atol=1e-8)


def test_a_stroke_out_of_reach_is_not_a_number():
    reach = EqualStroke(0.2, (0.004, 0.04))
    flat = Design({"jaw.length": (0.66, 0.73)}, jc.paper_machine(), reach)
    assert np.isnan(flat.description(np.array([0.5]))["shaft.eccentricity"])
    with pytest.raises(ValueError, match=r"^Argument `shaft\.eccentricity` must be finite"):
        flat.scene(np.array([0.5]))


def test_counterweight_by_its_moment():
    both = CounterweightMoment()
    names = both.inputs
    values = both({names[0]: -3.0, names[1]: 4.0, "counterweight.radius": 0.25})
    shaft = build_linkage(values).bodies.at("shaft")
    assert float(shaft.mass) == pytest.approx(95.0 + 5.0 / 0.25, rel=1e-14)
    plain = build_linkage({}).bodies.at("shaft")
    added = shaft.mass * shaft.mass_centre.vector().array()
    added -= plain.mass * plain.mass_centre.vector().array()
    np.testing.assert_allclose(added, [-3.0, 4.0], rtol=1e-13)

    def first_moment(moment):
        values = both(dict(zip(names, moment, strict=True)))
        shaft = build_linkage(values).bodies.at("shaft")
        return shaft.mass * shaft.mass_centre.vector().array()

    # Also where there is no counterweight the moment has a slope: it is the moment itself.
    np.testing.assert_allclose(
        jax.jit(jax.jacobian(first_moment))(jnp.zeros(2)), np.eye(2), atol=1e-12
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (({},), "`bounds` must name a parameter"),
        (({"sped": (1.0, 2.0)},), "`sped` must be a known name"),
        (
            ({"counterweight.moment_along": (0.0, 1.0)},),
            "`bounds` must name both parts of the moment",
        ),
        (({"jaw.length": (0.7, 0.7)},), "`bounds of jaw.length` must be finite, LOW < HIGH"),
        (({"jaw.length": (0.6, np.inf)},), "`bounds of jaw.length` must be finite"),
        (({"jaw.length": (-0.7, 0.7)},), "`jaw.length` must be finite and > 0 m"),
        (({"restitution": (0.5, 1.5)},), "`restitution` must lie in"),
        (
            (LINKS | {"shaft.eccentricity": (0.01, 0.02)}, jc.paper_machine(), EqualStroke.of({})),
            "`bounds` must name nothing that follows",
        ),
    ],
)
def test_bad_designs(arguments, words):
    with pytest.raises(ValueError, match=words) as error:
        Design(*arguments)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("point", [[1.1], [-0.1], [np.nan], [0.5, 0.5]])
def test_points_outside_the_box(point):
    design = Design({"jaw.length": (0.6, 0.7)})
    with pytest.raises(ValueError, match=r"^Argument `unit` must be 1 numbers in \[0, 1\]"):
        design.scene(np.array(point))


def test_a_linkage_that_does_not_close():
    design = Design({"bearing.distance": (0.64, 1.2)})
    with pytest.raises(ValueError, match="let the links close in every turn"):
        design.scene(np.array([1.0]))

    def rms(unit):
        scene = design.scene(unit).ideal()
        return jc.statistics(scene, 0, 1, outputs=("foundation_rms",)).foundation_rms

    # Traced, it has no number.
    assert np.isnan(jax.jit(rms)(jnp.array([1.0])))
    assert np.isfinite(jax.jit(rms)(jnp.array([0.0])))
