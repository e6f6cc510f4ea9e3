"""What lanes refuse, by name, before anything is written."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.lanes.verify import Unsupported, verified

pytestmark = pytest.mark.usefixtures("promoting")

ONES, SINGLE = jnp.ones(3), jnp.ones(2, jnp.float32)
REFUSED = {
    "the type `float32` of `convert_element_type`": lambda x, n: x.astype(jnp.float32) * 1.0,
    "the type `int8` of `convert_element_type`": lambda x, n: x * n.astype(jnp.int8),
    "the type `uint32` of `convert_element_type`": lambda x, n: x * n.astype(jnp.uint32),
    "the type `complex128` of `convert_element_type`": lambda x, n: jnp.abs(x + 1j),
    "the type `bool` of a result": lambda x, n: x > 0,
    "the type `int64` of a result": lambda x, n: n + 1,
    "the type `float32` of an operand": lambda x, n: x * SINGLE.astype(float),
    "the primitive `erf`": lambda x, n: jax.lax.erf(x),
    "the primitive `reduce_precision`": lambda x, n: jax.lax.reduce_precision(x, 8, 7),
    "the primitive `cumsum`": lambda x, n: jnp.cumsum(jnp.stack([x, x])),
    "the primitive `cond`": lambda x, n: jax.lax.cond(x > 0, jnp.sin, jnp.cos, x),
    "the primitive `while`": lambda x, n: jax.lax.while_loop(lambda a: a > 1, lambda a: a / 2, x),
    "the primitive `scan`": lambda x, n: jax.lax.scan(lambda a, b: (a * x + b, None), x, ONES)[0],
    "the primitive `reduce_or` of the type `int64`": lambda x, n: (
        x * jax.lax.reduce_or(jnp.stack([n, n]), axes=(0,))
    ),
    # The transpose of an array, row by row.
    "the option `dimensions` of the primitive `reshape`": lambda x, n: jax.lax.reshape(
        x * jnp.ones((2, 3)), (6,), (1, 0)
    )[1],
    "the primitive `shift_left`": lambda x, n: x * (n << 2),
    "the primitive `debug_callback`": lambda x, n: jax.debug.callback(print, x) or x,
    # Of calls inside of calls too.
    "the primitive `erfc`": lambda x, n: jax.jit(lambda a: jax.checkpoint(jax.lax.erfc)(a))(x),
}


@pytest.mark.parametrize("why", REFUSED)
def test_refused_by_name(why):
    jaxpr = jax.make_jaxpr(REFUSED[why])(jnp.zeros(()), jnp.zeros((), int))
    with pytest.raises(Unsupported) as found:
        verified(jaxpr)
    assert str(found.value) == why


def _of_series(function):
    return verified(jax.make_jaxpr(function)(jnp.zeros(5), jnp.zeros((5, 2)), 1.0), 2, 5)


@pytest.mark.parametrize(
    "why, function",
    [
        # Taken for one number of each instant, it would be a series of arrays.
        ("`mul` of series and other arrays", lambda x, y, z: jnp.sum(x * np.arange(5.0))),
        ("`broadcast_in_dim` of series", lambda x, y, z: jnp.sum(x[:, None] * y)),
        ("`transpose`", lambda x, y, z: y.T[0]),
        ("`reduce_max` of series", lambda x, y, z: jnp.max(y, axis=1)),
        ("`reduce_max` of the type `int64`", lambda x, y, z: 1.0 * jnp.max(x.astype(int))),
        ("a part of the instants", lambda x, y, z: x[::2].sum()),
        ("a part of the instants", lambda x, y, z: jax.lax.dynamic_slice(x, [1], [2]).sum()),
        ("the type `int64` of a result", lambda x, y, z: jnp.argmax(x)),
    ],
)
def test_refused_over_the_instants(why, function):
    with pytest.raises(Unsupported, match=why):
        _of_series(function)


def test_results_of_another_shape_are_refused():
    # Their rows would stand where others do.
    jaxpr = jax.make_jaxpr(lambda x: jnp.stack([x, x]))(0.0)
    assert verified(jaxpr).shapes == [(2,)]
    with pytest.raises(Unsupported, match=r"results of the shapes \[\(2,\)\] in place of \[\(\)\]"):
        verified(jaxpr, shapes=[()])
