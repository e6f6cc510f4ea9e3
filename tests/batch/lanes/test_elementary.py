"""Elementary functions against 80-bit floats."""

import numpy as np
import pytest

from jaxcrusher.batch.lanes import elementary
from tests.batch.lanes.rows import over_rows

COUNT = 100_000
RANDOM = np.random.default_rng(0)
QUARTERS = RANDOM.integers(-(2**29), 2**29, COUNT) * (np.pi / 2)
ANGLES = np.concatenate([
    RANDOM.uniform(-10, 10, COUNT),
    RANDOM.uniform(-elementary.LARGEST_ANGLE, elementary.LARGEST_ANGLE, COUNT),
    QUARTERS,  # next to the zeros, where all leading digits cancel
    10 ** RANDOM.uniform(-300, 0, COUNT),
])  # fmt: skip
POSITIVE = np.concatenate([
    10 ** RANDOM.uniform(-323, 308, COUNT),
    RANDOM.uniform(0.5, 2, COUNT),
    1 + RANDOM.uniform(-1e-6, 1e-6, COUNT),
])  # fmt: skip
EXPONENTS = np.concatenate([RANDOM.uniform(-745, 709, COUNT), RANDOM.uniform(-1, 1, COUNT)])
SPECIAL = np.array([0.0, -0.0, 1.0, -1.0, 2.5, np.inf, -np.inf, np.nan, 5e-324, 1e-310, 1e308])
FUNCTIONS = {
    "sine": (np.sin, ANGLES),
    "cosine": (np.cos, ANGLES),
    "exponential": (np.exp, EXPONENTS),
    "logarithm": (np.log, POSITIVE),
}

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
    known = SPECIAL[np.abs(SPECIAL) != 1e308] if name in ("sine", "cosine") else SPECIAL
    with np.errstate(all="ignore"):
        np.testing.assert_allclose(_vectorised(name)(known), FUNCTIONS[name][0](known), rtol=4e-16)


def test_angles_beyond_the_range_are_nan():
    beyond = np.array([1.0, -1.0, 1e3]) * np.nextafter(elementary.LARGEST_ANGLE, np.inf)
    assert np.isnan(_vectorised("sine")(beyond)).all()
    assert np.isnan(_vectorised("cosine")(beyond)).all()


def test_special_powers():
    x, y = (grid.ravel() for grid in np.meshgrid(SPECIAL, np.append(SPECIAL, [-2.5, 3.0, -3.0])))
    # A negative infinity to a broken power is the one exception: NaN, as of other negative numbers.
    usual = ~((x == -np.inf) & (np.floor(y) != y))
    with np.errstate(all="ignore"):
        exact = np.power(x, y)
    np.testing.assert_allclose(_vectorised("power")(x, y)[usual], exact[usual], rtol=4e-16)
