"""Power, momentum and the agreement of the formulations, without integrating anything."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher import observables as ob
from jaxcrusher.crusher.observables import OBSERVABLES, observables_of
from jaxcrusher.mechanism.drives import GivenTorque
from jaxcrusher.mechanism.eccentricity import EccentricityFormulation
from jaxcrusher.mechanism.multiplier import MultiplierFormulation
from jaxcrusher.mechanism.starts import Given
from tests.pairs import crossed

FORMULATIONS = {"eccentricity": EccentricityFormulation(), "multiplier": MultiplierFormulation()}
# In flight, at the corner of the contact, in light and in hard contact; in or out, sliding.
STATES = [
    ((0.3, -0.5), (0.2, 0.1)),
    ((0.6, 0.8), (0.1, -0.3)),
    ((-0.72, 0.7), (0.3, 0.4)),
    ((0.1, 1.04), (-0.2, 0.02)),
    ((-0.9, -0.6), (0.5, 0.9)),
]


def placed(scene, state):
    (x, y), (u, v) = state
    return eqx.tree_at(
        lambda s: s.start, scene, Given({"main": Vector(x, y)}, {"main": Vector(u, v)})
    )


def with_formulation(scene, name):
    return eqx.tree_at(lambda s: s.formulation, scene, FORMULATIONS[name])


CHOICES = {
    "surface": {"slip": "surface"},
    "bare": {"friction": 0.0, "load_law": "none"},
    "closing": {"slip": "centre", "load_law": "closing_stroke"},
    "tracked": {"slip": "surface", "load_law": "normal_to_jaw", "impact_law": "tracked"},
    "rollers": {"contact_law": "rollers", "rollers.damping": 1e5},
}
SCENES = {name: jc.paper_scene(30.0, 0.06e-3, **options) for name, options in CHOICES.items()}
SCENES["torque"] = eqx.tree_at(lambda s: s.drive, SCENES["surface"], GivenTorque(300.0, 30.0))


@pytest.mark.parametrize(("kind", "name"), crossed(SCENES, FORMULATIONS))
def test_power_balance(balance, kind, name):
    """The energies change along the vector field by what the powers put in."""
    scene = SCENES[kind]
    for state in STATES:
        difference, scale = balance(placed(with_formulation(scene, name), state))
        # Rounding of a dozen terms of the size of the powers.
        assert abs(float(difference)) < 1e-10 * float(scale)


@pytest.mark.parametrize(
    "choices", [{"slip": "centre"}, {"slip": "surface"}, {"contact_law": "rollers"}]
)
def test_formulations_agree_at_an_instant(choices):
    scene = jc.paper_scene(30.0, 0.06e-3, **choices)
    names = [n for n in observables_of(scene) if n != "constraint_residual"]

    @eqx.filter_jit
    def observe(scene):
        state = scene.formulation.initial(scene)
        s = scene.formulation.snapshot(jnp.array(0.0), state, scene)
        return {name: OBSERVABLES[name](s, scene) for name in names}

    for state in STATES:
        one, other = (observe(placed(with_formulation(scene, n), state)) for n in FORMULATIONS)
        for name in names:
            # e is a difference of positions of 0.6 m, known to 3e-16: 1e-10 of a penetration of
            # 3e-6 m, so 1e-4 N of 5e5 N, and 1e-7 m/s2 of links of 500 kg that move at 30.
            scale = np.abs(one[name]).max()
            np.testing.assert_allclose(other[name], one[name], rtol=0, atol=1e-8 * scale + 1e-12)


@pytest.mark.parametrize(
    ("law", "name"),
    crossed(
        ("along_jaw", "normal_to_jaw", "closing_stroke", "none"),
        ("eccentricity", "multiplier", "ideal"),
    ),
)
def test_the_ground_feels_the_shaking_force(law, name):
    """R_O + R_C + weights + load = sum of m a: the force on the ground moves by -sum of m a."""
    scene = jc.paper_scene(30.0, 0.06e-3, slip="surface", load_law=law)
    scene = scene.ideal() if name == "ideal" else with_formulation(scene, name)

    @eqx.filter_jit
    def forces(scene):
        s = scene.formulation.snapshot(jnp.array(0.0), scene.formulation.initial(scene), scene)
        m = scene.machine
        weight = Vector(0.0, -(m.shaft.mass + m.jaw.mass + m.toggle.mass) * m.gravity)
        carried = ob.bearing_reaction(s, scene) + ob.toggle_reaction(s, scene) + weight
        load = s.applied.load
        carried = carried if load is None else carried + load.force
        return carried.array(), ob.shaking_force(s, scene).array(), ob.foundation_force(s, scene)

    for state in STATES[: 1 if name == "ideal" else None]:
        carried, shaking, size = forces(scene if name == "ideal" else placed(scene, state))
        # Sums of forces, up to 1e6 N, to rounding.
        np.testing.assert_allclose(carried, -shaking, rtol=0, atol=1e-10 * float(size))


def test_jaw_and_toggle_obey_newton_and_euler():
    """Each about its mass centre, with the moments that the tree's equations never saw."""
    scene = placed(jc.paper_scene(30.0, 0.06e-3, slip="surface"), STATES[4])
    s = scene.formulation.snapshot(jnp.array(0.0), scene.formulation.initial(scene), scene)
    m, linkage = scene.machine, scene.linkage
    at_elbow, at_pivot = ob.elbow_reaction(s, scene), ob.toggle_reaction(s, scene)

    def arm(joint, body):
        end = linkage.joint(joint).bore if body == "jaw" else linkage.joint(joint).pin
        return s.motion.position(end) - s.motion.centre(body)

    jaw = arm("elbow", "jaw").cross(at_elbow) + s.contacts["main"].bearing_moment
    jaw = jaw + arm("main", "jaw").cross(ob.joint_force(s, scene))
    turned = s.accelerations.spin_ups
    assert float(jaw) == pytest.approx(float(m.jaw.inertia * turned["jaw"]), rel=1e-10)
    toggle = arm("pivot", "toggle").cross(at_pivot) - arm("elbow", "toggle").cross(at_elbow)
    assert float(toggle) == pytest.approx(float(m.toggle.inertia * turned["toggle"]), rel=1e-8)


def test_contact_acts_at_one_point():
    """Action and reaction of the joint have no net moment."""
    scene = placed(jc.paper_scene(30.0, 0.06e-3, slip="surface"), STATES[3])
    s = scene.formulation.snapshot(jnp.array(0.0), scene.formulation.initial(scene), scene)
    # About the bearing's centre: the jaw's moment, and -F at the pin's centre e away.
    contact = s.contacts["main"]
    reaction = s.motion.eccentricities["main"].cross(-contact.force) + contact.journal_moment
    assert abs(float(contact.bearing_moment + reaction)) < 1e-12 * abs(
        float(contact.bearing_moment)
    )
    assert float(contact.friction_force) * float(contact.surface_speed) < 0


def test_assembly_at_angle_zero():
    scene = jc.ideal_scene(30.0)
    s = scene.formulation.snapshot(jnp.array(0.0), scene.formulation.initial(scene), scene)
    jaw, toggle = s.motion.axis("jaw"), s.motion.axis("toggle")
    theta2 = np.degrees(np.arctan2(-jaw.x, jaw.y))
    theta3 = np.degrees(np.arctan2(-toggle.y, toggle.x))
    # Independent figures with two decimals.
    assert float(theta2) == pytest.approx(2.21, abs=5e-3)
    assert float(theta3) == pytest.approx(20.12, abs=5e-3)
