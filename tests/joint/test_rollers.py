"""Roller bearings against sums over rollers, published integrals, and the balance of moments."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import beta

import jaxcrusher as jc
from jaxcrusher.basics.plane import Vector
from jaxcrusher.joint.rollers import (
    EXPONENT,
    PALMGREN,
    STATIC_PRESSURE,
    Rollers,
    damping_shares,
    force_factor,
)

C = 6e-5
# Sjovall's integral of a bearing of which half is loaded.
HALF = beta(0.5, EXPONENT / 2 + 1) / (2 * np.pi)


def rollers(clearance=C):
    return Rollers(clearance=clearance, count=60, length=0.032, damping=2e4)


def test_a_roller_follows_palmgren():
    """10 kN on 32 mm: two rings give way by 3.84e-5 Q^0.9 / l^0.8 mm each."""
    depth = 1e-3 * 2 * 3.84e-5 * 1e4**0.9 / 32**0.8
    # The corner's width of 1e-8 m is out of reach: rounding alone.
    assert float(rollers().roller_load(jnp.asarray(depth))) == pytest.approx(1e4, rel=1e-12)
    # One ring alone: Harris gives 8.06e4 l^(8/9) N/mm^(10/9), three digits.
    assert PALMGREN * 2**EXPONENT * 1e-6 == pytest.approx(8.06e4, rel=3e-3)


def test_a_roller_is_nearly_as_stiff_as_the_standard_s():
    """ISO/TS 16281 (DIN 26281) has 35948 l^(8/9) N/mm^(10/9), between both rings."""
    # Palmgren's ring gives way by 3 % less.
    assert PALMGREN * 1e-6 == pytest.approx(35948, rel=0.04)


@pytest.mark.parametrize("depth", [3e-8, 1e-6, 1e-5, 1e-3])
def test_the_integral_is_a_sum_over_very_many_rollers(depth):
    law, count = rollers(), 400_000
    psi = 2 * np.pi * (np.arange(count) + 0.5) / count
    pressed = np.maximum((C + depth) * np.cos(psi) - C, 0) ** EXPONENT
    total = 60 * float(law.roller_stiffness()) * np.mean(pressed * np.cos(psi))
    # The rule over equal angles has an error of 1 / (rollers in the zone)^2.1, for 4000 of them.
    assert float(law.elastic_force(jnp.asarray(depth))) == pytest.approx(total, rel=1e-7)


def test_the_force_is_the_slope_of_the_energy():
    law, depths = rollers(), jnp.array([1e-7, 1e-6, 1e-5, 1e-3])
    slope = jax.vmap(jax.grad(law.elastic_energy))(depths)
    # Gauss' rules for force and energy are apart by what they leave out.
    np.testing.assert_allclose(slope, jax.vmap(law.elastic_force)(depths), rtol=1e-9)


def test_sjovall_s_integral_has_its_closed_forms():
    """Half of the bearing loaded: J_r = B(1/2, n/2 + 1) / (2 pi) = 0.2448.

    Tables for lines print 0.2453 (Harris) and 1 / 4.08 (NSK E728g), which is n = 1.1.
    """
    # J_r is the load over Z times the largest roller's, and sqrt(q) what the factor is without.
    half = float(force_factor(jnp.asarray(0.5))) * np.sqrt(0.5)
    assert half == pytest.approx(HALF, rel=1e-13)
    assert half == pytest.approx(0.2453, rel=3e-3)
    assert half == pytest.approx(1 / 4.08, rel=2e-3)
    assert beta(0.5, 1.55) / (2 * np.pi) == pytest.approx(0.2453, abs=5e-5)
    # A narrow zone: (1 / 2 pi) int (1 - x^2)^n 2 dx = B(1/2, n + 1) / pi.
    narrow = float(force_factor(jnp.asarray(0.0)))
    assert narrow == pytest.approx(beta(0.5, EXPONENT + 1) / np.pi, rel=1e-13)


def test_without_clearance_half_of_the_bearing_carries():
    law = rollers(1e-12)
    depth = jnp.asarray(1e-5)
    found = float(law.elastic_force(depth) / (60 * law.roller_load(depth)))
    # The zone lacks c / d = 1e-7 of it.
    assert found == pytest.approx(HALF, rel=1e-6)
    np.testing.assert_allclose(law.damping_coefficients(depth), [2e4, 2e4], rtol=1e-6)
    # And far inside its clearance nothing does.
    assert float(law.elastic_force(jnp.asarray(-1e-7))) == 0.0


def test_near_touch_the_power_is_29_18():
    one, two = rollers(), jnp.array([1e-7, 2e-7])
    forces = jax.vmap(one.elastic_force)(two)
    # d / c = 3e-3 makes 1e-3 of difference.
    assert float(forces[1] / forces[0]) == pytest.approx(2 ** (29 / 18), rel=2e-3)


def test_damping_shares_are_integrals_over_the_zone():
    zone = 0.8
    along, across = damping_shares(jnp.sin(zone / 2))
    psi = zone * (np.arange(20000) + 0.5) / 20000
    # Equal shares of the angle, twice the half of the zone, and 2 / pi: 1e-9 by their number.
    np.testing.assert_allclose(along, 4 / np.pi * zone * np.mean(np.cos(psi) ** 2), rtol=1e-8)
    np.testing.assert_allclose(across, 4 / np.pi * zone * np.mean(np.sin(psi) ** 2), rtol=1e-8)


def test_a_load_has_its_penetration():
    """And its slope is one over the stiffness."""
    law = rollers()

    @jax.jit
    @jax.vmap
    def again(force):
        depth, by_force = jax.value_and_grad(law.penetration_under)(force)
        found, by_depth = jax.value_and_grad(law.elastic_force)(depth)
        return found / force, by_force * by_depth

    # The corner of 1e-8 m is felt at a penetration of 6e-8 m, and less below.
    tolerances = np.array([0.05, 1e-3, 1e-5, 1e-5])
    for shares in again(jnp.array([10.0, 1e3, 2e4, 1e7])):
        assert (np.abs(shares - 1) <= tolerances).all(), shares


def test_stiffness_is_the_handbook_s():
    """Gargiulo's 0.3e6 Z^0.9 l^0.8 F^0.1 lbf/in has Stribeck's 5 for 1 / J_r."""
    law = rollers(1e-12)
    force = 2e4
    depth = law.penetration_under(jnp.asarray(force))
    found = float(jax.grad(law.elastic_force)(depth))
    pound, inch = 4.4482, 0.0254
    book = 0.3e6 * 60**0.9 * (0.032 / inch) ** 0.8 * (force / pound) ** 0.1 * pound / inch
    # His three digits.
    assert found == pytest.approx(book * (5 * HALF) ** 0.9, rel=2e-3)


def bearing(**numbers):
    return jc.build_scene({"contact_law": "rollers", **numbers}).joints.at("main")


def test_a_bearing_that_turns_as_one_body_loses_nothing():
    """And its forces have no moment in all."""
    turning = 7.0
    e = Vector(jnp.asarray(5e-5), jnp.asarray(4e-5))
    rate = turning * e.perp()
    touch = bearing().contact(e, rate, turning, turning, None)
    assert float(touch.normal_force) > 1e3
    # Of powers of 1e3 N at 4e-4 m/s.
    assert abs(float(touch.normal_loss)) < 1e-15 and float(touch.friction_loss) == 0
    moments = touch.bearing_moment + touch.journal_moment - e.cross(touch.force)
    assert abs(float(moments)) < 1e-15


def test_losses_are_what_the_forces_take():
    e, rate = Vector(jnp.asarray(5e-5), jnp.asarray(4e-5)), Vector(jnp.asarray(0.02), -0.03)
    touch = bearing().contact(e, rate, -0.4, 30.0, None)
    law, depth = bearing().normal, touch.penetration
    stored = law.elastic_force(depth) * touch.penetration_rate
    given = -touch.force.dot(rate) - 0.4 * touch.bearing_moment + 30.0 * touch.journal_moment
    assert float(touch.normal_loss) > 0.1 and float(touch.friction_loss) > 1
    total = stored + touch.normal_loss + touch.friction_loss
    # Rounding of powers of the size of their sum.
    assert float(given + total) == pytest.approx(0, abs=1e-12 * abs(float(total)))
    # SKF's moment mu F d / 2.
    moment = 0.0018 * float(law.elastic_force(depth)) * 0.12 / 2
    assert float(touch.friction_loss) == pytest.approx(30.4 * moment, rel=1e-6)


def test_the_static_rating_of_iso_76_is_at_4_gpa():
    """C_0 = 44 (1 - D_w / D_pw) Z l D_w N for mm is where a roller under 5 C_0 / Z has 4 GPa."""
    one = bearing()
    rating = 44 * (1 - 34 / 190) * 30 * 32 * 34
    depth = one.normal.penetration_under(jnp.asarray(1e4))  # any, scaled to the roller's load
    share = 5 * rating / 30 / float(one.normal.roller_load(depth))
    found = float(one.pressure(depth)) * np.sqrt(share)
    # ISO rounds its 44.
    assert found == pytest.approx(STATIC_PRESSURE, rel=0.01)
    assert float(one.static_rating) == pytest.approx(rating, rel=0.06)
