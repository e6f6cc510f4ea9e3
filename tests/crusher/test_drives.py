"""Drives: an uneven speed, a torque that follows the motion, and what is refused."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.mechanism import observables as general
from jaxcrusher.mechanism.drives import AbstractMotion, AbstractTorque, UnevenSpeed
from jaxcrusher.mechanism.multiplier import MultiplierFormulation
from tests.crusher.kinds import check_laws
from tests.differences import assert_slopes
from tests.pairs import crossed, slow

UNEVEN = UnevenSpeed(30.0, 0.1, 2, 0.4)
KINDS = {
    "A": {"slip": "surface"},
    "ideal": {"joint": "ideal"},
    "all": {"slip": "surface", "elbow.clearance": 1e-4, "pivot.clearance": 8e-5},
    "on supports": {"slip": "surface", "foundation.mass": 6000.0},
}


def driven(kind, drive, formulation="eccentricity"):
    scene = eqx.tree_at(lambda s: s.drive, jc.build_scene(KINDS[kind]), drive)
    if formulation == "multiplier":
        scene = eqx.tree_at(lambda s: s.formulation, scene, MultiplierFormulation())
    return scene


def test_an_uneven_speed_is_that_of_its_formula():
    for time in (0.0, 0.03, 0.11):
        angle, speed, acceleration = map(float, UNEVEN.motion(jnp.asarray(time)))
        place = 2 * 30.0 * time + 0.4
        assert angle == pytest.approx(30.0 * time + 0.05 * (np.sin(place) - np.sin(0.4)), rel=1e-14)
        assert speed == pytest.approx(30.0 * (1 + 0.1 * np.cos(place)), rel=1e-14)
        assert acceleration == pytest.approx(-2 * 0.1 * 900.0 * np.sin(place), rel=1e-13)


@pytest.mark.parametrize(("order", "known"), [(2.0, True), (1.5, False)])
def test_a_traced_order_that_is_not_whole_has_no_motion(order, known):
    """The crank's speed would jump at every turn."""
    moved = jax.jit(lambda order: UnevenSpeed(30.0, 0.1, order).motion(jnp.asarray(0.1)))(order)
    assert np.isfinite(moved).all() == known


@pytest.mark.parametrize(
    ("kind", "formulation"), crossed(KINDS, ("eccentricity", "multiplier"), later=["all"])
)
def test_power_of_an_uneven_speed(kind, formulation):
    """The torque that turns the shaft unevenly does what the energies need."""
    if kind == "ideal" and formulation == "multiplier":
        pytest.skip("An ideal scene is not written by multipliers.")
    check_laws(driven(kind, UNEVEN, formulation))


class Late(UnevenSpeed):
    """Its acceleration is left out, as a constant speed's is."""

    def __check_init__(self):
        pass

    def motion(self, time):
        return *super().motion(time)[:2], None


def test_power_shows_an_acceleration_that_is_left_out():
    late = object.__new__(Late)
    for name in ("speed", "fluctuation", "order", "phase"):
        object.__setattr__(late, name, getattr(UNEVEN, name))
    with pytest.raises(AssertionError):
        check_laws(driven("ideal", late))


@pytest.mark.slow
def test_an_uneven_speed_has_an_orbit_with_slopes():
    """Its slope by the fluctuation is that of differences; at none it is the even speed's orbit."""

    def rms(share):
        return jc.periodic_orbit(driven("ideal", UnevenSpeed(30.0, share))).foundation_rms

    # Truncation of the differences, and orbits to 1e-9 of their RMS over a step of 1e-4.
    assert abs(assert_slopes(rms, 0.02, 1e-4, rtol=1e-4)) > 100
    even = jc.periodic_orbit(jc.build_scene(KINDS["ideal"])).foundation_rms
    assert float(rms(jnp.asarray(0.0))) == pytest.approx(float(even), rel=1e-9)


class Motor(AbstractTorque):
    """A torque that falls with the speed."""

    speed: jax.Array = eqx.field(converter=jnp.asarray)
    stall: jax.Array = eqx.field(converter=jnp.asarray)

    def torque(self, time, crank):
        return self.stall * (1 - crank.speed / (1.1 * self.speed))


@pytest.mark.parametrize("kind", ["all", *slow("ideal", "A")])
def test_a_motor_of_one_s_own_turns_a_free_shaft(kind):
    scene = driven(kind, Motor(30.0, 2000.0))
    check_laws(scene)
    s = scene.formulation.snapshot(jnp.array(0.0), scene.formulation.initial(scene), scene)
    assert float(general.drive_torque(s, scene)) == pytest.approx(2000.0 * (1 - 1 / 1.1), rel=1e-14)


class Own(AbstractMotion):
    speed: jax.Array = eqx.field(converter=jnp.asarray)
    share: jax.Array = eqx.field(converter=jnp.asarray)


class Even(Own):
    def motion(self, time):
        return self.speed * time, self.speed, None


class NoAcceleration(Own):
    def motion(self, time):
        angle, share = self.speed * time, self.share
        return angle + share * jnp.sin(angle), self.speed * (1 + share * jnp.cos(angle)), None


class WrongSpeed(Own):
    def motion(self, time):
        return self.speed * time, self.speed * (1 + self.share), None


class Faster(Own):
    def motion(self, time):
        speed = self.speed * (1 + self.share)
        return speed * time, speed, None


@pytest.mark.parametrize(
    ("make", "must"),
    [
        (NoAcceleration, "return as acceleration the time derivative"),
        (WrongSpeed, "return as speed the time derivative"),
        (Faster, "turn the crank once in 2 pi / speed"),
        (lambda *numbers: jax.jit(NoAcceleration)(*numbers), "return as acceleration"),
        (lambda speed, _: jax.grad(lambda s: NoAcceleration(speed, s).share)(0.0), "return as"),
        (lambda speed, _: UnevenSpeed(speed, 1.0), "be less than 1 in size"),
        (lambda speed, _: UnevenSpeed(speed, 0.1, 0), "be a whole number"),
    ],
)
def test_a_motion_that_contradicts_itself_is_refused(make, must):
    with pytest.raises(ValueError, match=f"^Argument `[a-z_]+` must {must}") as error:
        make(30.0, 0.1)
    assert "\n" not in str(error.value)


def test_a_constant_speed_of_one_s_own_is_integrated():
    assert jax.jit(lambda speed: Even(speed, speed).speed)(30.0) == 30.0
    scene = jc.ideal_scene(30.0)
    own = dataclasses.replace(scene, drive=Even(30.0, 0.1))
    found = [jc.statistics(one, 0, 1, outputs=("foundation_rms",)) for one in (scene, own)]
    assert found[0].foundation_rms == found[1].foundation_rms
