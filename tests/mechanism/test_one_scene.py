"""What one scene gives every mechanism: rollers at any joint, rough feed, pushes that wander."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.plane import Arm, Vector
from jaxcrusher.joint.rollers import RollerBearing, Rollers
from jaxcrusher.mechanism import observables as general
from jaxcrusher.mechanism.acting import AbstractPush, RoughFeed, push_power, rough_feed
from jaxcrusher.mechanism.drives import ConstantSpeed
from jaxcrusher.mechanism.linkage import Point
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.observables import bearing_stiffness
from jaxcrusher.mechanism.scene import later, require_steady
from jaxcrusher.mechanism.starts import Centred
from jaxcrusher.motion.turns import run_turns
from jaxcrusher.sheets.bearing_sheet import bearing_sheet, bearings_of, outputs_of
from tests.differences import differences
from tests.instants import at_state

STATIC, DYNAMIC, SPEED = 2e4, 1.5e4, 900.0


def rollers():
    """Two small roller bearings side by side, of 12 rollers each."""
    law = Rollers(clearance=2e-5, count=24, length=6e-3, damping=2e3)
    return RollerBearing(
        0.02,
        2e-5,
        law,
        bearings=2.0,
        roller_diameter=6e-3,
        pitch_diameter=3e-2,
        bore=2e-2,
        rolling_friction=1e-3,
        static_rating=STATIC,
        dynamic_rating=DYNAMIC,
        norm_width=1e-9,
    )


@pytest.fixture(scope="module")
def rolling(machine):
    """A slider-crank whose rod ends in rollers at both of its ends; a second point of the rod."""
    return dataclasses.replace(
        machine("slider-crank", drive=ConstantSpeed(SPEED)),
        joints=Named({"wrist": rollers(), "big end": rollers()}),
        start=Centred(),
        points=Named({"tip": Point("rod", Arm(0.12))}),
    )


def test_life_of_rollers_at_a_joint_of_a_linkage_is_that_of_iso_281(rolling):
    """Loads and turns from reactions and places: of the crank's joint by its turns, of the other
    by how far the rod swings on the slider."""
    names = ("wrist_bearing_life", "big end_bearing_life", "wrist_static_load_ratio")
    found = jc.statistics(rolling, 0, 1, outputs=names)
    period, count = 2 * np.pi / SPEED, 2**13
    times = period * np.arange(count + 1) / count
    seen = ("wrist_reaction", "big end_reaction", "tip_position", "rod_position")
    motion = jc.simulate(rolling, times, outputs=seen, rtol=1e-9)
    seen = {name: np.asarray(motion[name]) for name in seen}
    along = seen["tip_position"] - seen["rod_position"]
    swing = np.gradient(np.unwrap(np.arctan2(along[:, 1], along[:, 0])), times)
    for joint, speed in (("wrist", np.abs(swing)), ("big end", np.full(count + 1, SPEED))):
        share = np.linalg.norm(seen[f"{joint}_reaction"], axis=1) / (2 * DYNAMIC)
        used = speed / (2 * np.pi) * 3600 / 1e6 * share ** (10 / 3)
        # The sum over 8192 instants of forces that ring some hundred times a turn.
        hours = 1 / np.mean((used[1:] + used[:-1]) / 2)
        assert float(found[f"{joint}_bearing_life"]) == pytest.approx(hours, rel=1e-3), joint
    most = np.linalg.norm(seen["wrist_reaction"], axis=1).max() / (2 * STATIC)
    assert float(found["wrist_static_load_ratio"]) == pytest.approx(most, rel=1e-3)


def test_a_joint_of_a_linkage_has_what_its_bearing_has(rolling, machine):
    assert {"wrist_rollers", "big end_rollers"} == set(rolling.limits)
    usual = rolling.usual_statistics
    assert {"wrist_roller_pressure", "big end_bearing_life"} < set(usual)
    plain = machine("slider-crank", ("wrist",))
    assert "wrist_bearing_stiffness" in plain.statistics
    assert "wrist_roller_pressure" not in plain.statistics
    with pytest.raises(ValueError, match="wrist_roller_pressure only of a scene with rollers"):
        jc.statistics(plain, 0, 1, outputs=("wrist_roller_pressure",))
    yields = differences(plain.joints.at("wrist").normal.penetration_under, 1e3, 1.0)
    # Of a central difference of 1e-3.
    assert float(bearing_stiffness(plain, 1e3)) == pytest.approx(1 / yields, rel=1e-6)
    with pytest.raises(ValueError, match="`joint` must name a joint with clearance: wrist, big en"):
        bearing_stiffness(rolling, 1e3)
    assert float(bearing_stiffness(rolling, 1e3, "big end")) > 0


def test_the_sheet_looks_at_the_only_loose_joint_or_the_one_named(rolling, machine):
    plain = machine("slider-crank", ("wrist",))
    assert bearings_of(plain) == ("wrist", "base")
    assert bearings_of(rolling, "big end") == ("big end", "base", "wrist")
    with pytest.raises(ValueError, match="`joint` must name a joint with clearance: wrist, big en"):
        bearings_of(rolling)
    run = run_turns(rolling, outputs_of(rolling, "wrist"), settle=0, turns=5, rtol=1e-6)
    found = bearing_sheet(run, "wrist")
    names = ("wrist_bearing_life", "big end_bearing_life", "wrist_roller_pressure")
    exact = jc.statistics(rolling, 0, 5, outputs=names, rtol=1e-6)
    for joint in ("wrist", "big end"):
        # The sheet takes life from the mean of its turns, whose steps are of 1e-6.
        life = float(exact[f"{joint}_bearing_life"])
        assert found[joint]["life"][0] == pytest.approx(life, rel=1e-3), joint
    pressure = float(exact["wrist_roller_pressure"])
    # Peaks by parabolas through steps of 1e-7 are 1e-4 off.
    assert found["wrist"]["pressure"][0] == pytest.approx(pressure, rel=3e-4)


def test_a_joint_that_is_called_main_has_its_prefix_as_all_others(machine):
    """Only a crusher's template has a joint without one."""
    plain = machine("four-bar", ("pivot",))
    joints = {
        "main" if name == "pivot" else name: one for name, one in plain.linkage.joints.items()
    }
    linkage = dataclasses.replace(plain.linkage, joints=Named(joints))
    bearings = Named({"main": plain.joints.at("pivot")})
    scene = dataclasses.replace(plain, linkage=linkage, joints=bearings)
    assert {"main_winding", "main_force_peak"} < set(scene.statistics)
    assert "winding" not in scene.statistics and "main_eccentricity" in scene.observables
    assert jc.build_scene({}).prefix("main") == ""


def test_any_push_may_be_that_of_a_rough_feed(machine):
    """Its wave multiplies the force, whose mean has a steady state, and goes on in a later run."""
    plain = machine("slider-crank", ("wrist",))
    feed = rough_feed(plain.pushes[0], 0.3, 4.0, 7)
    rough = dataclasses.replace(plain, pushes=(feed,), start=Centred())
    angles = jnp.linspace(0.0, 12.0, 7)

    def force(scene, angle):
        state = scene.formulation.initial(scene)
        s = scene.formulation.snapshot(angle / scene.drive.speed, state, scene)
        return s.applied.pushes[0][1].array()

    wave = np.array([float(feed.wave(angle)) for angle in angles])
    given = np.array([force(rough, jnp.asarray(angle)) for angle in angles])
    expected = (1 + 0.3 * wave)[:, None] * np.array([-700.0, 200.0])
    # Rounding of angles of some 50 rad.
    np.testing.assert_allclose(given, expected, rtol=1e-12)
    assert np.ptp(wave) > 1
    (moved,) = later(rough, 4 * np.pi).pushes
    assert isinstance(moved, RoughFeed)
    shifted = [float(moved.wave(angle)) for angle in angles]
    np.testing.assert_allclose(shifted, [float(feed.wave(a + 4 * np.pi)) for a in angles])
    assert later(plain, 4 * np.pi) is plain and plain.steady() is plain
    assert rough.steady().pushes == plain.pushes
    with pytest.raises(ValueError, match="have a load that repeats each turn"):
        require_steady(rough)


class Wandering(AbstractPush):
    """A force whose place on the rocker follows the crank's angle."""

    size: jax.Array  # N

    @property
    def body(self):
        return "rocker"

    def action(self, motion):
        along = 0.1 + 0.05 * motion.axis("crank").y
        return Point("rocker", Arm(along, 0.02)), Vector(self.size, -0.4 * self.size)


def test_a_push_may_wander_over_its_body(machine):
    """Its moment is that about the place where it is, and the drive pays for its power."""
    plain = machine("four-bar")
    scene = dataclasses.replace(plain, pushes=(Wandering(jnp.asarray(900.0)),))

    def snapshot(time):
        return scene.formulation.snapshot(time, scene.formulation.initial(scene), scene)

    for time in (0.01, 0.13, 0.22):
        s = snapshot(jnp.asarray(time))

        def energy(time, s=s):
            at = at_state(s, time, scene.formulation.initial(scene), scene)
            return general.kinetic_energy(at, scene) + general.potential_energy(at, scene)

        change = jax.grad(energy)(time)
        powers = general.drive_power(s, scene), push_power(s, scene)
        size = sum(map(abs, powers))
        # Rounding of sums of powers.
        assert abs(float(change - sum(powers))) < 1e-11 * float(size)
        assert abs(float(powers[1])) > 1
        ((point, force),), (wrench,) = s.applied.pushes, s.applied.wrenches
        arm = s.motion.position(point) - s.motion.centre("rocker")
        np.testing.assert_allclose(wrench.moment, arm.cross(force), rtol=1e-12)
        sine = np.sin(scene.drive.speed * time)
        assert float(point.arm.x) == pytest.approx(0.1 + 0.05 * sine, rel=1e-12)
