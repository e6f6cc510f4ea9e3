"""Places and speeds of linkages, against trigonometry and differences; what is refused."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.basics.plane import Arm, Vector, arm_to, minus, plus
from jaxcrusher.mechanism.acting import Push, PushByAngle, Spring
from jaxcrusher.mechanism.linkage import Body, Joint, Linkage, Point, Slide
from jaxcrusher.mechanism.motion import Crank, ideal_at_rest, moving
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.starts import Given
from jaxcrusher.mechanism.topology import FRAME, forest


def apart(motion, joint):
    return motion.position(joint.pin) - motion.position(joint.bore)


EVERY = ["four-bar", "six-bar", "slider-crank", "press", "stephenson", "chain"]


@pytest.mark.parametrize("name", EVERY)
def test_every_joint_closes_and_every_body_keeps_its_size(linkages, name):
    linkage = linkages[name]
    e = {"big end": Vector(0.003, -0.001), "pivot": Vector(-0.002, 0.002)}
    e = Named({**e, "wrist": Vector(0.001, 0.002)})
    for angle in np.linspace(0, 2 * np.pi, 7):
        motion = moving(linkage, Crank(jnp.asarray(angle), jnp.asarray(3.0)), e, e)
        for joint, ends in linkage.joints.items():
            wanted = e[joint].array() if joint in e else np.zeros(2)
            np.testing.assert_allclose(apart(motion, ends).array(), wanted, atol=1e-15)
        for body in linkage.bodies.names:
            axis = motion.axis(body)
            assert float(axis.dot(axis)) == pytest.approx(1, abs=1e-14)
        for slide in linkage.slides.values:
            off = apart(motion, slide.ends).cross(slide.direction)
            assert float(off) == pytest.approx(0, abs=1e-15)
            assert motion.axis(slide.body).array().tolist() == [1, 0]


def test_a_point_of_the_frame_stands_where_the_numbers_given_put_it(linkages):
    """A number that is not given is zero."""
    motion = ideal_at_rest(linkages["four-bar"], 0.4)
    for arm, place in ((Arm(0.3), [0.3, 0.0]), (Arm(y=0.2), [0.0, 0.2]), (Arm(), [0.0, 0.0])):
        assert motion.position(Point(FRAME, arm)).array().tolist() == place


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


@pytest.mark.parametrize("name", EVERY)
def test_spins_and_velocities_are_the_derivatives_of_places(linkages, name):
    linkage = linkages[name]
    rates = {"small end": Vector(0.4, -0.3), "big end": Vector(-0.2, 0.1)}
    rates = Named({**rates, "wrist": Vector(0.3, 0.2)})

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
    spins = [motion.spin(body) for body in linkage.bodies.names]
    spins = np.array([0.0 if spin is None else spin for spin in spins])
    np.testing.assert_allclose(jax.jvp(angles, (zero,), (one,))[1], spins, rtol=1e-12)
    velocities = np.array([motion.centre_velocity(b).array() for b in linkage.bodies.names])
    moved = jax.jvp(centres, (zero,), (one,))[1]
    np.testing.assert_allclose(moved, velocities, rtol=1e-12, atol=1e-14)


def test_a_side_chooses_where_a_dyad_meets(linkages):
    other = dataclasses.replace(linkages["four-bar"], sides=(-1,))
    start, end = np.array([0.05, 0.0]), np.array([0.3, -0.05])
    for linkage, side in ((linkages["four-bar"], 1), (other, -1)):
        meeting = ideal_at_rest(linkage, 0.0).position(linkage.joints.at("small end").pin)
        to_end, to_meeting = end - start, np.asarray(meeting.array()) - start
        assert np.sign(to_end[0] * to_meeting[1] - to_end[1] * to_meeting[0]) == side


def test_a_side_chooses_where_a_link_meets_a_slider(linkages):
    """Ahead or behind of a perpendicular's foot, as the two roots of a quadratic equation."""
    one = linkages["slider-crank"]
    along, pin = np.array([3.0, 1.0]) / np.sqrt(10), np.array([0.01, -0.015])
    from_crank = np.array([0.02, -0.01]) + pin - np.array([0.05, 0.0])
    ways = np.sort(np.roots([1, 2 * along @ from_crank, from_crank @ from_crank - 0.12**2]))
    for side, way in ((-1, ways[0]), (1, ways[1])):
        motion = ideal_at_rest(dataclasses.replace(one, sides=(side,)), 0.0)
        place = np.asarray(motion.position(Point("slider")).array())
        np.testing.assert_allclose(place, np.array([0.02, -0.01]) + way * along, atol=1e-16)


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
PINNED = {"one": BARS["one"], "pin": Joint(Point("bar", Arm(2.0)), Point("lid"))}
SLID = {**BARS, **PINNED}


@pytest.mark.parametrize(
    ("bodies", "joints", "slides", "sides", "words"),
    [
        ("crank bar", BARS, {}, (), "`bodies` must form dyads"),
        ("crank", BARS, {}, (), "`two` must join bodies that there are: crank, frame"),
        ("crank", {"one": BARS["one"]}, {}, (1,), "`sides` must hold one of each dyad"),
        ("crank bar", BARS, {"guide": "lid"}, (), "`guide` must join bodies that there are"),
        # Nothing turns it; two sliders that are pinned cannot move; a crank that slides neither.
        ("crank lid", {"one": BARS["one"]}, {"guide": "lid"}, (), "form dyads.* but is lid"),
        ("crank bar", BARS, {"guide": "bar"}, (), "`bodies` must form dyads"),
        ("crank lid bar", PINNED, {"left": "lid", "right": "bar"}, (), "but is lid, bar"),
        ("crank", {"one": BARS["one"]}, {"guide": "crank"}, (), "of each dyad, but is also guide"),
        ("crank lid bar", SLID, {"two": "lid"}, (1,), "have names that no joint has, but is two"),
        ("crank lid bar", SLID, {"guide": "lid", "more": "lid"}, (1,), "but is also more"),
    ],
)
def test_what_is_no_linkage_is_refused_in_one_line(bodies, joints, slides, sides, words):
    bodies = Named({body: BODY for body in bodies.split()})
    slides = Named({name: Slide(body, Vector(1.0, 0.0)) for name, body in slides.items()})
    with pytest.raises(ValueError, match=words) as error:
        Linkage(bodies, Named(joints), "crank", "one", sides, slides=slides)
    assert "\n" not in str(error.value)


def test_a_slide_has_a_direction():
    with pytest.raises(ValueError, match="`along` must be a direction, but is zero"):
        Slide("slider", Vector(0.0, 0.0))


@pytest.mark.parametrize(
    ("bodies", "joints", "bearing", "words"),
    [
        ({"rocker": Body(-4.0, 0.1)}, {}, "base", "`bodies.rocker.mass` must be finite and > 0 kg"),
        ({"rocker": Body(4.0, np.nan)}, {}, "base", "`bodies.rocker.inertia` must be finite"),
        ({FRAME: BODY}, {}, "base", "`bodies` must have other names than 'frame'"),
        # A zero that is there, and not only an arm that is not.
        (
            {},
            {"big end": Joint(Point("coupler"), Point("crank", Arm(0.0)))},
            "base",
            "`bodies.crank` must have its joints big end and base apart",
        ),
        ({}, {"base": None}, "big end", "`bearing` must join crank and frame, but is big end"),
    ],
)
def test_what_cannot_move_as_a_linkage_is_refused(linkages, bodies, joints, bearing, words):
    """A negative mass would give numbers, a body named as the frame would move the frame."""
    one = linkages["four-bar"]
    bodies, joints = {**dict(one.bodies.items()), **bodies}, {**dict(one.joints.items()), **joints}
    with pytest.raises(ValueError, match=words):
        Linkage(Named(bodies), Named(joints), "crank", bearing, (1,))


@pytest.mark.parametrize(
    ("forces", "words"),
    [
        ({"pushes": (Push(Point(FRAME), Vector(1e3, 0.0)),)}, "`pushes` must be at .* at frame"),
        ({"pushes": (Push(Point("jaw"), Vector(1e3, 0.0)),)}, "`pushes` must be at .* at jaw"),
        ({"springs": (Spring((Point(FRAME), Point("jaw")), 1e3, 0.1),)}, "`springs` .* at jaw"),
    ],
)
def test_a_force_at_no_body_is_refused(machine, forces, words):
    """A push of a frame on supports would turn it, though it is its own reaction."""
    with pytest.raises(ValueError, match=words):
        dataclasses.replace(machine("four-bar"), **forces)


def test_a_force_by_angle_is_any_function_and_one_of_two_turns_has_no_steady_state(machine):
    """The gas force of a four-stroke engine; it passed for one that repeats with each turn."""
    plain = machine("slider-crank")
    pull = plain.pushes[0]
    for order in (1.0, 0.5):
        size = lambda angle, order=order: 300 * (1 + jnp.cos(order * angle))  # noqa: E731
        push = PushByAngle(pull.at, Vector(3.0, 4.0), size)
        scene = dataclasses.replace(plain, pushes=(push,))
        motion = ideal_at_rest(scene.linkage, 2.0)
        given = jax.jit(lambda scene, motion: scene.pushes[0].action(motion)[1].array())(
            scene, motion
        )
        np.testing.assert_allclose(given, float(size(2.0)) * np.array([0.6, 0.8]), rtol=1e-14)
        if order == 1:
            assert scene.steady() is scene
            continue
        with pytest.raises(ValueError, match="`size` must repeat with each turn of the crank"):
            scene.steady()


@pytest.mark.parametrize("at", [({"pivt": Vector(1.0, 0.0)},), ({}, {"base": Vector(0.1, 0.0)})])
def test_a_start_of_a_joint_without_clearance_is_refused(machine, at):
    """A name that is misspelt would start the pin in the middle."""
    scene = dataclasses.replace(machine("four-bar", ("pivot",)), start=Given(*at))
    with pytest.raises(ValueError, match="`start` must name joints with clearance: pivot, but is"):
        scene.formulation.initial(scene)
