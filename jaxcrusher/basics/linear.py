"""Small sparse linear systems, unrolled while tracing: an entry that is absent costs nothing.

`jnp.linalg.solve` would call LAPACK, and a custom call keeps XLA from compiling a whole
integration loop to one kernel.
"""

from jaxtyping import Scalar

from jaxcrusher.basics.plane import plus

# Column -> entry; a column that is not there is structurally zero.
SparseRow = dict[int, Scalar]


def solve_symmetric(lower: dict[tuple[int, int], Scalar], right: list) -> list[Scalar]:
    """Solve A x = right for a symmetric A by A = L D L^T, without exchanging rows.

    A is positive definite, or [M, R^T; R, 0] with such an M and independent rows R. `lower` holds
    A[i, j] for i >= j, where it is not structurally zero.
    """
    size = len(right)
    factor: dict[tuple[int, int], Scalar] = {}
    diagonal: list[Scalar] = []
    for j in range(size):
        for i in range(j, size):
            entry = lower.get((i, j))
            for k in range(j):
                if (i, k) in factor and (j, k) in factor:
                    entry = plus(entry, -factor[i, k] * factor[j, k] * diagonal[k])
            if i == j:
                assert entry is not None, "all pivots are there"
                diagonal.append(entry)
            elif entry is not None:
                factor[i, j] = entry / diagonal[j]
    x = list(right)
    for i in range(size):
        for k in range(i):
            if (i, k) in factor:
                x[i] = x[i] - factor[i, k] * x[k]
    x = [value / pivot for value, pivot in zip(x, diagonal, strict=True)]
    for i in reversed(range(size)):
        for k in range(i + 1, size):
            if (k, i) in factor:
                x[i] = x[i] - factor[k, i] * x[k]
    return x


def solve_dominant(rows: list[list[Scalar]], right: list[Scalar]) -> list[Scalar]:
    """Solve A x = right by elimination without exchanging rows, for an A near the unit matrix."""
    rows, x = [list(row) for row in rows], list(right)
    size = len(x)
    for k in range(size):
        for i in range(k + 1, size):
            factor = rows[i][k] / rows[k][k]
            rows[i] = [a - factor * b for a, b in zip(rows[i], rows[k], strict=True)]
            x[i] = x[i] - factor * x[k]
    for i in reversed(range(size)):
        for k in range(i + 1, size):
            x[i] = x[i] - rows[i][k] * x[k]
        x[i] = x[i] / rows[i][i]
    return x


def solve_constrained(
    masses: list, rows: list[SparseRow], forces: list, right: list
) -> tuple[list[Scalar], list[Scalar]]:
    """Solve [M, Phi^T; Phi, 0] (a, lambda) = (forces, right) for a diagonal M (paper, (20)).

    Returns the accelerations a and the multipliers lambda.
    """
    lower = {}
    for i, row in enumerate(rows):
        for j, other in enumerate(rows[: i + 1]):
            entry = None
            for column in row.keys() & other.keys():
                entry = plus(entry, row[column] * other[column] / masses[column])
            if entry is not None:
                lower[i, j] = entry
    free = [force / mass for force, mass in zip(forces, masses, strict=True)]
    reduced = [
        sum(entry * free[column] for column, entry in row.items()) - value
        for row, value in zip(rows, right, strict=True)
    ]
    multipliers = solve_symmetric(lower, reduced)
    accelerations = list(free)
    for row, multiplier in zip(rows, multipliers, strict=True):
        for column, entry in row.items():
            accelerations[column] = accelerations[column] - entry * multiplier / masses[column]
    return accelerations, multipliers
