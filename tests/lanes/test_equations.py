"""Jaxprs of scalars written out as functions of vectors, against JAX."""

from math import prod

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.lanes.code import LANES, Code, Module
from jaxcrusher.lanes.equations import Atom, Emitter
from jaxcrusher.lanes.expression import whole_of
from jaxcrusher.lanes.primitives import ELEMENTWISE
from jaxcrusher.lanes.verify import verified
from tests.lanes.rows import run

pytestmark = pytest.mark.usefixtures("promoting")

SPECIAL = [np.nan, np.inf, -np.inf, 0.0, -0.0, 1.0]

# Of a number of the design p, the time t and two states: every primitive of the table, each alone,
# so that a wrong one is seen.
FORMULAS = {
    "abs": lambda t, x, y, p: jnp.abs(x),
    "add": lambda t, x, y, p: x + p,
    "and": lambda t, x, y, p: jnp.where((x > 0) & (y > 0), t, p),
    "clamp": lambda t, x, y, p: jax.lax.clamp(-0.5, x, 0.5),
    "convert_element_type": lambda t, x, y, p: (x > y).astype(float) + (p > 1.5).astype(float),
    "cos": lambda t, x, y, p: jnp.cos(x) + jnp.cos(p),
    "div": lambda t, x, y, p: x / y + x / p + p / 3,
    "eq": lambda t, x, y, p: jnp.where(x == 1, t, y),
    "exp": lambda t, x, y, p: jnp.exp(x),
    "ge": lambda t, x, y, p: jnp.where(x >= 0, t, y),
    "gt": lambda t, x, y, p: (x > y).astype(float),
    "integer_pow": lambda t, x, y, p: x**3 + y**-2 + p**5 + t**16,
    "is_finite": lambda t, x, y, p: jnp.where(jnp.isfinite(x), t, y),
    "le": lambda t, x, y, p: jnp.where(x <= y, t, p),
    "log": lambda t, x, y, p: jnp.log(jnp.abs(x)),
    "lt": lambda t, x, y, p: jnp.where(p < 1.5, t, y),
    "max": lambda t, x, y, p: jnp.maximum(x, y),
    "min": lambda t, x, y, p: jnp.minimum(x, y),
    "mul": lambda t, x, y, p: x * y * p,
    "ne": lambda t, x, y, p: jnp.where(x != x, t, y),
    "neg": lambda t, x, y, p: -x,
    "not": lambda t, x, y, p: jnp.where(~(x > 0), t, y),
    "or": lambda t, x, y, p: jnp.where((x > 0) | (y > 0), t, p),
    "pow": lambda t, x, y, p: jnp.abs(x) ** p + jnp.abs(y) ** 1.5 + jnp.abs(t) ** 2.5,
    "sign": lambda t, x, y, p: jnp.sign(x),
    "sin": lambda t, x, y, p: jnp.sin(x),
    "sqrt": lambda t, x, y, p: jnp.sqrt(jnp.abs(x)),
    "square": lambda t, x, y, p: jax.lax.square(x),
    "sub": lambda t, x, y, p: x - y,
    "asin": lambda t, x, y, p: jnp.arcsin(x),
    "atan": lambda t, x, y, p: jnp.arctan(x) + jnp.arctan(p),
    "atan2": lambda t, x, y, p: jnp.arctan2(x, y) + jnp.arctan2(t, p),
    "ceil": lambda t, x, y, p: jnp.ceil(3 * x),
    "expm1": lambda t, x, y, p: jnp.expm1(x) + 1e12 * jnp.expm1(1e-13 * t),
    "floor": lambda t, x, y, p: jnp.floor(3 * x) + jnp.floor(3 * p),
    "log1p": lambda t, x, y, p: jnp.log1p(x) + 1e12 * jnp.log1p(1e-13 * t),
    "logistic": lambda t, x, y, p: jax.nn.sigmoid(x),
    "rem": lambda t, x, y, p: jnp.fmod(x, y) + jnp.mod(8 * x, p) + jnp.mod(t, 0.25),
    "round": lambda t, x, y, p: jnp.round(3 * x) + jnp.round(t, 1),
    "round away": lambda t, x, y, p: jax.lax.round(2 * jnp.round(2 * x) / 4) + jax.lax.round(p),
    "rsqrt": lambda t, x, y, p: jax.lax.rsqrt(x) + jax.lax.rsqrt(p),
    "tan": lambda t, x, y, p: jnp.tan(x),
    "tanh": lambda t, x, y, p: jnp.tanh(x) + jnp.tanh(p),
    "xor": lambda t, x, y, p: jnp.where((x > 0) ^ (y > 0), t, p),
    "whole numbers": lambda t, x, y, p: (10 * x).astype(int) * t + (10 * t).astype(int) // 3,
    "32 bits": lambda t, x, y, p: ((4e8 * x).astype(jnp.int32) * 7).astype(float),
    "truths compared": lambda t, x, y, p: ((x > 0) > (y > 0)) + 2.0 * ((x > 0) <= (y > 0)),
    "truths of numbers": lambda t, x, y, p: jnp.where(x.astype(bool), t, p),
    "largest truth": lambda t, x, y, p: jnp.maximum(x > 0, y > 0) + 2.0 * jnp.minimum(x > 0, y > 0),
    "cases": lambda t, x, y, p: jnp.select([x > 0.5, x > 0, y > 0], [t, p, x], 3.0),
    "bounds that are not finite": lambda t, x, y, p: jax.lax.clamp(x, t, y),
    "dimensions": lambda t, x, y, p: jax.lax.broadcast_in_dim(jnp.stack([x, t]), (2, 3), (0,)),
    "parts": lambda t, x, y, p: jnp.stack([x, y, t, p])[1:4:2],
    "largest": lambda t, x, y, p: jnp.stack([x, y, t]).max() + jnp.stack([p, x]).argmax(),
    "sums": lambda t, x, y, p: jnp.sum(jnp.stack([x, y, t, p]).reshape(2, 2), axis=0),
    "compensated": lambda t, x, y, p: ((t + 2.0**52) - 2.0**52) + ((p + x) - p),
    "checkpoint": lambda t, x, y, p: jax.checkpoint(jnp.sin)(x),
    "infinite base": lambda t, x, y, p: x**0.5 + y**-1.5 + x**p,
    "arrays": lambda t, x, y, p: jnp.stack([x, p * y]) * jnp.array([2.0, 3.0]),
    "jit": lambda t, x, y, p: jax.jit(lambda a: jnp.where(a > 0, a, 0) + a)(x) * jax.nn.relu(y),
    "truths": lambda t, x, y, p: jnp.where((p > 1.5) & (x > y), t, x) + jnp.where(p > 1.5, 1.0, y),
    "constants": lambda t, x, y, p: jnp.sin(jnp.asarray(0.3)) * 2 + jnp.maximum(1.0, 2.0) + 0 * x,
}


def _emitted(formula):
    """The functions of a formula of t, x, y and p, which stand in the first rows.

    What depends on p alone is computed by the first one. The number of results stands behind them.
    """
    module = Module()
    prepare, body = Code(module, "prepare"), Code(module, "body")
    function = verified(jax.make_jaxpr(formula)(*[jnp.zeros(())] * 4))
    results = sum(map(prod, function.shapes))
    emitter = Emitter(prepare, 4 + results)
    operands = [*(Atom(body.read(i)) for i in range(3)), emitter.given(3)]
    values = emitter.body(body, function, operands)
    for i, value in enumerate(values):
        body.write(value, 4 + i)
    emitter.keep()
    return module, [prepare, body], results


@pytest.fixture(scope="module")
def computed():
    """Of every formula: what is written for it, and what JAX gives."""
    random = np.random.default_rng(1)
    time, x, y = random.normal(size=(3, 4 * LANES))
    p = random.uniform(1, 2, 4 * LANES)
    pairs = [grid.ravel() for grid in np.meshgrid(SPECIAL, SPECIAL)]
    x[: len(pairs[0])], y[: len(pairs[1])] = pairs

    def every(*operands):
        return [formula(*operands) for formula in FORMULAS.values()]

    module, parts, results = _emitted(every)
    rows, found = run(module, parts, results, time, x, y, p), {}
    for name, values in zip(FORMULAS, jax.vmap(every)(time, x, y, p), strict=True):
        exact = np.asarray(values).reshape(4 * LANES, -1).T
        found[name], rows = (rows[: len(exact)], exact), rows[len(exact) :]
    return found


def test_the_formulas_cover_the_table():
    # `add_any` comes of derivatives only, `select_n` of `where`.
    assert set(ELEMENTWISE) - {"add_any", "select_n"} <= set(FORMULAS)


@pytest.mark.parametrize("name", FORMULAS)
def test_as_jax_computes(computed, name):
    # Sums are reassociated, and division by a number of the design is a product.
    np.testing.assert_allclose(*computed[name], rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("x", [2.7, -2.7, 0.0, 2.0**62, 1e300, -1e300, np.inf, -np.inf, np.nan])
def test_a_constant_becomes_the_whole_number_that_jax_makes_of_it(x):
    assert int(whole_of(x)) == int(jnp.asarray(x).astype(int))
