"""Reductions over the instants of a segment, against JAX."""

import ctypes
from math import prod

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.lanes.code import CORES, LANES, Module
from jaxcrusher.lanes.equations import write_summary
from jaxcrusher.lanes.layout import layout
from jaxcrusher.lanes.machine import load
from jaxcrusher.lanes.verify import Unsupported, verified
from jaxcrusher.mechanism.reductions import top

pytestmark = pytest.mark.usefixtures("promoting")

# Of a series x, one of pairs y, and the state z at the end.
REDUCTIONS = {
    "max": lambda x, y, z: jnp.max(x),
    "min": lambda x, y, z: jnp.min(x),
    "mean": lambda x, y, z: jnp.mean(x * z),
    "argmax": lambda x, y, z: jnp.argmax(x).astype(float),
    "at the largest": lambda x, y, z: x[jnp.argmax(y[:, 1])],
    "top": lambda x, y, z: top(x),
    "share": lambda x, y, z: jnp.mean(jnp.heaviside(x, 0.0)),
    "numbers alone": lambda x, y, z: jnp.max(x + (jnp.log(jnp.zeros(())) < jnp.round(2.5))),
    "count": lambda x, y, z: jnp.sum(x > 0).astype(float),
    "share of whole numbers": lambda x, y, z: jnp.sum((9 * x).astype(int) % 4) / 7,
    "one of the pair": lambda x, y, z: (y[:, ::2].max(0) + y[:, 1:].min(0))[0],
    "beyond the last": lambda x, y, z: x[(100 * z).astype(int)] + y[:, 1][(-100 * z).astype(int)],
    "last": lambda x, y, z: y[-1],
    "number": lambda x, y, z: jnp.sqrt(z) + 1,
    "series": lambda x, y, z: x + z,
    "pairs": lambda x, y, z: y,
}


def _summarised(function, x, y, z):
    """By the compiled function of a page."""
    count, module = len(x), Module()
    jaxpr = jax.make_jaxpr(function)(x, y, z)
    results = verified(jaxpr, 2, count)
    numbers = sum(map(prod, results.shapes))
    at = layout(CORES, 0, states=1, numbers=0, sampled=0, observed=3, instants=count, found=numbers)
    _, over = write_summary(module, results, [(), (2,)], at)
    memory = np.full((at.page, LANES), np.nan)
    for i, series in enumerate((x, *y.T)):
        memory[i * at.series : (i + 1) * at.series].ravel()[:count] = series
    memory[at.last] = z
    kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64)
    kind(load(str(module))["summarise"])(memory.ctypes.data, 0, 0)
    found, parts = memory[at.summary :].ravel(), []
    for is_over, variable in zip(over, jaxpr.jaxpr.outvars, strict=True):
        shape = variable.aval.shape
        part, found = found[: int(np.prod(shape))], found[int(np.prod(shape)) :]
        last = part.reshape(*shape[1:], *shape[:1]) if is_over else part.reshape(shape)
        parts.append(np.moveaxis(last, -1, 0) if is_over else last)
    return parts


def _every(x, y, z):
    return [reduction(x, y, z) for reduction in REDUCTIONS.values()]


# As many as fill all lanes, fewer, and some over.
@pytest.mark.parametrize("count", [3, LANES, 2 * LANES + 5])
def test_as_jax_reduces(count):
    random = np.random.default_rng(count)
    y, z = random.normal(size=(count, 2)), 2.5
    for x in (
        random.normal(size=count),
        np.round(random.normal(size=count)),  # equal ones: the first counts
        np.where(np.arange(count) == 1, np.nan, random.normal(size=count)),
        np.full(count, -np.inf),
    ):
        exact = jax.jit(_every)(x, y, z)
        for name, ours, theirs in zip(REDUCTIONS, _summarised(_every, x, y, z), exact, strict=True):
            # Sums are added up in another order.
            np.testing.assert_allclose(ours, theirs, rtol=1e-14, atol=1e-14, err_msg=name)


def test_a_part_of_the_instants_is_left_to_others():
    with pytest.raises(Unsupported, match="a part of the instants"):
        _summarised(lambda x, y, z: jnp.max(x[1:]), np.ones(5), np.ones((5, 2)), 1.0)
