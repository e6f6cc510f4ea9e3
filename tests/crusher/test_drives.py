"""Drives of one's own: those that would be integrated as another one are refused."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest

import jaxcrusher as jc
from jaxcrusher.mechanism.drives import AbstractDrive, GivenTorque


class Prescribed(AbstractDrive):
    speed: jax.Array = eqx.field(converter=jnp.asarray)
    share: jax.Array = eqx.field(converter=jnp.asarray)

    def initial(self):
        return None

    def acceleration(self, moment, inertia):
        return None

    def rate(self, speed, acceleration):
        return None


class Even(Prescribed):
    def motion(self, time, state):
        return self.speed * time, self.speed


class Uneven(Prescribed):
    def motion(self, time, state):
        angle, share = self.speed * time, self.share
        return angle + share * jnp.sin(angle), self.speed * (1 + share * jnp.cos(angle))


class Ahead(Prescribed):
    def motion(self, time, state):
        return self.speed * time + self.share, self.speed


class Accelerated(Even):
    def acceleration(self, moment, inertia):
        return jnp.zeros_like(moment)


class Flywheel(GivenTorque):
    def acceleration(self, moment, inertia):
        return (self.torque + moment) / (inertia + 5.0)


@pytest.mark.parametrize(
    ("make", "must"),
    [
        (Uneven, "turn the shaft at a constant `speed` or leave it free"),
        (Ahead, "turn the shaft at a constant `speed`"),
        (Accelerated, "turn the shaft at a constant `speed`"),
        (Flywheel, "accelerate a free shaft by"),
        (lambda *numbers: jax.jit(Uneven)(*numbers), "turn the shaft at a constant"),
        # Its slope would be that of a constant speed, though its value is right.
        (lambda speed, _: jax.grad(lambda s: Uneven(speed, s).share)(0.0), "turn the shaft at"),
    ],
)
def test_what_would_be_integrated_as_another_drive_is_refused(make, must):
    with pytest.raises(ValueError, match=f"^Argument `drive` must {must}") as error:
        make(30.0, 0.1)
    assert "\n" not in str(error.value) and "but is a " in str(error.value)


def test_a_constant_speed_of_one_s_own_is_integrated():
    assert jax.jit(lambda speed: Even(speed, speed).speed)(30.0) == 30.0
    scene = jc.ideal_scene(30.0)
    own = dataclasses.replace(scene, drive=Even(30.0, 0.1))
    found = [jc.statistics(one, 0, 1, outputs=("foundation_rms",)) for one in (scene, own)]
    assert found[0].foundation_rms == found[1].foundation_rms


def test_power_is_looked_at_where_an_acceleration_shows(balance):
    """What is left out of an uneven speed is zero at time zero; no drive of this kind is built."""
    even = Even(30.0, 0.1)
    uneven = object.__new__(Uneven)
    for name in ("speed", "share"):
        object.__setattr__(uneven, name, getattr(even, name))
    scene = eqx.tree_at(lambda s: s.drive, jc.ideal_scene(30.0), uneven)
    difference, scale = balance(scene)
    # The mass of the mechanism times a tenth of the acceleration of its pin: 3 % of all power.
    assert abs(float(difference)) > 0.01 * float(scale)
