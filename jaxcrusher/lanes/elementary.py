"""Sine, cosine, tangent, exponentials, logarithms and powers of vectors, without branches or calls.

Each is right to 2 ulp. A product and the number added to it are rounded once (`fma`). Sums are
computed as written, since LLVM would remove terms that compensate each other.
"""

import math

import numpy as np

from jaxcrusher.lanes.expression import bits, double, exactly, floor, fma, sqrt, where

# Added to a whole number below 2^51, it puts that number into the lowest bits.
_MAGIC = 6755399441055744.0  # 1.5 * 2^52
_TWO_52_BITS, _TWO_52 = 0x4330000000000000, 4503599627370496.0


def _product(a, b):
    """Return a b as an unevaluated sum."""
    high = a * b
    return high, fma(a, b, -high)


def _sum(a, b):
    """Return a + b as an unevaluated sum (Knuth)."""
    high = a + b
    part = high - a
    return high, (a - (high - part)) + (b - part)


def _polynomial(x, *coefficients):
    """Evaluate a polynomial; the first coefficient is that of the highest power."""
    value = coefficients[0]
    for coefficient in coefficients[1:]:
        value = fma(x, value, coefficient)
    return value


# Beyond this the sine and the cosine are NaN: 1.7e8 turns.
LARGEST_ANGLE = 2.0**30
# pi / 2 as a sum of doubles.
_HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591833e-33)


def _reduced(x):
    """Take whole quarter turns off x: a number of at most pi / 4, its tail, and the quarter."""
    quotient = fma(x, 0.6366197723675814, _MAGIC) - _MAGIC
    # Exact: both have the same leading digits.
    rest = fma(-quotient, _HALF_PI[0], x)
    product, error = _product(quotient, _HALF_PI[1])
    high, tail = _sum(rest, -product)
    tail = fma(-quotient, _HALF_PI[2], tail - error)
    high = where(abs(x) <= LARGEST_ANGLE, high, math.nan)
    return high, tail, bits(quotient + _MAGIC)


def _sine_near_zero(r, tail):
    z = r * r
    p = _polynomial(
        z,
        1.58969099521155010221e-10,
        -2.50507602534068634195e-08,
        2.75573137070700676789e-06,
        -1.98412698298579493134e-04,
        8.33333333332248946124e-03,
        -1.66666666666666324348e-01,
    )
    return r + fma(r * z, p, tail)


def _cosine_near_zero(r, tail):
    z = r * r
    p = _polynomial(
        z,
        -1.13596475577881948265e-11,
        2.08757232129817482790e-09,
        -2.75573143513906633035e-07,
        2.48015872894767294178e-05,
        -1.38888888888741095749e-03,
        4.16666666666666019037e-02,
    )
    half = 0.5 * z
    top = 1.0 - half
    return top + (((1.0 - top) - half) + fma(z * z, p, -(r * tail)))


@exactly(np.sin)
def sine(x):
    """Return sin x; the minimax polynomials are those of fdlibm, on a quarter turn."""
    r, tail, quarter = _reduced(x)
    s, c = _sine_near_zero(r, tail), _cosine_near_zero(r, tail)
    value = where(quarter & 1 == 0, s, c)
    return where(quarter & 2 == 0, value, -value)


@exactly(np.cos)
def cosine(x):
    """Return cos x, as `sine`."""
    r, tail, quarter = _reduced(x)
    s, c = _sine_near_zero(r, tail), _cosine_near_zero(r, tail)
    value = where(quarter & 1 == 0, c, s)
    return where((quarter + 1) & 2 == 0, value, -value)


@exactly(np.tan)
def tangent(x):
    """Return tan x, as `sine`."""
    r, tail, quarter = _reduced(x)
    s, c = _sine_near_zero(r, tail), _cosine_near_zero(r, tail)
    even = quarter & 1 == 0
    return where(even, s, -c) / where(even, c, s)


# ln 2, its first part of 40 bits, so that products with exponents are exact.
_LN2, _LN2_TAIL = 0.6931471805592082, 7.371002565167799e-13


def _scaled(value, exponent):
    """Return value 2^exponent for whole exponents in [-2000, 2000], in two steps within range."""
    first = exponent * 0.5 + _MAGIC - _MAGIC
    for part in (first, exponent - first):
        value = value * _power_of_two(part)
    return value


def _power_of_two(exponent):
    """Return 2^exponent for a whole `exponent` in [-1022, 1023]."""
    return double((bits(exponent + (_MAGIC + 1023.0)) & 0xFFF) << 52)


def _factors(x, tail):
    """Find k, r and s with exp(x + tail) = 2^k (1 + r + s); the tail is an ulp at most."""
    clipped = where(x < -1000.0, -1000.0, where(x > 1000.0, 1000.0, x))
    exponent = fma(clipped, 1.4426950408889634, _MAGIC) - _MAGIC
    r = clipped - exponent * _LN2
    r, rest = _sum(r, fma(-exponent, _LN2_TAIL, tail))
    p = _polynomial(r, *(1.0 / math.factorial(n) for n in range(13, 1, -1)))
    return exponent, r, fma(r * r, p, fma(rest, r, rest))


def _exponential(x, tail):
    """Return exp(x + tail) for a tail of at most an ulp of x."""
    exponent, r, s = _factors(x, tail)
    value = _scaled(1.0 + (r + s), exponent)
    return where(x == x, value, x)


def _less_one(x):
    """Find an exponent k and an unevaluated sum with exp(x) - 1 = 2^k sum."""
    # Below, the exponential does not matter.
    exponent, r, s = _factors(where(x < -50.0, -50.0, x), 0.0)
    small, small_tail = _sum(r, s)
    inverse = _power_of_two(-where(exponent > 100.0, 100.0, exponent))
    whole, whole_tail = _sum(1.0, -inverse)
    high, tail = _sum(whole, small)
    return exponent, high, tail + (whole_tail + small_tail)


@exactly(np.exp)
def exponential(x):
    """Return exp x."""
    return _exponential(x, 0.0)


@exactly(np.expm1)
def exponential_less_one(x):
    """Return exp x - 1, also where that is small."""
    exponent, high, tail = _less_one(x)
    return where(x == x, _scaled(high + tail, exponent), x)


def _parts(x):
    """Split x > 0 into a whole exponent of 2 and a factor between sqrt(1/2) and sqrt(2)."""
    small = x < 2.2250738585072014e-308
    whole = bits(where(small, x * 18014398509481984.0, x))  # 2^54
    # The bits of sqrt(1/2): what is above counts to the next power of 2.
    shifted = whole - 0x3FE6A09E667F3BCD
    biased = (shifted >> 52) + 2048
    exponent = double(biased | _TWO_52_BITS) - (_TWO_52 + 2048.0)
    factor = double(whole - ((biased - 2048) << 52))
    return exponent - where(small, 54.0, 0.0), factor


def _logarithm(x):
    """Return ln x as an unevaluated sum, for finite x > 0."""
    exponent, factor = _parts(x)
    # ln m = 2 artanh s, s = (m - 1) / (m + 1).
    over, under = factor - 1.0, factor + 1.0
    s = over / under
    under_tail = factor - (under - 1.0)
    s_tail = (fma(-s, under, over) - s * under_tail) / under
    z, z_tail = _product(s, s)
    z_tail = fma(2.0 * s, s_tail, z_tail)
    third, third_tail = 0.3333333333333333, 1.850371707708594e-17
    cube, cube_tail = _product(z, third)
    cube_tail = fma(z, third_tail, fma(z_tail, third, cube_tail))
    q = _polynomial(z, *(1.0 / n for n in range(23, 3, -2)))
    cube, more = _sum(cube, z * z * q)
    cube_tail = cube_tail + more
    # 2 s (1 + cube)
    added, added_tail = _product(s, cube)
    added_tail = fma(s, cube_tail, fma(s_tail, cube, added_tail))
    high, tail = _sum(s, added)
    high, tail = 2.0 * high, 2.0 * (tail + added_tail + s_tail)
    whole, whole_tail = _sum(exponent * _LN2, exponent * _LN2_TAIL)
    total, rest = _sum(whole, high)
    return _sum(total, rest + (whole_tail + tail))


@exactly(np.log)
def logarithm(x):
    """Return ln x; minus infinity at zero, NaN below."""
    high, tail = _logarithm(x)
    value = where(x < math.inf, high + tail, x)
    return where(x > 0.0, value, where(x == 0.0, -math.inf, math.nan))


@exactly(np.log1p)
def logarithm_of_one_more(x):
    """Return ln(1 + x), also where that is small; minus infinity at -1, NaN below."""
    more, lost = _sum(1.0, x)
    high, tail = _logarithm(more)
    high, rest = _sum(high, lost / more)
    value = where(x < math.inf, high + (rest + tail), x)
    return where(x > -1.0, value, where(x == -1.0, -math.inf, math.nan))


@exactly(np.power)
def power(x, y):
    """Return x^y; NaN for a finite x < 0 unless y is whole."""
    size = abs(x)
    base = where((size > 0.0) & (size < math.inf), size, 1.0)
    high, tail = _logarithm(base)
    bounded = where(y > 1e300, 1e300, where(y < -1e300, -1e300, y))
    product, error = _product(high, bounded)
    # Where the result is zero or infinite the error's terms are not finite.
    near = abs(product) < 1400.0
    value = _exponential(product, where(near, fma(tail, bounded, error), 0.0))
    value = where(size > 0.0, value, where(y > 0.0, 0.0, math.inf))
    value = where(size < math.inf, value, where(y > 0.0, math.inf, 0.0))
    whole = floor(y) == y
    odd = whole & (floor(0.5 * y) != 0.5 * y)
    value = where(odd & (bits(x) < 0), -value, value)
    value = where((x < 0.0) & (size < math.inf) & ~whole, math.nan, value)
    value = where((x == x) & (y == y), value, math.nan)
    return where((x == 1.0) | (y == 0.0), 1.0, value)


@exactly(np.tanh)
def hyperbolic_tangent(x):
    """Return tanh x."""
    exponent, high, tail = _less_one(-2.0 * abs(x))
    over, over_tail = -_scaled(high, exponent), -_scaled(tail, exponent)
    under, under_tail = _sum(2.0, -over)
    quotient = over / under
    lost = fma(-quotient, under, over) + (over_tail - quotient * (under_tail - over_tail))
    value = quotient + lost / under
    return where(x < 0.0, -value, value)


@exactly(lambda x: np.where(x < 0, np.exp(-abs(x)), 1.0) / (1.0 + np.exp(-abs(x))))
def logistic(x):
    """Return 1 / (1 + exp(-x))."""
    share = _exponential(-abs(x), 0.0)
    return where(x < 0.0, share, 1.0) / (1.0 + share)


_PI, _PI_TAIL = 3.141592653589793, 1.2246467991473532e-16


def _arc(over, under):
    """Return the arc tangent of a quotient of numbers that are not negative, and not both zero."""
    ratio = over / under
    steep, middle = ratio > 2.414213562373095, ratio > 0.66
    # tan(a - pi/2) = -1 / tan a, tan(a - pi/4) = (tan a - 1) / (tan a + 1)
    bottom = where(steep, ratio, where(middle, ratio + 1.0, 1.0))
    u = where(steep, -1.0, where(middle, ratio - 1.0, ratio)) / bottom
    z = u * u
    # The coefficients are those of Cephes.
    p = _polynomial(
        z,
        -8.750608600031904122785e-01,
        -1.615753718733365076637e01,
        -7.500855792314704667340e01,
        -1.228866684490136173410e02,
        -6.485021904942025371773e01,
    )
    q = _polynomial(
        z,
        1.0,
        2.485846490142306297962e01,
        1.650270098316988542046e02,
        4.328810604912902668951e02,
        4.853903996359136964868e02,
        1.945506571482613964425e02,
    )
    quarters = where(steep, 0.5, where(middle, 0.25, 0.0))
    return quarters * _PI + (fma(u, z * (p / q), u) + quarters * _PI_TAIL)


@exactly(np.arctan)
def arc_tangent(x):
    """Return arctan x."""
    value = _arc(abs(x), 1.0)
    return where(x < 0.0, -value, value)


@exactly(np.arctan2)
def angle(y, x):
    """Return the angle of (x, y), between -pi and pi."""
    over, under = abs(y), abs(x)
    # Of two zeros, and of two infinities.
    zeros, corner = (over == 0.0) & (under == 0.0), (over == math.inf) & (under == math.inf)
    value = _arc(where(corner, 1.0, over), where(zeros | corner, 1.0, under))
    value = where(bits(x) < 0, _PI - (value - _PI_TAIL), value)
    value = where(bits(y) < 0, -value, value)
    return where((x == x) & (y == y), value, math.nan)


@exactly(np.arcsin)
def arc_sine(x):
    """Return arcsin x; NaN beyond 1."""
    return angle(x, sqrt((1.0 - x) * (1.0 + x)))
