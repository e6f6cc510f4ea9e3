"""A crusher by named numbers: the paper's by default, and bad names and numbers refused."""

import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.plane import Vector, direction
from jaxcrusher.crusher.machine import with_counterweight
from jaxcrusher.mechanism.drives import ConstantSpeed
from jaxcrusher.mechanism.eccentricity import EccentricityFormulation
from jaxcrusher.scenes.build import build_chamber, build_linkage
from jaxcrusher.scenes.own_laws import check_description
from jaxcrusher.scenes.parameters import (
    CHOICES,
    LOOSE_JOINTS,
    PARAMETERS,
    PREFIXES,
    numbers_of,
    openers,
    within_limits,
)

# Of angle (rad) and force (N).
CURVE = np.array([[0.0, 1e3], [2.0, 9e3], [4.0, 4e3], [5.0, 2e3]])
SOIL = "foundation.soil.shear_modulus", "foundation.soil.shear_wave_speed"
ROCKING = "foundation.rocking_stiffness", "foundation.rocking_damping"
# What opens names -> what a description then has.
OPENED = {
    ("load_scatter",): {"load_scatter": 0.1},
    ("speed_fluctuation",): {"speed_fluctuation": 0.02},
    ("load_point",): {"load_point": 0.3},
    SOIL: {"foundation.soil.shear_modulus": 6e7},
    **{(name,): {name: PARAMETERS[name].default} for name in (*ROCKING, *SOIL)},
    ("load_edge",): {"load_law": "closing_stroke", "load_edge": 0.2},
    ("load_law=by_angle",): {"load_law": "by_angle", "load_curve": CURVE},
    ("rod.stiffness", "rod.preload"): {"rod.stiffness": 2e5, "rod.preload": 1e4},
    ("load_law=chamber",): {"load_law": "chamber"},
    ("contact_law=rollers",): {"contact_law": "rollers"},
    **{(f"{at}film.viscosity",): {f"{at}film.viscosity": 0.05} for at in PREFIXES},
}


def test_what_is_counted_is_whole():
    for name in ("rollers.bearings", "rollers.count"):
        assert PARAMETERS[name].default % 1 == 0


def test_defaults_are_tables_1_and_2():
    linkage = build_linkage({})
    bodies = {
        "shaft": {"mass": 95.0, "inertia": 0.2, "eccentricity": 0.01, "mass_centre_radius": 0.006},
        "jaw": {"mass": 524.0, "inertia": 128.48, "length": 0.695, "mass_centre_distance": 0.3},
        "toggle": {"mass": 22.0, "inertia": 0.7154, "length": 0.3},
    }
    for body, numbers in bodies.items():
        for name, value in numbers.items():
            assert PARAMETERS[f"{body}.{name}"].default == value, f"{body}.{name}"
    joint = {"clearance": 6e-5, "bore_radius": 0.13, "friction": 0.1, "restitution": 0.9}
    joint |= {"impact_velocity": 0.5, "young": 207e9, "poisson": 0.29}
    for name, value in (joint | {"speed": 30.0, "load": 8.8e3, "gravity": 9.81}).items():
        assert PARAMETERS[name].default == value, name
    bearing, jaw = linkage.joints.at("shaft_bearing").bore.arm, linkage.bodies.at("jaw").mass_centre
    assert float(linkage.bodies.at("shaft").mass) == 95.0
    # Table 2: O at 0.64 m, 22.5 deg off the vertical; S2 = A - l21 (B-A axis turned by 15 deg).
    assert float(bearing.x) == pytest.approx(0.64 * np.sin(np.pi / 8), rel=1e-15)
    assert float(jaw.x) == pytest.approx(-0.3 * np.cos(np.pi / 12), rel=1e-15)
    assert float(jaw.y) == pytest.approx(-0.3 * np.sin(np.pi / 12), rel=1e-15)
    scene = jc.build_scene({})
    assert isinstance(scene.formulation, EccentricityFormulation)
    assert isinstance(scene.drive, ConstantSpeed)


def test_nothing_has_slopes_by_a_whole_number():
    names = ("speed", "fluctuation_order", "load_seed", "chamber.nip_angle")
    described = dict.fromkeys(names, 1.0)
    assert numbers_of(described) == ["speed"]
    assert numbers_of(described | {"load_law": "chamber"}) == ["speed", "chamber.nip_angle"]


def test_every_number_reaches_the_scene():
    """A name that is ignored would leave the scene as it is."""
    loose = {f"{joint}.clearance": 1e-4 for joint in LOOSE_JOINTS} | {"foundation.mass": 6e3}
    plain = jax.tree.leaves(jc.build_scene(loose))
    for name, parameter in jc.PARAMETERS.items():
        values = {name: parameter.default + 0.01 * parameter.scale}
        if name == "fluctuation_order":
            values = {name: 2.0}  # a whole number
        if name in ("counterweight.radius", "counterweight.angle"):
            plain_here = jax.tree.leaves(jc.build_scene(loose | {"counterweight.mass": 10.0}))
            values["counterweight.mass"] = 10.0
        elif (law := OPENED.get(openers(name))) is not None:
            plain_here = jax.tree.leaves(jc.build_scene(loose | law))
            values = law | values
        else:
            plain_here = plain
        if name == "counterweight.mass":
            values = {name: 10.0}
        changed = jax.tree.leaves(jc.build_scene(loose | values))
        assert any(not np.array_equal(a, b) for a, b in zip(plain_here, changed, strict=True)), name


def test_every_choice_makes_another_scene():
    loose = {f"{joint}.clearance": 1e-4 for joint in LOOSE_JOINTS}
    for name, choices in CHOICES.items():
        plain = loose | OPENED.get(openers(name), {})
        for choice in choices[1:]:
            given = plain | OPENED.get((f"{name}={choice}",), {name: choice})
            assert not eqx.tree_equal(jc.build_scene(plain), jc.build_scene(given)), (name, choice)


@pytest.mark.parametrize("formulation", CHOICES["formulation"])
def test_ideal_twin_differs_in_its_joint_only(formulation):
    values = {"speed": 33.0, "jaw.mass": 500.0, "gravity": 9.0, "load_law": "closing_stroke"}
    scene = jc.build_scene({**values, "formulation": formulation, "start": "contact"})
    assert eqx.tree_equal(scene.ideal(), jc.build_scene({**values, "joint": "ideal"}))


def test_counterweight_is_a_point_mass():
    """Mass, first moment and moment of inertia about O add up."""
    shaft = build_linkage({}).bodies.at("shaft")
    position = 0.25 * direction(jnp.array(2.0))
    both = with_counterweight(shaft, 30.0, position)
    assert float(both.mass) == 125.0
    centre, before = both.mass_centre.vector(), shaft.mass_centre.vector()
    first = both.mass * centre
    expected = shaft.mass * before + 30.0 * position
    # Rounding of a handful of operations.
    np.testing.assert_allclose(first.array(), expected.array(), rtol=1e-14)
    about_o = both.inertia + both.mass * centre.dot(centre)
    alone = shaft.inertia + shaft.mass * before.dot(before)
    np.testing.assert_allclose(about_o, alone + 30.0 * 0.25**2, rtol=1e-14)
    linkage = build_linkage(
        {"counterweight.mass": 30.0, "counterweight.radius": 0.25, "counterweight.angle": 2.0}
    )
    built = linkage.bodies.at("shaft")
    centre = built.mass_centre.vector()
    found = built.inertia + built.mass * centre.dot(centre)
    np.testing.assert_allclose(found, about_o, rtol=1e-14)
    nothing = with_counterweight(shaft, 0.0, Vector(1.0, 2.0))
    np.testing.assert_allclose(nothing.inertia, shaft.inertia, rtol=1e-15)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"sped": 30.0}, "`sped` must be a known name, but is not (is 'speed' meant?)"),
        ({"speed": -1.0}, "`speed` must be finite and > 0 rad/s, but is -1.0"),
        ({"stroke": 8e-3}, "`stroke` must be a scene file's, or shaft.eccentricity, but is given"),
        ({"restitution": 1.5}, "[0.01, 1]"),
        ({"start": "somewhere"}, "'centred', 'contact'"),
        ({"jaw.length": np.array([0.7, np.nan])}, "jaw.length"),
    ],
)
def test_refusals(values, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        check_description(values)


def test_a_traced_number_is_nan_outside_its_limits_alone():
    """Those of a coefficient with both ends, and of a mass that must be > 0."""
    friction, mass = [-1e-12, 0.0, 0.1, 10.0, 10.1], [-1.0, 0.0, 1e-300, 1e300, np.inf]

    @jax.jit
    def known(friction, mass):
        return within_limits({"friction": friction, "jaw.mass": mass, "speed": 30.0})

    found = jax.vmap(known)(jnp.array(friction), jnp.array(mass))
    np.testing.assert_array_equal(found["friction"], [np.nan, 0.0, 0.1, 10.0, np.nan])
    np.testing.assert_array_equal(found["jaw.mass"], [np.nan, np.nan, 1e-300, 1e300, np.nan])
    assert (np.asarray(found["speed"]) == 30.0).all()


@pytest.mark.parametrize(
    ("name", "limit", "other"),
    [
        ("clearance", 0.13, {"bore_radius": 0.13}),
        ("elbow.clearance", 0.04, {"elbow.bore_radius": 0.04}),
        ("load_point", np.nextafter(0.695, 1), {"jaw.length": 0.695}),
        ("rollers.diameter", 0.19, {"rollers.pitch_diameter": 0.19}),
        ("foundation.left", 0.9, {"foundation.right": 0.9}),
    ],
)
def test_a_traced_number_is_nan_beyond_a_limit_that_is_another_number(name, limit, other):
    known = jax.jit(jax.vmap(lambda value: within_limits({name: value, **other})[name]))
    assert np.isnan(known(jnp.array([np.nextafter(limit, -1), limit]))).tolist() == [False, True]
    traced = jax.jit(lambda other: within_limits({name: limit, **other})[name])
    assert np.isnan(traced(other))


def test_a_traced_diameter_of_rollers_reaches_the_scene():
    """It is not known whether they fit their pitch, so that nothing is refused."""
    for name in ("rollers.diameter", "rollers.pitch_diameter"):
        traced = jax.eval_shape(
            lambda size, name=name: jc.build_scene({"contact_law": "rollers", name: size}), 0.02
        )
        bearing = traced.joints.at("main")
        assert bearing.roller_diameter.shape == bearing.pitch_diameter.shape == ()


def test_friction_of_zero_is_left_out_unless_traced():
    scene = jc.build_scene({"friction": 0.0})
    assert scene.joints.at("main").friction is None
    traced = jax.vmap(lambda f: jc.build_scene({"friction": f}))(jnp.array([0.0, 0.1]))
    assert traced.joints.at("main").friction is not None


@pytest.mark.parametrize("wrap", [jax.grad, lambda function: function])
@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"clearance": 0.2}, "be smaller than the bore radius"),
        (
            {"contact_law": "rollers", "rollers.diameter": 0.2},
            "`rollers.diameter` must be smaller than the pitch diameter",
        ),
        ({"foundation.mass": 6e3, "foundation.left": 2.0}, "be less than foundation.right"),
        ({"toggle.length": 0.05}, "let the links close in every turn"),
        ({"chamber.discharge": 5e-3}, "be wider than the jaw's stroke"),
    ],
)
def test_what_cannot_be_is_refused_under_a_derivative_too(values, words, wrap):
    """It gave numbers there, or the traceback of a message that could not be written."""
    name, value = list(values.items())[-1]

    def built(number):
        described = {**values, name: number}
        made = build_chamber(described) if "chamber" in name else jc.build_scene(described)
        return sum(jax.tree.leaves(made))

    with pytest.raises(ValueError, match=words):
        wrap(built)(value)
