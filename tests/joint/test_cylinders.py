"""Line contacts against the published equations, their energies and check_law."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from jaxcrusher.joint.cylinders import Esdu, Johnson, Liu
from jaxcrusher.joint.normal import ConstantImpactVelocity

C, MODULUS, LENGTH = 6e-5, 207e9 / (2 * (1 - 0.29**2)), 0.4
LAWS = {
    Johnson: lambda x, d: x * (np.log(4 * C / x) - 1) - d,
    Esdu: lambda x, d: x * (np.log(4 * C / x) + 1) - d,
    Liu: lambda x, d: d / 2 * np.sqrt(d / (2 * (C + d))) - x,
}


def made(kind):
    return kind(
        restitution=0.9,
        impact_velocity=ConstantImpactVelocity(0.5),
        clearance=C,
        modulus=MODULUS,
        length=LENGTH,
    )


@pytest.mark.parametrize("kind", LAWS)
def test_the_published_equation_holds(kind):
    law = made(kind)
    for depth in (3e-8, 1e-6, 1e-5):
        x = float(law.elastic_force(jnp.asarray(depth))) / (np.pi * MODULUS * LENGTH)
        # Rounding of a difference of numbers some ten times larger.
        assert LAWS[kind](x, depth) == pytest.approx(0, abs=1e-13 * depth)
        assert float(law.depth(jnp.asarray(x))) == pytest.approx(depth, rel=1e-12)


@pytest.mark.parametrize("kind", [Johnson, Esdu])
def test_the_factor_before_the_logarithm_is_that_of_plane_elasticity(kind):
    """The approach grows with the load as that of two half planes under Hertz's pressure does."""
    law, poisson, radius = made(kind), 0.29, 0.13

    def approach(force):
        """Return how far the surface moves against a point at the depth of a diameter, twice."""
        half = np.sqrt(4 * force * radius**2 / (np.pi * MODULUS * LENGTH * C))
        peak = 2 * force / (np.pi * half * LENGTH)

        def strain(z):
            root = np.hypot(1, z / half)
            down, across = -peak / root, -peak * ((2 * root**2 - 1) / root - 2 * z / half)
            return down - poisson / (1 - poisson) * across

        # Both bodies are of one material, so that each takes half of 1 / E*.
        return -quad(strain, 0, 2 * radius, points=[half, 10 * half], limit=200)[0] / MODULUS

    few, many = 1e3, 1e4
    elastic = approach(many) / many - approach(few) / few
    shown = [float(law.penetration_under(jnp.asarray(force))) / force for force in (few, many)]
    # A quarter of the squared half-width, 9 mm, over the depth, 260 mm: 3e-4.
    assert shown[1] - shown[0] == pytest.approx(elastic, rel=1e-3)


@pytest.mark.parametrize("kind", LAWS)
def test_energy_is_the_work_and_force_has_no_jump(kind):
    law = made(kind)
    deep = 3 * C  # beyond the beginning of the tangent
    work, _ = quad(lambda d: float(law.elastic_force(jnp.asarray(d))), 0, deep, epsrel=1e-10)
    # The corner's 1e-8 m at 0 is not in the work: 1e-10 of it.
    assert float(law.elastic_energy(jnp.asarray(deep))) == pytest.approx(work, rel=1e-8)
    slopes = jax.vmap(jax.grad(law.elastic_force))(jnp.linspace(1e-6, deep, 4001))
    assert bool(jnp.all(slopes > 0))
    # Steps of 4e-8 m: the slope, which rises by the logarithm alone, has no jump.
    assert float(jnp.max(jnp.abs(jnp.diff(jnp.log(slopes))))) < 0.05


@pytest.mark.parametrize("kind", LAWS)
def test_the_corner_too_is_the_slope_of_the_energy(kind):
    law = made(kind)
    for depth in np.array([-2e-8, 0.0, 4e-9, 2e-8]):
        slope = float(jax.grad(law.elastic_energy)(jnp.asarray(depth)))
        # Rounding of Liu's terms, (c / delta)^2 = 6e8 times as large as their sum at 0.
        assert float(law.elastic_force(jnp.asarray(depth))) == pytest.approx(slope, rel=1e-6)


def test_what_is_not_hertzian_is_seen():
    """Where the tangent begins, the half-width is 2 sqrt(x / c) = 0.54 bore radii."""
    law = made(Esdu)
    depth = 4 * C * np.exp(-4) * 5
    width = law.half_width(jnp.asarray(depth), jnp.asarray(0.13**2 / C))
    assert float(width) / 0.13 == pytest.approx(4 * np.exp(-2), rel=1e-6)
