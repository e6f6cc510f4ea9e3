"""Friction laws: Ambrosio's ramp, (11)-(12), and those of others against their formulas."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.joint.friction import (
    AmbrosioFriction,
    BengisuAkay,
    CentreSlip,
    Stribeck,
    SurfaceSlip,
    Threlfall,
)
from jaxcrusher.testing import check_law


def ramp(speed):
    return np.clip((np.abs(speed) - 0.1) / 0.9, 0, 1)


@pytest.mark.parametrize(
    ("law", "numbers"),
    [
        (AmbrosioFriction, (0.1, 0.1, 1.0, 1e-4)),
        (Threlfall, (0.1, 1.0)),
        (BengisuAkay, (0.1, 1.5, 0.1, 10.0)),
        (Stribeck, (0.1, 1.5, 0.3, 0.01)),
    ],
)
def test_numbers_that_are_left_out(law, numbers):
    """Ambrosio's are the paper's; those of the others have the same order."""
    assert jax.tree.leaves(law(SurfaceSlip())) == list(numbers)


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


def at(law, *speeds):
    return [-float(law.force(jnp.array(1e4), jnp.array(v))) for v in speeds]


def test_threlfall():
    """1 - exp(-3 v / v1) of c_f F_n, and 0.9502 of it above v1; the slope at rest is 3 / v1."""
    law = Threlfall(SurfaceSlip(), 0.2, 0.5)
    expected = [2e3 * (1 - np.exp(-3 * v / 0.5)) for v in (0.1, 0.4, 0.5)]
    np.testing.assert_allclose(at(law, 0.1, 0.4, 3.0), expected, rtol=1e-12)
    assert at(law, -0.1)[0] == -at(law, 0.1)[0] and at(law, 0.0)[0] == 0
    slope = jax.grad(law.force, argnums=1)(jnp.array(1e4), jnp.array(0.0))
    assert float(slope) == pytest.approx(-2e3 * 3 / 0.5, rel=1e-12)


def test_bengisu_and_akay():
    """The parabola's half, stiction at v0, and the decay behind it."""
    law = BengisuAkay(SurfaceSlip(), 0.2, 1.5, 0.1, 10.0)
    expected = [3e3 * 0.75, 3e3, 2e3 + 1e3 * np.exp(-2.0), 2e3]
    # exp(-29) is left at 3 m/s.
    np.testing.assert_allclose(at(law, 0.05, 0.1, 0.3, 3.0), expected, rtol=1e-12)
    assert at(law, -0.3)[0] == -at(law, 0.3)[0]


def test_stribeck():
    """Stiction close to rest, sliding far from it, and the curve between."""
    law = Stribeck(SurfaceSlip(), 0.2, 1.5, 0.3, 1e-4)
    expected = [2e3 + 1e3 * np.exp(-((v / 0.3) ** 2)) for v in (0.01, 0.3, 2.0)]
    np.testing.assert_allclose(at(law, 0.01, 0.3, 2.0), expected, rtol=1e-12)
    assert at(law, 0.0)[0] == 0


@pytest.mark.slow
@pytest.mark.parametrize("law", [Threlfall, BengisuAkay, Stribeck])
def test_laws_can_be_computed_with(law):
    check_law(law(SurfaceSlip()))
