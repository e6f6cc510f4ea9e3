"""Functions that are compared by what they compute."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.basics.traced import traced

FACTOR = 2.0


def scaled(x):
    return {"scaled": FACTOR * jnp.sin(x), "name": "scaled"}


def key(function, *operands):
    return jax.tree.structure(traced(function, *(operands or (jnp.ones(3),))))


def test_a_program_is_compiled_again_only_for_another_trace(monkeypatch):
    seen = []

    @eqx.filter_jit
    def run(function, x):
        seen.append(FACTOR)
        return function(x)["scaled"]

    x = jnp.arange(3.0)
    for factor in (2.0, 2.0, 3.0, 2.0):
        monkeypatch.setitem(globals(), "FACTOR", factor)
        # The same bits: both are one product of the same doubles.
        np.testing.assert_array_equal(run(traced(scaled, x), x), factor * jnp.sin(x))
    # The third program is the first one again.
    assert seen == [2.0, 3.0]


def test_what_tells_traces_apart():
    # Not who the function is, but each number and its type, wherever it stands.
    assert key(lambda x: 2.0 * x) == key(lambda y: 2.0 * y)
    different = [
        lambda x: 2.0 * x,
        lambda x: x * 2.0,
        lambda x: 3.0 * x,
        lambda x: 2.0 * x + 0.0,
        lambda x: 2.0 * x + -0.0,
        lambda x: jax.jit(lambda y: 2.0 * y)(x),
        lambda x: jax.jit(lambda y: 3.0 * y)(x),
        lambda x: x * np.array([1.0, 2.0, 3.0]),
        lambda x: x * np.array([1.0, 2.0, 4.0]),
        lambda x: jax.lax.cond(x[0] > 0, lambda: x * np.full(3, 5.0), lambda: x),
        lambda x: jax.lax.cond(x[0] > 0, lambda: x * np.full(3, 6.0), lambda: x),
        lambda x: (x, True),
        lambda x: (x, 1),
        lambda x: (x, 1.0),
        lambda x: [x, 1.0],
    ]
    assert len({key(function) for function in different}) == len(different)
    assert key(lambda x: 2 * x) != key(lambda x: 2 * x, jnp.ones(4))


def test_arrays_of_a_partial_are_numbers():
    """They may change without another program, and the latest ones are taken."""

    @eqx.filter_jit
    def run(function, x):
        return function(x)

    def product(x, by):
        return by * x

    x = jnp.arange(3.0)
    one, other = (traced(eqx.Partial(product, by=jnp.array(by)), x) for by in (2.0, 3.0))
    assert jax.tree.structure(one) == jax.tree.structure(other)
    np.testing.assert_array_equal(run(one, x), 2 * x)
    np.testing.assert_array_equal(run(other, x), 3 * x)


def test_an_error_of_the_function_is_its_own():
    with pytest.raises(KeyError, match="nothing"):
        traced(lambda x: {}["nothing"], jnp.ones(3))
