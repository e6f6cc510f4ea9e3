"""Slopes of long-time means by shadowing: precise, and wrong wherever a motion's measure tears.

Non-intrusive least squares shadowing (Ni and Wang, J. Comput. Phys. 347, 2017) looks for the one
tangent that stays small: the motion at a changed parameter that follows the same history. The
mean along that motion is not the mean of the changed system, whose histories come with other
weights (the unstable contribution: Ni, SIAM J. Numer. Anal. 59, 2021). For the skew tent map of
peak c the mean of x does not depend on c, and shadowing gives 1 / (4 (1 - c)) with any precision.
So this is an estimate to compare with, never one to use. Nor is it of use as a control variate,
to reduce a fit's variance: the two runs of a pair part ways, and their difference has no
correlation with the shadowing slope of the run between them (Lorenz, 60 pairs of 5 to 50 time
units at radii of 0.05 to 2: |correlation| < 0.23, below the 0.26 that chance exceeds one time in
twenty).
"""

import numpy as np
import scipy.linalg
from jaxtyping import ArrayLike, Float


def shadowing_slopes(
    jacobians: Float[ArrayLike, "steps dims dims"],
    forcing: Float[ArrayLike, "steps dims n"],
    by_state: Float[ArrayLike, "steps dims"],
    by_parameter: Float[ArrayLike, "steps n"],
    *,
    unstable: int | None = None,
    batches: int = 20,
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Shadowing slopes of a mean over the steps of a map, and standard errors by batch means.

    **Arguments:**

    - `jacobians`, `forcing`: derivatives of each step's end by its beginning, J, and by the
      parameters, f.
    - `by_state`, `by_parameter`: those of what is averaged, at the beginning of each step.
    - `unstable`: how many directions to hold down, at least those that grow; None for all.

    A tenth of the steps at either end, where the history says least, is left out of the mean.
    The errors are those of the mean along the shadowing motion: they know nothing of its bias.
    """
    steps, forced = np.asarray(jacobians, dtype=float), np.asarray(forcing, dtype=float)
    slopes = np.einsum("kd,kdn->kn", by_state, shadowing_tangent(steps, forced, unstable))
    slopes = slopes + np.asarray(by_parameter, dtype=float)
    end = len(slopes) // 10
    kept = slopes[end : len(slopes) - end]
    batches = min(batches, len(kept))
    means = np.stack([part.mean(axis=0) for part in np.array_split(kept, batches)])
    scatter = means.std(axis=0, ddof=1) if batches > 1 else np.full(means.shape[1], np.inf)
    return kept.mean(axis=0), scatter / np.sqrt(batches)


def shadowing_tangent(
    jacobians: Float[np.ndarray, "steps dims dims"],
    forcing: Float[np.ndarray, "steps dims n"],
    unstable: int | None = None,
) -> Float[np.ndarray, "steps dims n"]:
    """The tangent v' = J v + f of least sum |v|^2, at the beginning of each step.

    v = u + Q a: u is the forced tangent without its part along the columns of Q, which span the
    directions that grow and are orthonormal after every step: J Q = Q' R. Then a' = R a + Q'^T (J
    u + f), and since u is normal to Q, least |v|^2 means least |a|^2: with B a = b for these
    equations a = B^T (B B^T)^-1 b: Ni and Wang's
    least squares with segments of one step.
    """
    steps, dims, n = forcing.shape
    count = dims if unstable is None else unstable
    frames, rests = np.empty((steps, dims, count)), np.empty((steps, dims, n))
    upper, load = np.empty((steps, count, count)), np.empty((steps, count, n))
    frame, rest = np.eye(dims)[:, :count], np.zeros((dims, n))
    for k in range(steps):
        frames[k], rests[k] = frame, rest
        frame, upper[k] = np.linalg.qr(jacobians[k] @ frame)
        rest = jacobians[k] @ rest + forcing[k]
        load[k] = frame.T @ rest
        rest = rest - frame @ load[k]
    return rests + frames @ _least(upper, load)[:-1]


def _least(upper: np.ndarray, load: np.ndarray) -> np.ndarray:
    """The least a, shape (steps + 1, count, n), with a[k + 1] - upper[k] a[k] = load[k]."""
    steps, count, n = load.shape
    # B B^T is block tridiagonal: I + R R^T, and -R of the next step below it.
    band = np.zeros((2 * count, steps * count))
    for k in range(steps):
        block = np.eye(count) + upper[k] @ upper[k].T
        for row in range(count):
            for column in range(row + 1):
                band[row - column, k * count + column] = block[row, column]
            if k + 1 < steps:
                for column in range(count):
                    band[count + row - column, k * count + column] = -upper[k + 1][row, column]
    multipliers = scipy.linalg.solveh_banded(band, load.reshape(-1, n), lower=True)
    multipliers = multipliers.reshape(steps, count, n)
    least = np.zeros((steps + 1, count, n))
    least[1:] += multipliers
    least[:-1] -= np.einsum("kij,kin->kjn", upper, multipliers)
    return least
