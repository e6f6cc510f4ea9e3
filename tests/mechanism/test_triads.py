"""Bodies that close only together: their places and slopes, and that a failed one is no number."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.basics.plane import Arm, Vector
from jaxcrusher.mechanism.linkage import Joint, Linkage, Point
from jaxcrusher.mechanism.motion import Crank, continued, followed, ideal_at_rest, moving
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.topology import Dyad, Triad
from jaxcrusher.mechanism.triads import Guess
from tests.differences import assert_slopes

TRIADS = ["stephenson", "chain"]


def apart(motion, joint):
    return (motion.position(joint.pin) - motion.position(joint.bore)).array()


def test_a_triad_is_where_there_is_no_dyad(linkages):
    first, second, last = linkages["chain"].groups
    assert isinstance(first, Triad) and isinstance(second, Triad) and isinstance(last, Dyad)
    assert first.middle == "plate" and {*first.bodies[1:]} == {"rod", "rocker", "upper"}
    hung = {leg.body: (leg.joint, leg.meeting) for leg in second.legs}
    assert hung == {
        "slider": ("guide", "wrist"),
        "prop": ("foot", "knee"),
        "link": ("hook", "edge"),
    }
    assert linkages["chain"].dyads == (last,) and linkages["six-bar"].triads == ()


@pytest.mark.parametrize("name", TRIADS)
@pytest.mark.parametrize("size", [0.0, 1e-3])
def test_joints_close_at_every_degree_wherever_their_pins_are(linkages, name, size):
    """By eccentricities ten times those of a wide bearing, in all joints at once."""
    linkage, random = linkages[name], np.random.default_rng(3)
    around = random.normal(size=(len(linkage.joints), 2))
    off = size * around / np.hypot(*around.T)[:, None]
    e = Named(dict(zip(linkage.joints.names, (Vector(*one) for one in off), strict=True)))

    @jax.jit
    @jax.vmap
    def seen(angle):
        motion = moving(linkage, Crank(angle, jnp.ones(())), e, Named())
        sizes = [motion.axis(body).dot(motion.axis(body)) for body in linkage.bodies.names]
        ends = [apart(motion, joint) for joint in linkage.joints.values]
        across = [apart(motion, s.ends) @ s.direction.perp().array() for s in linkage.slides.values]
        return jnp.stack(ends), jnp.stack(sizes), jnp.array(across)

    ends, sizes, across = map(np.asarray, seen(jnp.radians(jnp.arange(360.0))))
    # Rounding of places of a metre.
    np.testing.assert_allclose(ends, np.broadcast_to(off, ends.shape), rtol=0, atol=1e-15)
    np.testing.assert_allclose(sizes, 1.0, rtol=1e-15 * 4)
    np.testing.assert_allclose(across, 0.0, atol=1e-15)


def places(linkage, numbers):
    """Of the last bodies, by lengths, by eccentricities and by the angle of the crank."""
    arm, away, angle = numbers[0], Vector(numbers[1], numbers[2]), numbers[3]
    joint = linkage.joints.at("middle")
    longer = dataclasses.replace(joint, pin=Point("rocker", Arm(0.2 + arm)))
    joints = Named({**dict(linkage.joints.items()), "middle": longer})
    changed = dataclasses.replace(linkage, joints=joints)
    e = Named({"corner": away, "big end": away})
    motion = moving(changed, Crank(angle, jnp.ones(())), e, Named())
    last = linkage.bodies.names[-1]
    found = [motion.centre(last).x, motion.axis(last).y, motion.spin("upper"), motion.spin(last)]
    return jnp.stack(found)


@pytest.mark.slow  # 27 s of a slow processor
@pytest.mark.parametrize("name", TRIADS)
def test_slopes_and_second_slopes_are_those_of_differences(linkages, name):
    """By the implicit function theorem, though Newton's steps are differentiated.

    Forward as in reverse, and over many angles at once.
    """
    at = lambda numbers: places(linkages[name], numbers)  # noqa: E731
    point = jnp.array([1e-3, 2e-4, -1e-4, 2.0])
    beside = dict(order=4, rtol=0, by=lambda function: jax.jit(jax.jacfwd(function)))
    # Rounding of 1e-16 over steps of 1e-5, of sizes of up to a hundred; fourth order of 1e-20.
    first = assert_slopes(jax.jit(at), point, 1e-5, atol=1e-10 * 30, **beside)
    assert_slopes(jax.jit(jax.jacfwd(at)), point, 1e-5, atol=1e-8 * 30, **beside)
    np.testing.assert_allclose(jax.jit(jax.jacrev(at))(point), first, rtol=0, atol=1e-11)
    many = jax.jit(jax.vmap(at))(jnp.stack([point, 0 * point]))
    np.testing.assert_allclose(many[0], at(point), rtol=0, atol=1e-13)


def test_what_does_not_close_is_no_number(linkages):
    """Nor is any body that hangs on it; those before it have theirs."""
    linkage = linkages["chain"]
    joint = dataclasses.replace(linkage.joints.at("edge"), pin=Point("link", Arm(0.6)))
    broken = dataclasses.replace(
        linkage, joints=Named({**dict(linkage.joints.items()), "edge": joint})
    )
    for one in (broken, continued(broken)):
        motion = ideal_at_rest(one, 1.0)
        for body in linkage.bodies.names:
            known = body in ("crank", "plate", "rod", "rocker", "upper")
            for part in (
                motion.centre(body).x,
                motion.centre(body).y,
                motion.centre_velocity(body).x,
            ):
                assert np.isfinite(part) == known, body
    motion = ideal_at_rest(broken, 1.0)
    assert np.isnan(motion.spin("table")) and np.isnan(motion.axis("prop").x)


def test_a_course_leads_back_and_bears_changes_of_lengths(linkages):
    """It is a guess alone: what is found is that of a course of its own, or no number."""
    linkage = linkages["stephenson"]
    spots, levers = followed(linkage)
    plate = spots.at("plate")
    for part in jax.tree.leaves(plate):
        assert float(part[0]) == pytest.approx(float(part[-1]), abs=1e-14)
    assert (np.asarray(levers) > 0.25).all()
    for arm, good in ((0.205, True), (0.1, False)):
        joint = dataclasses.replace(linkage.joints.at("middle"), pin=Point("rocker", Arm(arm)))
        joints = Named({**dict(linkage.joints.items()), "middle": joint})
        kept = dataclasses.replace(linkage, joints=joints)
        seen = [ideal_at_rest(one, 2.0).centre("upper").array() for one in (kept, continued(kept))]
        assert bool(np.isfinite(seen).all()) == good
        if good:
            np.testing.assert_allclose(*seen, rtol=0, atol=1e-15)


def test_a_triad_is_guessed_at(linkages):
    one = linkages["stephenson"]
    parts = one.bodies, one.joints, "crank", "base", ()
    with pytest.raises(ValueError, match=r"`guesses` must tell .* but is without plate"):
        Linkage(*parts)
    extra = Named({**dict(one.guesses.items()), "rod": Guess(Vector(0.0, 0.0), 0.0)})
    with pytest.raises(ValueError, match=r"`guesses` must tell .* but is of rod"):
        Linkage(*parts, guesses=extra)
    ends = {name: one.joints.at(name) for name in ("small end", "middle", "corner")}
    ends = {
        name: Joint(*(Point(p.body) if p.body == "plate" else p for p in (joint.bore, joint.pin)))
        for name, joint in ends.items()
    }
    pinned = Named({**dict(one.joints.items()), **ends})
    with pytest.raises(ValueError, match=r"`bodies\.plate` must have joints that are apart"):
        dataclasses.replace(one, joints=pinned)
    with pytest.raises(ValueError, match="must be continued round a turn, for the course of plate"):
        ideal_at_rest(Linkage(*parts, guesses=one.guesses), 0.0)


def test_a_rough_guess_is_enough(linkages):
    """Steps that are not limited lead from both to no place, or another one."""
    one = linkages["stephenson"]
    for x, angle in ((0.1, 0.9), (0.2, -0.4)):
        guesses = Named({"plate": Guess(Vector(x, 0.05), angle)})
        other = continued(dataclasses.replace(one, guesses=guesses))
        for part, known in zip(*map(jax.tree.leaves, (other.courses, one.courses)), strict=True):
            np.testing.assert_allclose(part, known, rtol=0, atol=1e-14)
