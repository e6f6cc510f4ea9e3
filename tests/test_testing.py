"""What `check_law` accepts and what it refuses."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest

import jaxcrusher as jc
from jaxcrusher.basics import smooth
from jaxcrusher.basics.plane import scalar
from jaxcrusher.crusher.loads import AbstractLoad, JawForce
from jaxcrusher.joint.friction import AbstractFriction, AbstractSlip, SurfaceSlip
from jaxcrusher.joint.normal import Flores
from jaxcrusher.joint.rollers import RollerBearing
from jaxcrusher.testing import _check_bearing, _check_engines, _check_normal, check_law
from tests.pairs import slow


class Coulomb(AbstractFriction):
    """A power of the slip over its size; the first is Coulomb's law."""

    slip: AbstractSlip
    coefficient: jax.Array = eqx.field(converter=scalar)
    power: float = eqx.field(static=True, default=1.0)

    def force(self, normal_force, slip_speed):
        size = jnp.abs(slip_speed) ** self.power
        return -self.coefficient * normal_force * jnp.sign(slip_speed) * size


class Pulling(Flores):
    """A law whose damping has the wrong sign."""

    def damping_factor(self):
        return -0.1 * self.restitution


class Clipped(Flores):
    """A law that never pulls, by the corner that docs/own_parts.md recommends."""

    def force(self, penetration, rate, memory):
        return smooth.positive_part(super().force(penetration, rate, memory) - 1e-3, 1e-3)


class Sorted(AbstractLoad):
    """A load by an operation that lanes do not know."""

    def force(self, jaw):
        size = jnp.sort(jnp.stack([jaw.axis.x, 9e3 * jaw.axis.y]))[1]
        return JawForce(-size * jaw.axis)


class Twisted(RollerBearing):
    """A bearing whose moments do not balance its forces."""

    def contact(self, eccentricity, rate, bearing_spin, journal_spin, memory):
        touch = super().contact(eccentricity, rate, bearing_spin, journal_spin, memory)
        return dataclasses.replace(touch, journal_moment=2 * touch.journal_moment)


class Cornered(RollerBearing):
    """A bearing whose loss is a number and has no slope."""

    def contact(self, eccentricity, rate, bearing_spin, journal_spin, memory):
        touch = super().contact(eccentricity, rate, bearing_spin, journal_spin, memory)
        nothing = jnp.sqrt(eccentricity.x - eccentricity.x)
        return dataclasses.replace(touch, normal_loss=touch.normal_loss + nothing)


def rollers(kind):
    made = jc.build_scene({"contact_law": "rollers"}).joints.at("main")
    return kind(**{field.name: getattr(made, field.name) for field in dataclasses.fields(made)})


def normal(kind):
    made = jc.build_scene({}).joints.at("main").normal
    return kind(made.stiffness, made.restitution, made.impact_velocity, width=made.width)


@pytest.mark.parametrize("part", ["normal", *slow("friction", "load")])
def test_the_package_s_own_laws_pass(part):
    scene = jc.build_scene({"slip": "surface", "load_law": "normal_to_jaw"})
    check_law(scene.pushes[0] if part == "load" else getattr(scene.joints.at("main"), part))


@pytest.mark.slow
def test_a_force_that_is_cut_off_smoothly_passes():
    """The corner takes 1e-3 N, which at touch is more than the damping gives."""
    law = normal(Clipped)
    _check_normal(law)
    _check_bearing(dataclasses.replace(jc.build_scene({}).joints.at("main"), normal=law))


class Endless(AbstractLoad):
    """A load that no turn can be integrated with."""

    def force(self, jaw):
        return JawForce(jnp.nan * jaw.axis)


def test_a_law_that_cannot_be_integrated_is_told():
    """Before engines are compared: none of them gives a number."""
    with pytest.raises(ValueError, match="must let a turn of the crusher be integrated"):
        _check_engines(Endless())


@pytest.mark.slow
@pytest.mark.parametrize("law", ["rollers", "jaxcrusher.joint.cylinders:Esdu"])
def test_bearings_of_the_package_pass(law):
    check_law(jc.build_scene({"contact_law": law, "slip": "surface"}).joints.at("main"))


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (lambda: Coulomb(SurfaceSlip(), 0.1, 0.5), "finite slopes by slip"),
        (lambda: Coulomb(SurfaceSlip(), -0.1, 2.0), "must take power"),
        (lambda: normal(Pulling), "must take power by its damping"),
        (lambda: Sorted(), "must run in lanes"),
        (lambda: rollers(Twisted), "must (balance in moment|lose what its forces take)"),
        (lambda: rollers(Cornered), "must have finite slopes"),
        (lambda: 3, "must be an instance of"),
        (lambda: Coulomb, "but is the class Coulomb: give it its numbers"),
    ],
)
def test_bad_laws_are_told(law, words):
    with pytest.raises(ValueError, match=words) as error:
        check_law(law())
    assert str(error.value).startswith("Argument `law` must")
