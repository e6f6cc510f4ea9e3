"""Friction with bristles against closed forms of presliding, breakaway, sliding and loss."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxcrusher.joint.bristles import LuGre
from jaxcrusher.joint.friction import SurfaceSlip

MU, RATIO, V_S, S0 = 0.1, 1.3, 0.05, 2e4
LAW = LuGre(
    SurfaceSlip(),
    coefficient=MU,
    static_ratio=RATIO,
    stribeck_speed=V_S,
    bristle_stiffness=S0,
    viscous=0.02,
)
FORCE = 5e3  # normal, N


def forces(speeds, bent, law=LAW):
    """The friction of slips and deflections."""
    return jax.vmap(lambda v, y: law.force(jnp.asarray(FORCE), v, y))(speeds, bent)


def along(speed, times, law=LAW):
    """The bristles' deflection and the friction of a slip that is given over time."""

    def rate(time, y):
        return [float(law.rate(jnp.asarray(y[0]), jnp.ones(()), jnp.asarray(speed(time))))]

    found = solve_ivp(rate, (times[0], times[-1]), [0.0], "LSODA", times, rtol=1e-9, atol=1e-12)
    bent = found.y[0]
    speeds = jnp.asarray([speed(time) for time in times])
    return bent, np.asarray(forces(speeds, jnp.asarray(bent), law))


@pytest.mark.parametrize("speed", [0.01, 0.05, -0.3])
def test_steady_sliding_is_stribecks_curve(speed):
    """Also without a memory, which is what a law of friction is looked at by."""
    holds = MU * (1 + (RATIO - 1) * np.exp(-((speed / V_S) ** 2)))
    steady = -FORCE * (holds * np.sign(speed) + 0.02 * speed)
    _, force = along(lambda time: speed, np.array([0.0, 40 * holds / (S0 * abs(speed))]))
    # Of 40 distances that bend a bristle, and LSODA's tolerance.
    assert force[-1] == pytest.approx(steady, rel=1e-6)
    assert float(LAW.force(jnp.asarray(FORCE), jnp.asarray(speed))) == pytest.approx(
        steady, rel=1e-12
    )


def test_presliding_is_a_spring():
    """Of s0 F_n, to first order in its share of what breaks away."""
    pace, least = 1e-5, 1e-3 * MU * RATIO / S0
    _, force = along(lambda time: pace, np.array([0.0, least / pace]))
    # Without s1 v; half of the share of the bristles slides back.
    stiff = -(force[-1] + FORCE * LAW.bristle_damping * pace * (1 - 1e-3)) / (FORCE * least)
    assert float(stiff) == pytest.approx(S0, rel=2e-3)


def test_it_breaks_away_at_its_stiction():
    """A slip that grows slowly meets mu_s F_n, and falls to mu_k F_n when it is fast."""
    times = np.linspace(0, 1.0, 4001)
    bent, _ = along(lambda time: 1e-5 + 0.2 * time**4, times)
    # The slip of 1e-3 m/s at which bristles are bent takes 4e-4 of the difference.
    assert bent.max() == pytest.approx(MU * RATIO, rel=2e-3)
    assert bent[-1] == pytest.approx(MU, rel=1e-3)


def test_a_loop_of_presliding_loses_energy():
    """The force returns on another way than it came: hysteresis, of less than full friction."""
    size, pace = 0.5 * MU * RATIO / S0, 2 * np.pi
    times = np.linspace(0, 3, 3001)
    _, force = along(lambda time: size * pace * np.cos(pace * time), times)
    place = size * np.sin(pace * times)
    last = slice(2000, None)
    lost = -np.trapezoid(force[last], place[last])
    assert 0.02 < lost / (4 * size * MU * RATIO * FORCE) < 0.5


@pytest.mark.parametrize(("damping_speed", "passive"), [(0.02, True), (1.0, False)])
def test_bristles_give_back_no_more_than_they_keep(damping_speed, passive):
    """Where s1 v_d <= 9.3 mu_k, by the sum of squares in the module's docstring."""
    law = LuGre(SurfaceSlip(), coefficient=MU, bristle_stiffness=S0, damping_speed=damping_speed)
    assert (40 * damping_speed <= 9.3 * MU) == passive
    random = np.random.default_rng(0)
    bent = jnp.asarray(random.uniform(-1.2 * MU, 1.2 * MU, 4000))
    slip = jnp.asarray(np.sign(random.normal(size=4000)) * 10.0 ** random.uniform(-5, 1, 4000))
    rates = jax.vmap(lambda y, v: law.rate(y, jnp.ones(()), v))(bent, slip)
    lost = -forces(slip, bent, law) * slip - FORCE * bent * rates / S0
    scale = FORCE * MU * jnp.abs(slip)
    # Rounding of sums of terms as large as friction's own power.
    assert bool(jnp.all(lost >= -1e-12 * scale)) == passive


def test_bristles_let_go_in_flight():
    rate = float(LAW.rate(jnp.asarray(0.05), jnp.zeros(()), jnp.asarray(1.0)))
    assert rate == pytest.approx(-0.05 / 1e-4, rel=1e-12)
