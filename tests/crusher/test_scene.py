"""What a scene leaves out is not traced; what it cannot be is refused in one line."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.crusher.machine import crusher_linkage
from jaxcrusher.crusher.template import OBSERVABLES
from jaxcrusher.mechanism.drives import GivenTorque
from jaxcrusher.mechanism.linkage import Body
from jaxcrusher.mechanism.reductions import top
from jaxcrusher.scenes.build import build_linkage
from tests.crusher.operations import field_operations, operations, traced


def count(function, scene):
    """Operations of `function(scene)`."""
    program, numbers = traced(function, scene)
    return operations(jax.make_jaxpr(program)(numbers).jaxpr)


@pytest.mark.slow
def test_what_is_left_out_is_not_traced():
    full = jc.paper_scene(30.0, 0.06e-3, slip="surface")
    frictionless = jc.paper_scene(30.0, 0.06e-3, friction=0)
    assert (
        field_operations(jc.ideal_scene(30.0))
        < field_operations(frictionless)
        < field_operations(full)
    )
    unloaded = jc.paper_scene(30.0, 0.06e-3, slip="surface", load_law="none")
    assert field_operations(unloaded) < field_operations(full)
    times = jnp.linspace(0, 1e-3, 5)

    def histories(outputs):
        return count(lambda s: jc.simulate(s, times, outputs=outputs), full)

    def totals(outputs):
        return count(lambda s: jc.statistics(s, 0, 1, outputs=outputs), full)

    assert totals(("foundation_rms",)) < totals(jc.STATISTICS)
    assert totals(("foundation_rms",)) < histories(jc.OUTPUTS)
    assert histories(("normal_force",)) < histories(("normal_force", "energy"))
    assert histories(("normal_force", "energy")) < histories(jc.OUTPUTS)


def test_outputs_are_what_they_say():
    """Derived outputs against plain reductions of the histories they summarise."""
    scene = jc.paper_scene(30.0, 0.06e-3, start="contact")
    motion = jc.simulate(scene, 2 * np.pi / 30 * np.linspace(1, 2, 4097))
    result = jc.statistics(scene, 1, 1)
    force = np.asarray(motion.foundation_force)
    # The trapezium rule of 4096 points over a turn of a 130 Hz swing: 1e-5.
    mean_square = np.trapezoid(force**2) / (force.size - 1)
    assert float(result.foundation_rms) == pytest.approx(np.sqrt(mean_square), rel=1e-5)
    mean = np.trapezoid(force) / (force.size - 1)
    assert float(result.foundation_mean) == pytest.approx(mean, rel=1e-5)
    # The peak's parabola.
    assert float(result.foundation_peak) == pytest.approx(force.max(), rel=1e-5)
    assert float(result.contact_fraction) == 1 == float(motion.contact_fraction)
    reactions = np.linalg.norm(motion.bearing_reaction, axis=1) + np.linalg.norm(
        motion.toggle_reaction, axis=1
    )
    np.testing.assert_allclose(force, reactions, rtol=1e-12)
    np.testing.assert_allclose(motion.drive_power, 30 * motion.drive_torque, rtol=1e-12)
    # Differences of 1024 points of the path of B against its velocity: truncation 1e-4.
    difference = np.gradient(motion.jaw_displacement[:, 0], motion.time)
    speed = np.asarray(motion.jaw_velocity[:, 0])
    np.testing.assert_allclose(difference[1:-1], speed[1:-1], atol=1e-4 * abs(speed).max())


def test_peak_between_samples():
    angle = 2 * np.pi * np.arange(1024) / 1024
    for shift in (0.0011, 3.0, 6.27):
        samples = jnp.asarray(5 + np.cos(angle - shift))
        # The largest sample is up to 4.7e-6 low; the parabola's error is of fourth order.
        assert float(top(samples)) == pytest.approx(6, abs=1e-9)


def crusher(length, mass=524.0, inertia=128.48):
    """Return the paper's linkage with another jaw."""
    one = build_linkage({})
    return crusher_linkage(
        one.bodies.at("shaft"),
        Body(mass, inertia),
        one.bodies.at("toggle"),
        eccentricity=one.joints.at("main").pin.arm.x,
        jaw_length=length,
        toggle_length=one.joints.at("elbow").pin.arm.x,
        bearing=one.joints.at("shaft_bearing").bore.arm.vector(),
    )


SCENE, PAPER = jc.paper_scene(30.0, 6e-5), jc.paper_machine()
BAD = [
    (lambda: jc.paper_scene(30.0, 0.0), "clearance", "0.0", "> 0 m"),
    (lambda: jc.paper_scene(30.0, -1e-5), "clearance", "-1e-05", "> 0 m"),
    (lambda: jc.paper_scene(30.0, float("nan")), "clearance", "nan", "finite"),
    (lambda: jc.paper_scene(30.0, 0.13), "clearance", "0.13", "0.13 m"),
    (lambda: jc.paper_scene(0.0, 6e-5), "speed", "0.0", "> 0 rad/s"),
    (lambda: jc.paper_scene(float("inf"), 6e-5), "speed", "inf", "finite"),
    (lambda: jc.ideal_scene(-1.0), "speed", "-1.0", "> 0 rad/s"),
    (lambda: GivenTorque(300.0, -1.0), "speed", "-1.0", "> 0 rad/s"),
    (lambda: jc.paper_scene(30.0, 6e-5, friction=-0.1), "friction", "-0.1", "[0, 10]"),
    (lambda: jc.paper_scene(30.0, 6e-5, impact_velocity=0.0), "impact_velocity", "0.0", "> 0"),
    (
        lambda: jc.paper_scene(30.0, 6e-5, friction=None),
        "friction",
        "None",
        "0 leaves friction out",
    ),
    # Of an earlier dialect, in which a law stood in place of its number.
    (lambda: jc.paper_scene(30.0, 6e-5, load="closing_stroke"), "load", "stroke'", "`load_law`"),
    (lambda: jc.ideal_scene(30.0, load=None), "load", "None", "'along_jaw', 'normal_to_jaw'"),
    (
        lambda: jc.paper_scene(30.0, 6e-5, impact_velocity="tracked"),
        "impact_velocity",
        "'tracked'",
        "`impact_law`",
    ),
    (lambda: jc.paper_scene([25.0, 30.0], 6e-5), "speed", "[25.0, 30.0]", "a number in rad/s"),
    (lambda: jc.paper_scene(30.0, 6e-5, start="middle"), "start", "'middle'", "'contact'"),
    (lambda: jc.paper_scene(30.0, 6e-5, slip="no"), "slip", "'no'", "'surface'"),
    (lambda: jc.paper_scene(30.0, 6e-5, load_law="up"), "load_law", "'up'", "'along_jaw'"),
    (lambda: jc.paper_scene(30.0, 6e-5, formulation="x"), "formulation", "'x'", "'multiplier'"),
    (lambda: crusher(0.695, mass=-524.0), "jaw.mass", "-524", "> 0 kg"),
    (lambda: crusher(0.695, inertia=0.0), "jaw.inertia", "0.0", "> 0"),
    # C-A from 0.63 to 0.65 m: 0.3 + 0.3 is too short, and 0.345 + 0.3 passes a dead point.
    (
        lambda: crusher(0.3),
        "jaw.length`, `toggle.length` and `bearing.distance",
        "650",
        "600 mm",
    ),
    (
        lambda: crusher(0.345),
        "jaw.length`, `toggle.length` and `bearing.distance",
        "650",
        "645 mm",
    ),
    # Closes with an ideal joint, but not with the pin 3 mm off.
    (
        lambda: jc.paper_scene(30.0, 3e-3, **{"jaw.length": 0.352}),
        "jaw.length`, `toggle.length` and `bearing.distance",
        "653",
        "652 mm",
    ),
    (lambda: jc.simulate(jc.ideal_scene(30.0), [0.0, 2.0, 1.0]), "times", "1.", "increase"),
    (lambda: jc.simulate(jc.ideal_scene(30.0), [-1.0, 1.0]), "times", "-1", ">= 0 s"),
    (lambda: jc.simulate(jc.ideal_scene(30.0), [0.0, np.nan]), "times", "nan", "finite"),
    (lambda: jc.simulate(jc.ideal_scene(30.0), []), "times", "(0,)", "n > 0"),
    # Wrong kinds of argument: a class, many speeds, a builder, a scene.
    (lambda: jc.Method(diffrax.Dopri5), "solver", "the class Dopri5: call it", "diffrax.Dopri8()"),
    (
        lambda: jc.Method(stepsize_controller=diffrax.ConstantStepSize),
        "stepsize_controller",
        "the class ConstantStepSize",
        "ConstantStepSize()",
    ),
    (
        lambda: jc.statistics(jc.ideal_scene(30.0), 0, 1, method=diffrax.Dopri5()),
        "method",
        "a Dopri5",
        "jaxcrusher.Method",
    ),
    (
        lambda: jc.statistics(jc.ideal_scene(np.array([25.0, 30.0])), 0, 1),
        "speed",
        "of shape (2,)",
        "jaxcrusher.sweep",
    ),
    (
        lambda: jc.statistics(jc.paper_scene(25.0, np.array([3e-5, 6e-5])), 0, 1),
        "clearance",
        "of shape (2,)",
        "one number",
    ),
    (lambda: jc.statistics(jc.paper_scene, 0, 1), "scene", "paper_scene: call it", "such as"),
    (lambda: jc.simulate({"speed": 30.0}, [1.0]), "scene", "a dict", "paper_scene(30.0, 6e-5)"),
    (
        lambda: jc.gradient_report(jc.paper_scene(30.0, 6e-5), "foundation_rms", {"speed": 30.0}),
        "machine",
        "a Scene",
        "a function that makes a scene",
    ),
    (lambda: jc.statistics(jc.ideal_scene(30.0), -1, 1), "settle_turns", "-1", ">= 0"),
    (lambda: jc.statistics(jc.ideal_scene(30.0), 0, 0), "turns", "0", ">= 1"),
    (lambda: jc.statistics(jc.ideal_scene(30.0), 0, 1.5), "turns", "1.5", "whole number"),
    # Misspelt: what comes near, and not two dozen names.
    (
        lambda: jc.statistics(jc.ideal_scene(30.0), 0, 1, outputs=("foundation_rm",)),
        "outputs",
        "'foundation_rm' (is 'foundation_rms' or",
        "be a known name,",
    ),
    (lambda: jc.build_scene({"sped": 30.0}), "sped", "not (is 'speed' meant?)", "known name"),
    (lambda: jc.paper_scene(30.0, 6e-5, frction=0.1), "frction", "is 'friction'", "known name"),
    (lambda: jc.paper_machine(strt="contact"), "strt", "'start'", "known"),
    # Of another kind than is meant.
    (lambda: jc.sweep(SCENE, {"speed": [30.0]}, 0, 1), "machine", "a Scene", "paper_machine()"),
    (lambda: jc.orbit_map(None, {"speed": [30.0]}), "machine", "a NoneType", "be a machine"),
    (lambda: jc.basin_map({"speed": [30.0]}, base=SCENE), "base", "a Scene", "map names"),
    (lambda: jc.sweep({"speed": [30.0]}, 0, 1, scene=SCENE), "machine", "a Scene", "a function"),
    (lambda: jc.identify(SCENE, [], ["speed"]), "machine", "a Scene", "be a machine"),
    (lambda: jc.periodic_orbit((30.0, 6e-5)), "scene", "a tuple", "paper_scene(30.0, 6e-5)"),
    (lambda: jc.regime(30.0), "scene", "a float", "paper_scene(30.0, 6e-5)"),
    (lambda: jc.coexisting_orbits(jc.paper_scene), "scene", "paper_scene: call it", "instance"),
    (lambda: jc.orbit_branch(SCENE, 6e-5, (1e-5, 1e-4)), "machine", "a Scene", "a function"),
    (
        lambda: jc.bifurcation(SCENE, "speed", [1.0], settle_turns=0, turns=20),
        "machine",
        "a Scene",
        "a function that makes a scene",
    ),
    (
        lambda: jc.gradient_report(jc.paper_scene, "foundation_rms", 6e-5),
        "parameters",
        "6e-05",
        '{"speed": 30.0}',
    ),
    (lambda: jc.statistics(SCENE, 0, 1, rtol="1e-9"), "rtol", "'1e-9'", "a number"),
    (lambda: jc.statistics(SCENE, 0, 1, rtol=-1e-9), "rtol", "-1e-09", "> 0"),
    (lambda: jc.simulate(SCENE, [1e-3], rtol=1e9), "rtol", "1000000000.0", "< 1"),
    (lambda: jc.sweep(PAPER, {"speed": [30.0]}, 0, 1, rtol=2), "rtol", "2", "< 1"),
    (lambda: jc.Method(dt0="1e-6"), "dt0", "'1e-6'", "a number"),
    (lambda: jc.periodic_orbit(SCENE, guess=jnp.zeros(3)), "guess", "shape (3,)", "(n, 2)"),
    (lambda: jc.periodic_orbit(SCENE, guess="rest"), "guess", "'rest'", "a PeriodicOrbit, or"),
    (
        lambda: jc.gradient_report(jc.paper_scene, "foundation_rms", {"speed": "30"}),
        "parameters['speed']",
        "'30'",
        "a number",
    ),
    (lambda: jc.map_all(np.cos, 30.0), "scenes", "with none", "a first axis"),
    (lambda: jc.map_all(np.cos, {"a": np.ones(2), "b": np.ones(3)}), "scenes", "2, 3", "length"),
    (lambda: jc.map_all(np.ones(2), np.cos), "function", "a ndarray", "be one"),
    (
        lambda: jax.vmap(jc.periodic_orbit)(jax.tree.map(lambda leaf: jnp.ones((1, 2)), SCENE)),
        "speed",
        "of shape (2,)",
        "jax.vmap and jaxcrusher.sweep take many",
    ),
]
# Python steers by the numbers of these: under a trace they ended after minutes, in JAX's words.
TRACED = {
    "scene": (
        lambda c: jc.regime(jc.paper_scene(30.0, c)).zero_one,
        lambda c: jc.coexisting_orbits(jc.paper_scene(30.0, c)).shares[0],
    ),
    "start": (lambda c: jc.orbit_branch(PAPER, "clearance", c, (1e-5, 1e-4)),),
    "values": (
        lambda c: jc.bifurcation(PAPER, "clearance", [c], settle_turns=0, turns=20),
        lambda c: jc.bifurcation(PAPER, "clearance", c[None], settle_turns=0, turns=20),
    ),
    "parameters": (lambda c: jc.gradient_report(PAPER, "foundation_rms", {"clearance": c}),),
}


@pytest.mark.parametrize("transform", [jax.grad, jax.jit])
@pytest.mark.parametrize(
    "name, function", [(name, one) for name, several in TRACED.items() for one in several]
)
@pytest.mark.usefixtures("unchecked")
def test_what_cannot_be_traced_says_so_at_once(transform, name, function):
    words = rf"^Argument `{name}` must hold known numbers \(jax.grad, .* but is traced\."
    with pytest.raises(ValueError, match=words):
        transform(function)(6e-5)


@pytest.mark.parametrize("make, name, value, limit", BAD)
@pytest.mark.usefixtures("unchecked")
def test_bad_input_is_refused_in_one_line(make, name, value, limit):
    with pytest.raises(ValueError) as error:
        make()
    text = str(error.value)
    assert "\n" not in text
    assert text.startswith(f"Argument `{name}` must ")
    must, got = text.rsplit("but is ", 1)
    assert value in got and limit in must


def test_an_ideal_joint_has_no_eccentricity():
    scene = jc.ideal_scene(30.0)
    here = scene.formulation.snapshot(jnp.zeros(()), scene.formulation.initial(scene), scene)
    for name in ("eccentricity", "elbow_eccentricity", "pivot_eccentricity"):
        assert OBSERVABLES[name](here, scene).tolist() == [0.0, 0.0]
