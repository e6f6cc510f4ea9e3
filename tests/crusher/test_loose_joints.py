"""Clearance in A, B, C and O: power, momentum, and the agreement of the formulations."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

import jaxcrusher as jc
from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher.template import OBSERVABLES
from jaxcrusher.mechanism.drives import GivenTorque
from jaxcrusher.mechanism.equations import solve
from jaxcrusher.mechanism.multiplier import MultiplierFormulation
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.starts import Given, shifted_start
from jaxcrusher.mechanism.state import snapshot_of
from tests.crusher.kinds import at_start, check_laws, placed
from tests.crusher.operations import field_operations
from tests.pairs import crossed, slow

CLEARANCES = {"elbow": 1e-4, "pivot": 8e-5, "shaft_bearing": 5e-5}
# Which of A, B, C and O are loose.
LOOSE = ["ABCO", "O", "B", "C", "BC", "AB", "AC", "ABC", "AO", "CO"]
# e in clearances and e' (m/s) of A, B, C: in flight, in light and in hard contact, sliding. The
# shaft's bearing O is as B.
STATES = [
    (((0.3, -0.5), (0.2, 0.1)), ((0.1, 0.7), (-0.2, 0.3)), ((-0.4, 0.2), (0.1, -0.4))),
    (((0.6, 0.81), (0.1, -0.3)), ((-0.9, -0.6), (0.5, 0.9)), ((0.72, 0.73), (-0.6, 0.4))),
    (((-0.72, 0.7), (0.3, 0.4)), ((0.0, 1.04), (0.9, -0.1)), ((0.2, -0.3), (0.3, 0.2))),
]


def described(letters, slip="surface", **values):
    found = {"joint": "clearance" if "A" in letters else "ideal", "slip": slip, **values}
    for letter, joint in (("B", "elbow"), ("C", "pivot"), ("O", "shaft_bearing")):
        if letter in letters:
            found[f"{joint}.clearance"] = CLEARANCES[joint]
            found[f"{joint}.slip"] = slip
    return found


def free_shaft(scene):
    return eqx.tree_at(lambda s: s.drive, scene, GivenTorque(300.0, 30.0))


def test_a_joint_whose_start_is_not_given_rests_amid_its_bore():
    scene = jc.build_scene(described("ABC"))
    start = Given({"main": Vector(0.3, -0.5)}, {"main": Vector(0.2, 0.1)})
    places, rates = start.eccentricities(scene)
    assert [float(rates["main"].x), float(rates["main"].y)] == [0.2, 0.1]
    for given in (places, rates):
        for joint in ("elbow", "pivot"):
            assert (float(given[joint].x), float(given[joint].y)) == (0.0, 0.0)


def test_a_shifted_start_moves_the_pin_of_one_joint_alone():
    scene = jc.build_scene(described("ABC", start="contact"))
    before, rates = scene.start.eccentricities(scene)
    for named, moved in ((None, "main"), ("pivot", "pivot")):
        shifted = shifted_start(scene, Vector(-0.2, 0.1), named)
        after, same = shifted.start.eccentricities(shifted)
        there = before[moved] + scene.joints[moved].clearance * Vector(-0.2, 0.1)
        expected = Named({**dict(before.items()), moved: there})
        # Places are divided by the clearances and multiplied again.
        for found, wanted in ((after, expected), (same, rates)):
            np.testing.assert_allclose(jax.tree.leaves(found), jax.tree.leaves(wanted), rtol=1e-12)


def test_a_joint_that_is_put_into_a_scene_is_refused_by_its_own_name():
    scene = jc.build_scene(described("B"))
    wide = eqx.tree_at(lambda joint: joint.clearance, scene.joints.at("elbow"), jnp.array(1.0))
    with pytest.raises(ValueError, match=r"^Argument `elbow\.clearance`"):
        scene.with_bearing("elbow", wide)


def test_baumgarte_s_terms_end_what_violates_the_constraints():
    """Each violation follows v'' + 2 alpha v' + beta^2 v = 0 (Table 2)."""
    form = MultiplierFormulation(alpha=7.0, beta=11.0)
    scene = jc.paper_scene(30.0, 6e-5, formulation="multiplier")
    start, unravel = ravel_pytree(form.initial(scene))
    off = unravel(start + 1e-4 * np.random.default_rng(5).standard_normal(start.size))

    def constraints(time, state):
        motion = form.snapshot(time, state, scene).motion
        off, rate = [motion.crank.angle - 30.0 * time], [motion.crank.speed - 30.0]
        for name, joint in scene.linkage.joints.items():
            if name not in scene.joints:
                for found, of in ((off, motion.position), (rate, motion.velocity)):
                    apart = of(joint.pin) - of(joint.bore)
                    found += [apart.x, apart.y]
        return jnp.stack(off), jnp.stack(rate)

    change = form.rate(form.snapshot(jnp.array(0.0), off, scene), off, scene)
    at = jnp.array(0.0), off
    (violation, rate), (first, second) = jax.jvp(constraints, at, (jnp.array(1.0), change))
    assert np.abs(violation).min() > 0
    np.testing.assert_allclose(first, rate, rtol=1e-9)
    # Terms of size 1e3 m/s2 cancel in the accelerations.
    np.testing.assert_allclose(second, -14.0 * rate - 121.0 * violation, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize(
    ("letters", "drive", "formulation"),
    crossed(LOOSE, ("constant", "torque"), ("eccentricity", "multiplier"), later=LOOSE[2:]),
)
def test_power_and_pushes_of_the_frame(letters, drive, formulation):
    scene = jc.build_scene(described(letters, formulation=formulation))
    scene = free_shaft(scene) if drive == "torque" else scene
    for state in STATES:
        check_laws(placed(scene, *state, state[1]))


# What A may be, by itself: e and e' in flight, at the corner of the contact, in light and in hard
# contact, in or out, sliding.
CHOICES = {
    "bare": {"friction": 0.0, "load_law": "none"},
    "closing": {"slip": "centre", "load_law": "closing_stroke"},
    "tracked": {"slip": "surface", "load_law": "normal_to_jaw", "impact_law": "tracked"},
    "rollers": {"contact_law": "rollers", "rollers.damping": 1e5},
    "torque": {"slip": "surface"},
}
OF_A = [
    ((0.3, -0.5), (0.2, 0.1)),
    ((0.6, 0.8), (0.1, -0.3)),
    ((-0.72, 0.7), (0.3, 0.4)),
    ((0.1, 1.04), (-0.2, 0.02)),
    ((-0.9, -0.6), (0.5, 0.9)),
]


@pytest.mark.parametrize(("kind", "formulation"), crossed(CHOICES, ("eccentricity", "multiplier")))
def test_power_of_the_main_joint(kind, formulation):
    scene = jc.build_scene({"formulation": formulation, **CHOICES[kind]})
    scene = free_shaft(scene) if kind == "torque" else scene
    for state in OF_A:
        check_laws(placed(scene, state))


AGREE = {"A": described("A"), "centre": described("A", "centre")}
AGREE |= {
    "rollers": {"contact_law": "rollers"},
    **{letters: described(letters) for letters in LOOSE},
}


@pytest.mark.parametrize("kind", ["A", "rollers", "ABCO", *slow("centre", *LOOSE[1:])])
def test_formulations_agree_at_an_instant(kind):
    def observe(scene):
        s = at_start(scene)
        names = [name for name in scene.observables if name != "constraint_residual"]
        return {name: OBSERVABLES[name](s, scene) for name in names}

    one, other = (
        jc.build_scene({**AGREE[kind], "formulation": way})
        for way in ("eccentricity", "multiplier")
    )
    for state in STATES:
        seen, again = (
            observe(placed(one, *state, state[1])),
            observe(placed(other, *state, state[1])),
        )
        # e is a difference of positions of 0.6 m, known to 3e-16: 1e-10 of a penetration, so 1e-4 N
        # of the largest force, which reaches every reaction.
        largest = max(float(np.abs(seen[name]).max()) for name in seen if "force" in name)
        for name in seen:
            scale = largest if OBSERVABLES[name].unit == "N" else np.abs(seen[name]).max()
            close = 1e-8 * float(scale) + 1e-12
            if OBSERVABLES[name].unit in ("N m", "W"):
                close = 1e-8 * largest  # levers of less than 1 m, speeds of about 1 m/s
            np.testing.assert_allclose(again[name], seen[name], rtol=0, atol=close, err_msg=name)


def holding(scene, motion, curvatures):
    """The forces that hold joints while their eccentricities change so."""
    held = partial(solve, curvatures=curvatures)
    return snapshot_of(scene, motion, Named(), None, None, held).accelerations.forces


@pytest.mark.parametrize("letters", ["A", *LOOSE])
def test_forces_that_hold_a_motion_are_those_that_made_it(letters):
    """What holds joints that move as loose ones do is the force of the loose ones' contacts."""
    values = described(letters)
    smooth = {name.replace("slip", "friction"): 0.0 for name in values if "slip" in name}
    scene = placed(jc.build_scene({**values, **smooth}), *STATES[1], STATES[1][1])
    s = at_start(scene)
    held = holding(scene, s.motion, s.accelerations.eccentricities)
    for name in scene.linkage.joints.names:
        # Sums of forces of 1e5 N.
        found, expected = held[name], s.accelerations.forces[name]
        np.testing.assert_allclose(found.array(), expected.array(), rtol=1e-10, atol=1e-5)


def test_pins_that_rest_carry_their_forces():
    """Each contact's force is that which would hold its joint, and nothing moves off."""
    scene = jc.build_scene(
        described("ABC", slip="centre", load_law="normal_to_jaw", start="contact")
    )
    s = at_start(scene)
    held = holding(scene, s.motion, scene.joints.map(lambda _: Vector(0.0, 0.0)))
    for name, contact in s.contacts.items():
        assert float(contact.penetration) > 0
        apart = contact.force - held[name]
        # The depth changes slowly, by some 0.1 m/s2 of 300 kg.
        assert float(jnp.hypot(apart.x, apart.y)) < 5e-3 * float(contact.normal_force)
    names = ("penetration_ratio", "elbow_penetration_ratio", "pivot_penetration_ratio")
    motion = jc.simulate(scene, np.linspace(0, 0.05, 501), outputs=names)
    for name in names:
        # At rest but for a swing that the refinements leave, less than a tenth of the depth.
        assert float(motion[name].min()) > 0.9 * float(motion[name][0]) * 0.2, name


def test_the_main_joint_alone_costs_what_it_did():
    """Operations of one evaluation: what is loose or pressed elsewhere adds none."""
    assert field_operations(jc.paper_scene(30.0, 0.06e-3, slip="surface")) == 326
    assert field_operations(jc.paper_scene(30.0, 0.06e-3, friction=0)) == 251
    assert field_operations(jc.ideal_scene(30.0)) == 234


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"elbow.friction": 0.1}, "`elbow.friction` must come with `elbow.clearance`"),
        ({"pivot.slip": "surface"}, "`pivot.slip` must come with `pivot.clearance`"),
        ({"elbow.clearance": -1e-4}, "`elbow.clearance` must be"),
        ({"elbow.clearance": 0.05}, "`elbow.clearance` must be smaller than the bore radius 0.04"),
        ({"pivot.clearance": 1e-4, "pivot.slip": "both"}, "`pivot.slip` must be one of"),
    ],
)
def test_bad_joints_are_refused_in_one_line(values, words):
    with pytest.raises(ValueError, match=words) as error:
        jc.build_scene(values)
    assert "\n" not in str(error.value)
