"""Slopes by central differences, and slopes of JAX beside them."""

import jax
import jax.numpy as jnp
import numpy as np

# By the order of the error: weights of the differences over two steps, over four, and so on.
WEIGHTS = {2: (1 / 2,), 4: (2 / 3, -1 / 12)}


def differences(function, at, step, order=2):
    """Return central differences of a function by each number of `at`, along the last axis.

    `at` is a number or a row, and `step` is one for all numbers or one for each. The error falls
    with the step's power of `order`, 2 or 4.
    """
    at = jnp.asarray(at, dtype=float)  # the function gets arrays of JAX
    steps, slopes = np.broadcast_to(step, at.shape), []
    for i in np.ndindex(at.shape):
        shift, slope = np.zeros(at.shape), 0.0
        shift[i] = steps[i]
        for count, weight in enumerate(WEIGHTS[order], 1):
            ahead, behind = (np.asarray(function(at + k * shift)) for k in (count, -count))
            slope = slope + weight * (ahead - behind) / steps[i]
        slopes.append(slope)
    return np.stack(slopes, axis=-1).reshape(np.shape(slopes[0]) + at.shape)


def assert_slopes(function, at, step, *, rtol, atol=0.0, order=2, by=jax.jacrev):
    """Check a function's slopes, `by` JAX, against its differences, and return them.

    Slopes that are no numbers fail, and so do those of a function that nothing moves.
    """
    found = np.asarray(by(function)(np.asarray(at, dtype=float)))
    expected = differences(function, at, step, order)
    assert np.any(expected)
    close = dict(rtol=rtol, atol=atol, equal_nan=False)
    np.testing.assert_allclose(found, expected, strict=True, **close)
    return found
