"""Small sparse systems, beside NumPy's dense ones."""

import itertools

import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.basics.linear import solve_constrained, solve_symmetric

# Rounding of five unknowns, times conditions of some ten.
ROUNDING = 1e-13


@pytest.mark.parametrize("absent", [(), ((1, 0),), ((1, 0), (3, 2)), ((2, 0), (3, 0), (3, 1))])
def test_positive_definite(absent):
    """Whatever entries are structurally zero, each of them above and below the diagonal."""
    chance = np.random.default_rng(1)
    root = chance.normal(size=(4, 4))
    matrix = root @ root.T + 4 * np.eye(4)
    for i, j in absent:
        matrix[i, j] = matrix[j, i] = 0.0
    right = chance.normal(size=4)
    pairs = itertools.product(range(4), range(4))
    lower = {(i, j): jnp.asarray(matrix[i, j]) for i, j in pairs if i >= j and (i, j) not in absent}
    found = solve_symmetric(lower, list(right))
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=0, atol=ROUNDING)


def test_constrained():
    """Accelerations and multipliers of three constraints on five masses."""
    chance = np.random.default_rng(2)
    masses, forces, right = chance.uniform(1, 3, 5), chance.normal(size=5), chance.normal(size=3)
    rows = chance.normal(size=(3, 5))
    rows[0, 3] = rows[1, 0] = rows[2, 1] = rows[2, 3] = 0.0
    whole = np.block([[np.diag(masses), rows.T], [rows, np.zeros((3, 3))]])
    known = np.linalg.solve(whole, np.concatenate([forces, right]))
    sparse = [{j: jnp.asarray(entry) for j, entry in enumerate(row) if entry} for row in rows]
    found = solve_constrained(list(masses), sparse, list(forces), list(right))
    np.testing.assert_allclose(np.concatenate(found), known, rtol=0, atol=ROUNDING)
