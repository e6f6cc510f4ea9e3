"""Jaxprs of scalars as numba source, against JAX."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numba import njit

from jaxcrusher.batch.lanes.emit import ELEMENTWISE, Unsupported
from jaxcrusher.batch.lanes.layout import LANES
from jaxcrusher.batch.lanes.module import load
from jaxcrusher.batch.lanes.source import Equations, exponents, source

SPECIAL = [np.nan, np.inf, -np.inf, 0.0, -0.0, 1.0]

# Of a number of the design p, the time t and two states: every primitive of the table, each alone,
# so that a wrong one is seen.
FORMULAS = {
    "abs": lambda t, x, y, p: jnp.abs(x),
    "add": lambda t, x, y, p: x + p,
    "and": lambda t, x, y, p: jnp.where((x > 0) & (y > 0), t, p),
    "clamp": lambda t, x, y, p: jax.lax.clamp(-0.5, x, 0.5),
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
    "arrays": lambda t, x, y, p: jnp.stack([x, p * y]) * jnp.array([2.0, 3.0]),
    "jit": lambda t, x, y, p: jax.jit(lambda a: jnp.where(a > 0, a, 0) + a)(x) * jax.nn.relu(y),
    "constants": lambda t, x, y, p: jnp.sin(jnp.asarray(0.3)) * 2 + jnp.maximum(1.0, 2.0) + 0 * x,
}


def _equations(formula):
    scalars = [jnp.zeros(())] * 4
    rates = jax.make_jaxpr(lambda t, x, y, p: (x, y))(*scalars)
    return Equations(rates, jax.make_jaxpr(formula)(*scalars), 2, 2, 1)


@njit
def _prepare(function, given, kept):
    function(given, kept)


@njit
def _observe(function, time, y, kept, seen):
    function(time, y, kept, seen)


@pytest.fixture(scope="module")
def computed():
    """Of every formula: what the source gives, and what JAX gives."""
    random = np.random.default_rng(1)
    time, x, y = random.normal(size=(3, 4 * LANES))
    p = random.uniform(1, 2, 4 * LANES)
    pairs = [grid.ravel() for grid in np.meshgrid(SPECIAL, SPECIAL)]
    x[: len(pairs[0])], y[: len(pairs[1])] = pairs

    def every(*operands):
        return [formula(*operands) for formula in FORMULAS.values()]

    text, sizes = source(_equations(every), {})
    module = load(text)
    kept, seen, parts = np.zeros(sizes.kept * LANES), np.zeros(sizes.observed * LANES), []
    for first in range(0, time.size, LANES):
        part = slice(first, first + LANES)
        _prepare(module.prepare, p[part].copy(), kept)
        state = np.concatenate([x[part], y[part]])
        _observe(module.observe, time[part].copy(), state, kept, seen)
        parts.append(seen.reshape(-1, LANES).copy())
    rows, found = np.concatenate(parts, axis=1), {}
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


def test_exponents_are_asked_for_and_written_in():
    def formula(t, x, y, p):
        return jnp.abs(x) ** (p + 1) * p

    equations = _equations(formula)
    assert exponents(equations) == [0]
    assert "power(" in source(equations, {})[0].replace("import", "")
    assert "power(" not in source(equations, {0: 0.5})[0]
    assert exponents(_equations(lambda t, x, y, p: p * jnp.abs(x) ** 1.5)) == []


def test_an_unknown_primitive_is_named():
    with pytest.raises(Unsupported, match="`erf`"):
        source(_equations(lambda t, x, y, p: jax.lax.erf(x)), {})
