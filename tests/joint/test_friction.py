"""Ambrosio's ramp, (11)-(12)."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.joint.friction import AmbrosioFriction, CentreSlip, SurfaceSlip


def ramp(speed):
    return np.clip((np.abs(speed) - 0.1) / 0.9, 0, 1)


def test_ramp_and_direction():
    law = AmbrosioFriction(SurfaceSlip(), 0.1, width=1e-9)
    speeds = np.array([-3.9, -1.0, -0.4, -0.1, -0.05, 0.0, 0.05, 0.3, 0.99, 1.01, 5.0])
    force = jax.vmap(law.force, (None, 0))(jnp.array(1e4), jnp.asarray(speeds))
    # A width of 1e-9 m/s leaves 1e-9 / 4 / 0.9 of 1 kN at a corner.
    np.testing.assert_allclose(force, -1e3 * ramp(speeds) * np.sign(speeds), atol=1e-6)


def test_smooth_at_zero_slip_and_corners():
    law = AmbrosioFriction(SurfaceSlip())
    for speed in (0.0, 0.1, -0.1, 1.0):
        assert jnp.isfinite(jax.grad(law.force, argnums=1)(jnp.array(1e4), jnp.array(speed)))
    assert float(law.force(jnp.array(1e4), jnp.array(0.0))) == 0
    # Coulomb's sign alone (no dead band), still odd and finite.
    coulomb = AmbrosioFriction(SurfaceSlip(), 0.1, 0.0, 1e-2)
    assert float(coulomb.force(jnp.array(1e4), jnp.array(0.5))) == pytest.approx(-1e3, rel=1e-12)
    assert float(coulomb.force(jnp.array(1e4), jnp.array(0.0))) == 0


def test_slip_readings():
    assert CentreSlip().speed(jnp.array(1.0), jnp.array(2.0)) == 1
    assert SurfaceSlip().speed(jnp.array(1.0), jnp.array(2.0)) == 2
