"""Vectors of the plane are complex numbers, with the same rules."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.basics.plane import Arm, Vector, direction, minus, optional_scalar, plus, scalar

ONE, OTHER = 3.0 - 4.0j, -0.5 + 2.0j
TURN = 0.6 + 0.8j  # of length one


def vector(number):
    return Vector(number.real, number.imag)


A, B, AXIS = map(vector, (ONE, OTHER, TURN))


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (A + B, ONE + OTHER),
        (A - B, ONE - OTHER),
        (-A, -ONE),
        (A * 2.5, 2.5 * ONE),
        (2.5 * A, 2.5 * ONE),
        (A / 2.5, ONE / 2.5),
        (A.perp(), 1j * ONE),
        (A.along(AXIS), ONE * TURN),
        (A.seen_from(AXIS), ONE / TURN),
        (direction(0.7), np.exp(0.7j)),
    ],
)
def test_vectors_are_complex_numbers(found, expected):
    # A rounding or two of numbers about 5.
    np.testing.assert_allclose(found.array(), [expected.real, expected.imag], rtol=0, atol=1e-15)


def test_products_are_parts_of_the_complex_one():
    product = ONE.conjugate() * OTHER
    assert (float(A.dot(B)), float(A.cross(B))) == (product.real, product.imag)


def test_scalars_are_floats():
    assert scalar(1).dtype == jnp.float64 and optional_scalar(2) == 2.0
    assert optional_scalar(None) is None


def test_numbers_are_printed_where_they_are_known():
    """Of many there is a type with a shape, and of a number that is traced its type."""
    assert repr(Vector(0.1 + 0.2, -4e-5)) == "Vector(x=0.3, y=-4e-05)"
    assert repr(Arm(jnp.inf)) == "Arm(x=inf)"
    many, seen = jax.vmap(vector)(jnp.array([1j, 2j])), []
    jax.jit(lambda one: seen.append(repr(one)))(A)
    assert [repr(many), *seen] == ["Vector(x=f64[2], y=f64[2])", "Vector(x=f64[], y=f64[])"]


@pytest.mark.parametrize(("one", "other"), [(3.0, 5.0), (None, 5.0), (3.0, None)])
def test_nothing_is_zero_in_sums_and_differences(one, other):
    first, second = (None if number is None else jnp.asarray(number) for number in (one, other))
    assert plus(first, second) == (one or 0.0) + (other or 0.0)
    assert minus(first, second) == (one or 0.0) - (other or 0.0)
    assert plus(None, None) is None and minus(None, None) is None
