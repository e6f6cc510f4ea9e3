"""Places and speeds of linkages, against trigonometry and differences; what is refused."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.basics.plane import Vector
from jaxcrusher.mechanism.arms import Arm, arm_to, minus, plus
from jaxcrusher.mechanism.linkage import Body, Joint, Linkage, Point
from jaxcrusher.mechanism.motion import Crank, ideal_at_rest, moving
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.topology import FRAME, forest


def apart(motion, joint):
    return motion.position(joint.pin) - motion.position(joint.bore)


@pytest.mark.parametrize("name", ["four-bar", "six-bar"])
def test_every_joint_closes_and_every_body_keeps_its_size(linkages, name):
    linkage = linkages[name]
    e = Named({"big end": Vector(0.003, -0.001), "pivot": Vector(-0.002, 0.002)})
    for angle in np.linspace(0, 2 * np.pi, 7):
        motion = moving(linkage, Crank(jnp.asarray(angle), jnp.asarray(3.0)), e, e)
        for joint, ends in linkage.joints.items():
            wanted = e[joint].array() if joint in e else np.zeros(2)
            np.testing.assert_allclose(apart(motion, ends).array(), wanted, atol=1e-15)
        for body in linkage.bodies.names:
            axis = motion.axis(body)
            assert float(axis.dot(axis)) == pytest.approx(1, abs=1e-14)


def test_a_four_bar_is_where_freudenstein_s_equation_has_it(linkages):
    """K1 cos(out) - K2 cos(in) + K3 = cos(in - out), of angles against the line of the frame."""
    linkage = linkages["four-bar"]
    frame, crank = np.array([0.3, -0.05]), 0.05
    coupler, rocker = np.hypot(0.3, 0.06), np.hypot(0.2, 0.03)
    base, tilt = np.hypot(*frame), np.arctan2(frame[1], frame[0])
    bent = np.arctan2(0.03, 0.2)
    for angle in np.linspace(0.3, 6.0, 5):
        axis = ideal_at_rest(linkage, angle).axis("rocker")
        out = np.arctan2(float(axis.y), float(axis.x)) + bent - tilt
        put = angle - tilt
        constant = (crank**2 - coupler**2 + rocker**2 + base**2) / (2 * crank * rocker)
        left = base / crank * np.cos(out) - base / rocker * np.cos(put) + constant
        assert left == pytest.approx(np.cos(put - out), abs=1e-12)


@pytest.mark.parametrize("name", ["four-bar", "six-bar"])
def test_spins_and_velocities_are_the_derivatives_of_places(linkages, name):
    linkage = linkages[name]
    rates = Named({"small end": Vector(0.4, -0.3), "big end": Vector(-0.2, 0.1)})

    def at(time):
        e = rates.map(lambda rate: rate * time)
        return moving(linkage, Crank(0.7 + 5.0 * time, jnp.asarray(5.0)), e, rates)

    def angles(time):
        axes = [at(time).axis(body) for body in linkage.bodies.names]
        return jnp.stack([jnp.arctan2(axis.y, axis.x) for axis in axes])

    def centres(time):
        return jnp.stack([at(time).centre(body).array() for body in linkage.bodies.names])

    zero, one = jnp.zeros(()), jnp.ones(())
    motion = at(zero)
    spins = np.array([motion.spin(body) for body in linkage.bodies.names])
    np.testing.assert_allclose(jax.jvp(angles, (zero,), (one,))[1], spins, rtol=1e-12)
    velocities = np.array([motion.centre_velocity(b).array() for b in linkage.bodies.names])
    moved = jax.jvp(centres, (zero,), (one,))[1]
    np.testing.assert_allclose(moved, velocities, rtol=1e-12, atol=1e-14)


def test_a_side_chooses_where_a_dyad_meets(linkages):
    other = dataclasses.replace(linkages["four-bar"], sides=(-1,))
    start, end = np.array([0.05, 0.0]), np.array([0.3, -0.05])
    for linkage, side in ((linkages["four-bar"], 1), (other, -1)):
        meeting = ideal_at_rest(linkage, 0.0).position(linkage.joint("small end").pin)
        to_end, to_meeting = end - start, np.asarray(meeting.array()) - start
        assert np.sign(to_end[0] * to_meeting[1] - to_end[1] * to_meeting[0]) == side


def test_trees_are_what_is_left_where_loose_joints_are_cut(linkages):
    linkage = linkages["six-bar"]

    def trees(*loose):
        found, closing = forest(linkage.ends, linkage.bodies.names, loose)
        return {one.base: set(one.bodies[1:]) for one in found}, set(closing)

    every = set(linkage.bodies.names)
    assert trees() == ({FRAME: every}, {"small end", "middle"})
    # A loop that one loose joint opens has no closing joint, and no tree floats.
    assert trees("pivot", "foot") == ({FRAME: every}, set())
    found, closing = trees("big end", "small end", "pivot", "upper")
    assert found == {FRAME: {"crank", "lever", "link"}, "coupler": set(), "rocker": set()}
    assert closing == set()
    found, closing = trees(*linkage.joints.names)
    assert found == {FRAME: set(), **{body: set() for body in every}}


def test_an_arm_that_is_not_there_is_zero_and_costs_nothing():
    axis = Vector(0.6, 0.8)
    for arm, expected in (
        (Arm(2.0, 1.0), (0.4, 2.2)),
        (Arm(2.0), (1.2, 1.6)),
        (Arm(None, 1.0), (-0.8, 0.6)),
    ):
        np.testing.assert_allclose(arm.along(axis).array(), expected, rtol=1e-15)
    assert Arm().along(axis) is None and plus(None, None) is None
    assert (Arm(1.0) - Arm(3.0, 2.0)).y == -2.0 and (Arm() - Arm(1.0)).x == -1.0
    assert minus(axis, None) is axis and minus(None, axis).x == -0.6
    assert arm_to(Vector(1.0, 2.0)).vector().y == 2.0


def test_something_of_each_keeps_its_order_and_leaves_out_none():
    some = Named({"b": 1, "a": 2, "c": None})
    assert some.names == ("b", "a") and some["c"] is None and "c" not in some
    assert dict(some.map(lambda one, other: (one, other), Named({"a": 5})).items()) == {
        "b": (1, None),
        "a": (2, 5),
    }
    assert len(Named()) == 0 and Named().values == ()


BODY = Body(1.0, 1.0)
BARS = {
    "one": Joint(Point(FRAME), Point("crank")),
    "two": Joint(Point("crank", Arm(1.0)), Point("bar")),
}


@pytest.mark.parametrize(
    ("bodies", "joints", "sides", "words"),
    [
        ({"crank": BODY, "bar": BODY}, BARS, (), "`bodies` must form dyads"),
        ({"crank": BODY}, BARS, (), "`two` must join bodies that there are: crank, frame"),
        ({"crank": BODY}, {"one": BARS["one"]}, (1,), "`sides` must hold one of each dyad"),
    ],
)
def test_what_is_no_linkage_is_refused_in_one_line(bodies, joints, sides, words):
    with pytest.raises(ValueError, match=words) as error:
        Linkage(Named(bodies), Named(joints), "crank", "one", sides)
    assert "\n" not in str(error.value)
