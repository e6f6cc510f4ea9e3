"""Sine, cosine, exponential, logarithm and power without branches or calls.

A loop that calls a mathematical library is not vectorised; these functions are inlined and become
vector instructions. Each is right to 2 ulp. They are compiled without `fastmath`: the compensated
sums would be simplified away.
"""

import math

from numba import njit

from jaxcrusher.batch.lanes.instructions import WITHIN, bits, double

# Said outright: numba would hand on the `fastmath` of a caller.
inlined = njit(error_model="numpy", forceinline=True, fastmath=False, **WITHIN)


# Added to a whole number below 2^51, it puts that number into the lowest bits.
_MAGIC = 6755399441055744.0  # 1.5 * 2^52
_TWO_52_BITS, _TWO_52 = 0x4330000000000000, 4503599627370496.0
_SPLIT = 134217729.0  # 2^27 + 1


@inlined
def _product(a, b):
    """A b as an unevaluated sum (Dekker 1971)."""
    scaled = _SPLIT * a
    a1 = scaled - (scaled - a)
    a2 = a - a1
    scaled = _SPLIT * b
    b1 = scaled - (scaled - b)
    b2 = b - b1
    high = a * b
    return high, ((a1 * b1 - high) + a1 * b2 + a2 * b1) + a2 * b2


@inlined
def _sum(a, b):
    """A + b as an unevaluated sum (Knuth)."""
    high = a + b
    part = high - a
    return high, (a - (high - part)) + (b - part)


# Beyond this the sine and the cosine are NaN: 1.7e8 turns.
LARGEST_ANGLE = 2.0**30
# pi / 2 in pieces of 23 bits, whose products with a quotient below 2^30 are exact, and the rest.
_HALF_PI = (
    1.570796251296997,
    7.549789415861596e-08,
    5.390302529957765e-15,
    3.2820031633724233e-22,
    3.7950107727212256e-29,
)


@inlined
def _reduced(x):
    """X less whole quarter turns, as a number of at most pi / 4 and its tail; the quarter."""
    quotient = x * 0.6366197723675814 + _MAGIC - _MAGIC
    rest = x - quotient * _HALF_PI[0]
    rest, tail2 = _sum(rest, -quotient * _HALF_PI[1])
    rest, tail3 = _sum(rest, -quotient * _HALF_PI[2])
    rest, tail4 = _sum(rest, -quotient * _HALF_PI[3])
    tail = (tail2 + tail3 + tail4) - quotient * _HALF_PI[4]
    high = rest + tail
    tail = tail + (rest - high)
    high = high if abs(x) <= LARGEST_ANGLE else math.nan
    return high, tail, bits(quotient + _MAGIC)


@inlined
def _sine_near_zero(r, tail):
    z = r * r
    p = 1.58969099521155010221e-10
    p = z * p - 2.50507602534068634195e-08
    p = z * p + 2.75573137070700676789e-06
    p = z * p - 1.98412698298579493134e-04
    p = z * p + 8.33333333332248946124e-03
    p = z * p - 1.66666666666666324348e-01
    return r + (tail + r * z * p)


@inlined
def _cosine_near_zero(r, tail):
    z = r * r
    p = -1.13596475577881948265e-11
    p = z * p + 2.08757232129817482790e-09
    p = z * p - 2.75573143513906633035e-07
    p = z * p + 2.48015872894767294178e-05
    p = z * p - 1.38888888888741095749e-03
    p = z * p + 4.16666666666666019037e-02
    half = 0.5 * z
    top = 1.0 - half
    return top + (((1.0 - top) - half) + (z * z * p - r * tail))


@inlined
def sine(x):
    """Sin x; the minimax polynomials are those of fdlibm, on a quarter turn."""
    r, tail, quarter = _reduced(x)
    s, c = _sine_near_zero(r, tail), _cosine_near_zero(r, tail)
    value = s if quarter & 1 == 0 else c
    return value if quarter & 2 == 0 else -value


@inlined
def cosine(x):
    """Cos x, as `sine`."""
    r, tail, quarter = _reduced(x)
    s, c = _sine_near_zero(r, tail), _cosine_near_zero(r, tail)
    value = c if quarter & 1 == 0 else s
    return value if (quarter + 1) & 2 == 0 else -value


# ln 2, its first part of 40 bits, so that products with exponents are exact.
_LN2, _LN2_TAIL = 0.6931471805592082, 7.371002565167799e-13


@inlined
def _scaled(value, exponent):
    """Value 2^exponent for a whole `exponent` in [-2000, 2000], in two steps that stay in range."""
    first = exponent * 0.5 + _MAGIC - _MAGIC
    for part in (first, exponent - first):
        value = value * double((bits(part + (_MAGIC + 1023.0)) & 0xFFF) << 52)
    return value


@inlined
def _exponential(x, tail):
    """exp(x + tail) for a tail of at most an ulp of x."""
    clipped = -1000.0 if x < -1000.0 else (1000.0 if x > 1000.0 else x)
    exponent = clipped * 1.4426950408889634 + _MAGIC - _MAGIC
    r = clipped - exponent * _LN2
    r, rest = _sum(r, tail - exponent * _LN2_TAIL)
    p = 1.6059043836821613e-10  # 1 / 13!, and so on
    p = r * p + 2.08767569878681e-09
    p = r * p + 2.505210838544172e-08
    p = r * p + 2.755731922398589e-07
    p = r * p + 2.7557319223985893e-06
    p = r * p + 2.48015873015873e-05
    p = r * p + 1.984126984126984e-04
    p = r * p + 1.388888888888889e-03
    p = r * p + 8.333333333333333e-03
    p = r * p + 4.1666666666666664e-02
    p = r * p + 1.6666666666666666e-01
    p = r * p + 0.5
    value = _scaled(1.0 + (r + (r * r * p + (rest + rest * r))), exponent)
    return value if x == x else x


@inlined
def exponential(x):
    """Exp x."""
    return _exponential(x, 0.0)


@inlined
def _parts(x):
    """X > 0 as a whole exponent of 2 and a factor between sqrt(1/2) and sqrt(2)."""
    small = x < 2.2250738585072014e-308
    whole = bits(x * 18014398509481984.0 if small else x)  # 2^54
    # The bits of sqrt(1/2): what is above counts to the next power of 2.
    shifted = whole - 0x3FE6A09E667F3BCD
    biased = (shifted >> 52) + 2048
    exponent = double(biased | _TWO_52_BITS) - (_TWO_52 + 2048.0)
    factor = double(whole - ((biased - 2048) << 52))
    return exponent - (54.0 if small else 0.0), factor


@inlined
def _logarithm(x):
    """Ln x as an unevaluated sum, for finite x > 0."""
    exponent, factor = _parts(x)
    # ln m = 2 artanh s, s = (m - 1) / (m + 1).
    over, under = factor - 1.0, factor + 1.0
    s = over / under
    product, error = _product(s, under)
    under_tail = factor - (under - 1.0)
    s_tail = ((over - product) - error - s * under_tail) / under
    z, z_tail = _product(s, s)
    z_tail = z_tail + 2.0 * s * s_tail
    third, third_tail = 0.3333333333333333, 1.850371707708594e-17
    cube, cube_tail = _product(z, third)
    cube_tail = cube_tail + z_tail * third + z * third_tail
    q = 1.0 / 23.0
    q = z * q + 1.0 / 21.0
    q = z * q + 1.0 / 19.0
    q = z * q + 1.0 / 17.0
    q = z * q + 1.0 / 15.0
    q = z * q + 1.0 / 13.0
    q = z * q + 1.0 / 11.0
    q = z * q + 1.0 / 9.0
    q = z * q + 1.0 / 7.0
    q = z * q + 0.2
    cube, more = _sum(cube, z * z * q)
    cube_tail = cube_tail + more
    # 2 s (1 + cube)
    added, added_tail = _product(s, cube)
    added_tail = added_tail + s * cube_tail + s_tail * cube
    high, tail = _sum(s, added)
    high, tail = 2.0 * high, 2.0 * (tail + added_tail + s_tail)
    whole, whole_tail = _sum(exponent * _LN2, exponent * _LN2_TAIL)
    total, rest = _sum(whole, high)
    return _sum(total, rest + (whole_tail + tail))


@inlined
def logarithm(x):
    """Ln x; minus infinity at zero, NaN below."""
    high, tail = _logarithm(x)
    value = high + tail
    value = value if x < math.inf else x
    value = value if x > 0.0 else (-math.inf if x == 0.0 else math.nan)
    return value


@inlined
def power(x, y):
    """x^y; NaN for x < 0 unless y is whole."""
    size = abs(x)
    base = size if size > 0.0 and size < math.inf else 1.0
    high, tail = _logarithm(base)
    bounded = max(min(y, 1e300), -1e300)
    product, error = _product(high, bounded)
    # Where the result is zero or infinite the error's terms are not finite.
    near = abs(product) < 1400.0
    value = _exponential(product, error + tail * bounded if near else 0.0)
    at_zero, at_infinity = (0.0, math.inf) if y > 0.0 else (math.inf, 0.0)
    value = value if size > 0.0 else at_zero
    value = value if size < math.inf else at_infinity
    odd = math.floor(y) == y and math.floor(0.5 * y) != 0.5 * y
    value = math.copysign(value, x) if odd else value
    value = value if not (x < 0.0) or math.floor(y) == y else math.nan
    value = value if x == x and y == y else math.nan
    return value if not (x == 1.0 or y == 0.0) else 1.0
