"""Normal laws against closed forms (effective restitution, Hertz's impact)."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jax.test_util import check_grads
from scipy.integrate import solve_ivp

from jaxcrusher.joint.normal import (
    ConstantImpactVelocity,
    Flores,
    Gonthier,
    HuGuo,
    HuntCrossley,
    LankaraniNikravesh,
    TrackedImpactVelocity,
    ZhiyingQishao,
    cylinder_stiffness,
)

# D - ln(1 + D) = -D e* - ln(1 - D e*), solved to five digits elsewhere.
DELIVERED = {
    LankaraniNikravesh: {0.9: 0.91318, 0.7: 0.79597, 0.5: 0.72524},
    HuntCrossley: {0.9: 0.90902, 0.7: 0.76800, 0.5: 0.66296},
    Flores: {0.9: 0.89392, 0.7: 0.68318, 0.5: 0.47044},
    Gonthier: {0.9: 0.87644, 0.7: 0.66958, 0.5: 0.48774},
    ZhiyingQishao: {0.9: 0.89592, 0.7: 0.67957, 0.5: 0.48261},
    HuGuo: {0.9: 0.8999, 0.7: 0.6973, 0.5: 0.48774},
}
CASES = [(law, e, delivered) for law, row in DELIVERED.items() for e, delivered in row.items()]


@pytest.mark.parametrize("law, restitution, delivered", CASES)
def test_delivered_restitution_by_closed_form(law, restitution, delivered):
    made = law(1.4e8, restitution, ConstantImpactVelocity(0.5))
    # Five digits given.
    assert float(made.delivered_restitution(jnp.array(0.5))) == pytest.approx(delivered, abs=1e-5)
    # Both branches meet where the logarithms cancel: apart by 2/3 of the step, 2e-8 in D.
    at = 0.01 * 0.5 / made.damping_factor()
    below, above = (float(made.delivered_restitution(f * at)) for f in (1 - 1e-6, 1 + 1e-6))
    assert below == pytest.approx(above, abs=2e-8)


# As printed in the overviews of Alves et al. 2015 and of Rodrigues da Silva et al. 2022: the forces
# K d^1.5 (1 + D d' / v), from memory.
PRINTED = {
    LankaraniNikravesh: lambda e: 3 * (1 - e * e) / 4,
    HuntCrossley: lambda e: 3 * (1 - e) / 2,
    Flores: lambda e: 8 * (1 - e) / (5 * e),
    Gonthier: lambda e: (1 - e * e) / e,
    ZhiyingQishao: lambda e: 3 * (1 - e * e) * np.exp(2 * (1 - e)) / 4,
    HuGuo: lambda e: 3 * (1 - e) / (2 * e),
}


@pytest.mark.parametrize("law", DELIVERED)
def test_the_force_is_the_printed_one(law):
    made = law(1.4e8, 0.7, ConstantImpactVelocity(0.5), width=1e-13)
    for depth, rate in ((1e-6, 0.3), (5e-5, 0.0), (3e-4, -0.2)):
        printed = 1.4e8 * depth**1.5 * (1 + PRINTED[law](0.7) * rate / 0.5)
        found = float(made.force(jnp.array(depth), jnp.array(rate), None))
        # Rounding, and a corner a ten millionth as wide as the least depth.
        assert found == pytest.approx(printed, rel=1e-12)


@pytest.mark.parametrize("law", DELIVERED)
@pytest.mark.parametrize(
    ("restitution", "share"), [(0.3, 1.0), (0.5, 1.0), (0.7, 0.1), (0.7, 1.0), (0.9, 1.0)]
)
def test_a_drop_integrated_by_scipy(law, restitution, share):
    """The printed force, in units of mass, stiffness and impact speed, until it lets go.

    At a share of the impact velocity it damps that share.
    """
    damping = share * PRINTED[law](restitution)

    def field(_, y):
        return y[1], -(max(y[0], 0.0) ** 1.5) * (1 + damping * y[1])

    def lets_go(_, y):
        return y[0]

    lets_go.terminal, lets_go.direction = True, -1
    ended = solve_ivp(field, (0, 50), (0.0, 1.0), "DOP853", rtol=1e-13, atol=1e-14, events=lets_go)
    made = law(1.4e8, restitution, ConstantImpactVelocity(0.5))
    delivered = float(made.delivered_restitution(jnp.array(0.5 * share)))
    # Where the force begins its derivatives do not exist: DOP853 keeps some 1e-9 there.
    assert delivered == pytest.approx(-ended.y[1, -1], abs=1e-8)


@pytest.mark.parametrize("law", DELIVERED)
def test_slope_of_the_delivered_restitution(law):
    """By the implicit function theorem, forward and backward, one by one and side by side."""

    def delivered(restitution, speed=0.5):
        made = law(1.4e8, restitution, ConstantImpactVelocity(0.5))
        return made.delivered_restitution(jnp.asarray(speed))

    def damping(restitution):
        return law(1.4e8, restitution, ConstantImpactVelocity(0.5)).damping_factor()

    restitutions = jnp.array([0.3, 0.5, 0.7, 0.9, 0.99, 0.999, 0.999999])
    e, d = jax.vmap(delivered)(restitutions), jax.vmap(damping)(restitutions)
    # d/dD of the equation: D / (1 + D) = (e* + D de*/dD) D e* / (1 - D e*).
    slopes = ((1 - d * e) / (e * (1 + d)) - e) / d * jax.vmap(jax.grad(damping))(restitutions)
    found = jax.jit(jax.vmap(jax.grad(delivered)))(restitutions)
    # The closed form cancels like 1e-16 / D^2: of the last two only six and three digits stand.
    np.testing.assert_allclose(found[:5], slopes[:5], rtol=1e-9)
    np.testing.assert_allclose(found[5:], slopes[5:], rtol=1e-3)
    # Forward and backward, once and twice: against differences of 1e-4, curved by 1e-8.
    check_grads(delivered, (0.7,), order=2, atol=1e-6, rtol=1e-6, eps=1e-4)
    # Without damping e* = 1 - 2 D / 3 to first order, also for an impact without speed.
    limit = -2 / 3 * float(jax.grad(damping)(1.0))
    assert float(jax.grad(delivered)(1.0)) == pytest.approx(limit, rel=1e-12)
    by_speed = float(jax.grad(delivered, argnums=1)(0.7, 0.0))
    assert by_speed == pytest.approx(-2 / 3 * float(damping(0.7)) / 0.5, rel=1e-12)


def test_hertz_impact():
    """A kilogram at 1 m/s is stopped at the published depth, under the published force."""
    law = LankaraniNikravesh(1.4e8, 1.0, ConstantImpactVelocity(1.0), width=1e-13)
    deepest = jnp.array(6.02994e-4)
    # Six digits given, to the power 2.5; and four.
    assert float(law.elastic_energy(deepest)) == pytest.approx(0.5, rel=5e-6)
    assert float(law.force(deepest, jnp.array(0.0), None)) == pytest.approx(2073.0, rel=1e-4)


@pytest.mark.parametrize(
    "clearance, stiffness",
    [(0.03e-3, 3.576e12), (0.06e-3, 2.528e12), (0.09e-3, 2.064e12), (0.12e-3, 1.787e12)],
)
def test_stiffness_of_the_paper(clearance, stiffness):
    # Four digits given.
    assert float(cylinder_stiffness(0.13, clearance)) == pytest.approx(stiffness, rel=3e-4)


@settings(max_examples=30, deadline=None)
@given(st.floats(-1e-6, 1e-5), st.floats(0.3, 1.0))
def test_energy_is_the_work_of_the_elastic_force(penetration, restitution):
    law = HuntCrossley(2.5e12, restitution, ConstantImpactVelocity(0.5))
    penetration = jnp.array(penetration)
    slope = jax.grad(law.elastic_energy)(penetration)
    # Closed forms: rounding, of a force that reaches 8e4 N.
    assert float(slope) == pytest.approx(float(law.elastic_force(penetration)), rel=1e-11, abs=1e-9)
    assert float(law.force(jnp.array(-2e-8), jnp.array(1.0), None)) == 0


@pytest.mark.parametrize("law", DELIVERED)
def test_width_goes_to_zero(law):
    """The error of a width on the force falls with it, and is none beyond it."""
    sharp = 2.5e12 * (3e-6) ** 1.5
    for width in (1e-6, 1e-8, 1e-10):
        made = law(2.5e12, 0.9, ConstantImpactVelocity(0.5), width=width)
        assert float(made.elastic_force(jnp.array(3e-6))) == pytest.approx(sharp, rel=1e-9)
        at_corner = float(made.elastic_force(jnp.array(0.0)))
        assert at_corner == pytest.approx(2.5e12 * (width / 4) ** 1.5, rel=1e-12)


def test_tracked_velocity_follows_in_flight_and_rests_in_contact():
    law = TrackedImpactVelocity(floor=0.02, lag=0.5, least_gap=1e-6)
    flight, contact = jnp.array(0.0), jnp.array(1.0)
    assert float(law.value(jnp.array(0.001))) == 0.02

    def rate(in_contact, gap, approach):
        return float(law.rate(jnp.array(0.1), in_contact, jnp.array(-gap), jnp.array(approach)))

    # 0.2 m/s less than the approach, at 0.3 m/s over half of 9 um and the least gap.
    assert rate(flight, 9e-6, 0.3) == pytest.approx(0.2 * 0.3 / (0.5 * 1e-5), rel=1e-12)
    assert rate(contact, -9e-6, 0.3) == 0
    assert rate(flight, 9e-6, -0.3) == 0  # they part


@pytest.mark.parametrize(
    ("gap", "speed", "acceleration", "before"),
    [
        (0.5e-3, 1.0, 2e4, 0.0),
        (6e-5, 0.01, 10.0, 0.0),
        (0.5e-3, 4.0, -5e3, 0.0),
        (1e-4, 1e-3, 1e5, 5.0),
    ],
)
def test_tracked_velocity_is_that_of_the_touch_down(gap, speed, acceleration, before):
    """Over gaps that close under constant accelerations, in closed form up to the corner."""
    law = TrackedImpactVelocity()

    def field(time, y):
        approach = jnp.asarray(speed + acceleration * time)
        memory = law.rate(jnp.asarray(y[1]), jnp.array(0.0), jnp.asarray(-y[0]), approach)
        return [-float(approach), float(memory)]

    def touch(time, y):
        return y[0]

    touch.terminal = True
    end = solve_ivp(
        field, (0, 1), [gap, before], "LSODA", events=touch, rtol=1e-9, atol=[1e-15, 1e-12]
    )
    exact = np.sqrt(speed**2 + 2 * acceleration * gap)
    # What the speed gains over the lag of the least gap, once and a half, and the steps' tolerance.
    lag = 0.25 * 1e-8 * abs(acceleration) / exact**2
    assert end.y[1, -1] == pytest.approx(exact, rel=1.5 * lag + 1e-6)
