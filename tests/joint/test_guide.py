"""A guide with a gap: the cases of its corners, energy, friction, and where a slider rests."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.basics.plane import Vector
from jaxcrusher.joint.bristles import LuGre
from jaxcrusher.joint.clearance import Memory, touches_of
from jaxcrusher.joint.friction import AmbrosioFriction, SurfaceSlip
from jaxcrusher.joint.guide import Guide
from jaxcrusher.joint.normal import (
    ConstantImpactVelocity,
    LankaraniNikravesh,
    TrackedImpactVelocity,
    sphere_stiffness,
)

LENGTH, HEIGHT = 0.03, 0.02  # half of either, m
HALVES = Vector(LENGTH, HEIGHT)
CLEARANCE, DEPTH = 1e-4, 1e-6  # m
AHEAD = Vector(0.6, 0.8)
LAW = LankaraniNikravesh(sphere_stiffness(1e-3), 0.7, ConstantImpactVelocity(0.1), width=1e-9)
RUBBING = AmbrosioFriction(SurfaceSlip(), 0.2, 0.0, 0.01)
STILL = Vector(0.0, 0.0)


def guide(normal=LAW, friction=None):
    return Guide(clearance=CLEARANCE, corner_radius=1e-3, normal=normal, friction=friction)


def seen(play, rate=STILL, speed=0.0, one=None, memory=None):
    one = guide() if one is None else one
    return one.contact(AHEAD, HALVES, play, rate, jnp.asarray(speed), memory)


def touching(contact):
    return sum(float(corner.penetration) > 0 for corner in contact.corners)


# The tilt that puts the end of a straight middle in by a depth lifts the corners a little again.
FLAT = CLEARANCE + DEPTH
TILTED = LENGTH * float(np.arcsin(FLAT / LENGTH))
CASES = {
    "none": (Vector(0.3 * CLEARANCE, 0.4 * CLEARANCE), 0, 0.0, 0.0),
    "one corner": (Vector(FLAT / 2, FLAT / 2), 1, 1.0, 1.0),
    "two on one side": (Vector(FLAT, 0.0), 2, 2.0, 0.0),
    "two across": (Vector(0.0, TILTED), 2, 0.0, 2.0),
}


@pytest.mark.parametrize("case", CASES)
def test_the_four_cases_of_flores(case):
    """A force to the left of so many corners' forces, and a moment of so many over half a length.

    A tilt p of 0.0034 takes h p^2 / 2 = 1.1e-7 m off the depth: 0.167 of a force.
    """
    play, count, sideways, turning = CASES[case]
    contact, force = seen(play), float(LAW.elastic_force(jnp.asarray(DEPTH)))
    assert touching(contact) == count
    assert float(AHEAD.cross(contact.force)) == pytest.approx(sideways * force, rel=0.17, abs=1e-9)
    # Nothing rubs, and so no force is along the slide.
    assert abs(float(AHEAD.dot(contact.force))) <= 1e-12 * force
    moment = float(contact.bearing_moment)
    assert moment == pytest.approx(turning * force * LENGTH, rel=0.17, abs=1e-9)
    assert float(contact.journal_moment) == -moment


@pytest.mark.parametrize("seed", range(4))
def test_forces_are_slopes_of_the_energy(seed):
    """The force to the left, and the moment over half a length, at rest: exact to rounding."""
    x, y = np.random.default_rng(seed).normal(size=2) * 1.5 * CLEARANCE
    play, one = Vector(x, y), guide()
    slope = jax.grad(lambda at: one.elastic_energy(seen(at)))(play)
    contact = seen(play)
    found = AHEAD.cross(contact.force), contact.bearing_moment / LENGTH
    size = 1e-12 * abs(float(contact.normal_force)) + 1e-30
    np.testing.assert_allclose(found, (slope.x, slope.y), rtol=1e-12, atol=size)


def test_power_is_what_damping_and_friction_take():
    """Of force and moment along any motion, less what is stored: an identity."""
    play, rate, speed = Vector(0.8 * FLAT, 0.5 * FLAT), Vector(0.02, -0.013), 0.7
    one = guide(friction=RUBBING)
    contact = seen(play, rate, speed, one)
    sideways, ahead = AHEAD.cross(contact.force), AHEAD.dot(contact.force)
    given = sideways * rate.x + ahead * speed + contact.bearing_moment * rate.y / LENGTH
    stored = jax.jvp(lambda at: one.elastic_energy(seen(at)), (play,), (rate,))[1]
    assert touching(contact) > 0 and float(contact.friction_loss) > 0
    lost = contact.normal_loss + contact.friction_loss
    assert float(given - stored) == pytest.approx(float(lost), rel=1e-12)


def test_friction_on_an_edge_turns_the_slider():
    """Flat on the left edge it drags the frame ahead there, at h to the left of the origin."""
    contact = seen(Vector(FLAT, 0.0), speed=1.0, one=guide(friction=RUBBING))
    ahead = float(AHEAD.dot(contact.force))
    assert ahead == pytest.approx(0.2 * float(contact.normal_force), rel=1e-12)
    # The corners lie at h + c + depth less the gap: at h from the origin.
    assert float(contact.bearing_moment) == pytest.approx(-HEIGHT * ahead, rel=1e-12)


@pytest.mark.parametrize("force", [(300.0, 0.0), (300.0, 120.0), (-50.0, 400.0), (0.0, 80.0)])
def test_a_slider_rests_where_it_carries_the_force(force):
    """To the bulge of a tilted slider, h p^2 / 2, of which depths of 1e-6 m feel a tenth."""
    one = guide()
    play = one.resting(Vector(*force), jnp.zeros(()))
    contact = seen(play)
    found = float(AHEAD.cross(contact.force)), float(contact.bearing_moment) / LENGTH
    np.testing.assert_allclose(found, force, rtol=0, atol=0.2 * np.hypot(*force))


def test_each_corner_remembers_for_itself():
    """Each its own impact velocity and bristle; none with laws that remember nothing."""
    assert guide().initial_memory() is None
    both = guide(LankaraniNikravesh(1e10, 0.7, TrackedImpactVelocity()), LuGre(SurfaceSlip()))
    memory = both.initial_memory()
    assert memory is not None and len(memory) == 4
    # The front end comes to the left edge, and all slide.
    contact = seen(STILL, Vector(0.1, 0.1), 0.3, both, memory)
    rate = both.memory_rate(contact, memory)
    rising = [float(one.impact) > 0 for one in rate]
    assert rising == [True, False, False, False]


def test_each_corner_holds_its_own_velocity():
    """Held at what they remember, corners push as those that remember it: the same operations."""
    tracking = guide(LankaraniNikravesh(sphere_stiffness(1e-3), 0.7, TrackedImpactVelocity()))
    remembered = 0.1, 0.2, 0.3, 0.4
    memory = tuple(Memory(jnp.asarray(one), None) for one in remembered)
    assert [one.impact for one in touches_of(memory)] == list(remembered)
    held = tracking.holding(jnp.asarray(remembered))
    assert held.initial_memory() is None
    # Each of the four touches in one of these, and approaches.
    for play in (Vector(FLAT, 0.0), Vector(-FLAT, 0.0)):
        moved = play, Vector(0.02, 0.01), 0.0
        expected, found = seen(*moved, tracking, memory), seen(*moved, held)
        assert touching(found) == 2
        for one, other in zip(expected.corners, found.corners, strict=True):
            assert float(one.normal_force) == float(other.normal_force)
    # One velocity is that of all corners.
    alike = tracking.holding(0.2)
    assert [float(one.impact_velocity.speed) for one in alike.normals] == [0.2] * 4


def test_the_corner_that_approaches_fastest_counts():
    """The front end touches the left edge and leaves it, and the rear end comes to that edge.

    The tilt of 0.0017 changes the rates by 2e-3 of them.
    """
    contact = seen(CASES["one corner"][0], Vector(0.1, -0.3))
    rates = [float(one.penetration_rate) for one in contact.corners]
    assert float(contact.penetration_rate) == pytest.approx(-0.2, rel=1e-2)
    assert float(contact.approach) == max(rates) == pytest.approx(0.4, rel=1e-2)
