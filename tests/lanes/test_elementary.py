"""Elementary functions against 80-bit floats."""

import numpy as np
import pytest

from jaxcrusher.lanes import elementary
from jaxcrusher.lanes.expression import modulo
from tests.lanes.rows import over_rows

COUNT = 100_000
RANDOM = np.random.default_rng(0)
QUARTERS = RANDOM.integers(-(2**29), 2**29, COUNT) * (np.pi / 2)
ANGLES = np.concatenate(
    [
        RANDOM.uniform(-10, 10, COUNT),
        RANDOM.uniform(-elementary.LARGEST_ANGLE, elementary.LARGEST_ANGLE, COUNT),
        QUARTERS,  # next to the zeros, where all leading digits cancel
        10 ** RANDOM.uniform(-300, 0, COUNT),
    ]
)
POSITIVE = np.concatenate(
    [
        10 ** RANDOM.uniform(-323, 308, COUNT),
        RANDOM.uniform(0.5, 2, COUNT),
        1 + RANDOM.uniform(-1e-6, 1e-6, COUNT),
    ]
)
EXPONENTS = np.concatenate([RANDOM.uniform(-745, 709, COUNT), RANDOM.uniform(-1, 1, COUNT)])
EITHER_SIGN = np.concatenate(
    [
        RANDOM.choice([-1.0, 1.0], COUNT) * 10 ** RANDOM.uniform(-323, 308, COUNT),
        RANDOM.uniform(-40, 40, COUNT),
        RANDOM.uniform(-1.5, 1.5, COUNT),
    ]
)
COSINES = EITHER_SIGN[np.abs(EITHER_SIGN) <= 1]
SPECIAL = np.array([0.0, -0.0, 1.0, -1.0, 2.5, np.inf, -np.inf, np.nan, 5e-324, 1e-310, 1e308])
FUNCTIONS = {
    "sine": (np.sin, ANGLES),
    "cosine": (np.cos, ANGLES),
    "exponential": (np.exp, EXPONENTS),
    "logarithm": (np.log, POSITIVE),
    "tangent": (np.tan, ANGLES),
    "exponential_less_one": (np.expm1, EITHER_SIGN[EITHER_SIGN < 709]),
    "logarithm_of_one_more": (np.log1p, EITHER_SIGN[EITHER_SIGN > -1]),
    "hyperbolic_tangent": (np.tanh, EITHER_SIGN),
    "logistic": (lambda x: 1 / (1 + np.exp(-x)), np.append(EXPONENTS, COSINES)),
    "arc_tangent": (np.arctan, EITHER_SIGN),
    "arc_sine": (np.arcsin, COSINES),
}
OF_ANGLES = ("sine", "cosine", "tangent")

# 80-bit floats resolve what is tested here; elsewhere NumPy's own functions would be the judge.
pytestmark = pytest.mark.skipif(
    np.finfo(np.longdouble).nmant < 63, reason="no 80-bit floats on this machine"
)


def _vectorised(name):
    """A function of arrays."""

    def call(*operands):
        def write(code):
            return [getattr(elementary, name)(*map(code.read, range(len(operands))))]

        return over_rows(write, *operands)[0]

    return call


def _ulps(found, exact):
    return np.max(np.abs(found - exact) / np.spacing(np.abs(exact.astype(float))))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_two_ulp_over_the_range(name):
    exact, places = FUNCTIONS[name]
    found = _vectorised(name)(places)
    assert _ulps(found, exact(places.astype(np.longdouble))) < 2


def test_power_to_two_ulp():
    rates = RANDOM.uniform(-740, 708, POSITIVE.size)
    logarithms = np.log(POSITIVE)
    exponents = np.divide(rates, logarithms, out=rates, where=logarithms != 0)
    found = _vectorised("power")(POSITIVE, exponents)
    exact = np.power(POSITIVE.astype(np.longdouble), exponents.astype(np.longdouble))
    assert _ulps(found, exact) < 2


@pytest.mark.parametrize("name", FUNCTIONS)
def test_special_values(name):
    known = SPECIAL[np.abs(SPECIAL) != 1e308] if name in OF_ANGLES else SPECIAL
    with np.errstate(all="ignore"):
        np.testing.assert_allclose(_vectorised(name)(known), FUNCTIONS[name][0](known), rtol=4e-16)


def test_angles_beyond_the_range_are_nan():
    beyond = np.array([1.0, -1.0, 1e3]) * np.nextafter(elementary.LARGEST_ANGLE, np.inf)
    assert np.isnan(_vectorised("sine")(beyond)).all()
    assert np.isnan(_vectorised("cosine")(beyond)).all()
    assert np.isnan(_vectorised("tangent")(beyond)).all()


def test_angles_of_points_to_two_ulp():
    size = 10 ** RANDOM.uniform(-150, 150, (2, COUNT))
    y, x = size * RANDOM.choice([-1.0, 1.0], (2, COUNT))
    y[::2] = x[::2] * RANDOM.uniform(-3, 3, COUNT // 2)
    exact = np.arctan2(y.astype(np.longdouble), x.astype(np.longdouble))
    assert _ulps(_vectorised("angle")(y, x), exact) < 2


def test_special_points():
    y, x = (grid.ravel() for grid in np.meshgrid(SPECIAL, np.append(SPECIAL, [-5e-324, -1e308])))
    found, exact = _vectorised("angle")(y, x), np.arctan2(y, x)
    np.testing.assert_allclose(found, exact, rtol=4e-16)
    np.testing.assert_array_equal(np.signbit(found), np.signbit(exact))


def test_special_powers():
    x, y = (grid.ravel() for grid in np.meshgrid(SPECIAL, np.append(SPECIAL, [-2.5, 3.0, -3.0])))
    with np.errstate(all="ignore"):
        exact = np.power(x, y)
    np.testing.assert_allclose(_vectorised("power")(x, y), exact, rtol=4e-16)


def test_what_a_division_leaves_is_exact():
    divisors = RANDOM.choice([-1.0, 1.0], 2 * COUNT) * 10 ** RANDOM.uniform(-10, 10, 2 * COUNT)
    # A quotient of 2^52 and more has no digits behind the point: NaN.
    quotients = np.append(10 ** RANDOM.uniform(-3, 15, COUNT), RANDOM.integers(1, 2**20, COUNT))
    numbers = divisors * quotients
    found = over_rows(lambda code: [modulo(code.read(0), code.read(1))], numbers, divisors)[0]
    np.testing.assert_array_equal(found, np.fmod(numbers, divisors))
    huge = over_rows(lambda code: [modulo(code.read(0), 1.0)], np.array([2.0**52, np.inf]))[0]
    assert np.isnan(huge).all()
