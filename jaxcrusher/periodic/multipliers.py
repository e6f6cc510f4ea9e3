"""Floquet multipliers: the factors by which small disturbances of an orbit grow in one period.

They are the eigenvalues of the monodromy matrix, which the variational equations along the orbit
give. These are linear and solved by Magnus' expansion of sixth order with Gauss points (Blanes,
Casas, Ros, BIT 40, 2000). A swing much faster than the drive does not shorten its steps as it does
those of a quadrature. Two numbers of steps tell the error.
"""

import math
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Complex, Float, Scalar

from jaxcrusher.basics.loops import on_a_gpu
from jaxcrusher.basics.record import Printed
from jaxcrusher.periodic.system import System
from jaxcrusher.periodic.trigonometric import resample

# Instants a period at which the equations are linearised; a trigonometric polynomial joins them.
LOOKS = 256
# Steps a period.
STEPS = 1024
# Where an error is larger, so many steps are taken instead, one number after the other: a contact
# that damps itself to rest within a step, and a frame on stiff springs, need them. In the paper's
# box the error is at most 2.4e-7.
UNSURE, MORE_STEPS = 1e-6, (8 * STEPS, 64 * STEPS)
# Of Gauss' outer points of an interval from its middle, in intervals.
GAUSS = math.sqrt(0.15)


class Multipliers(Printed):
    """Multipliers of an orbit over its period, and their monodromy matrix."""

    values: Complex[Array, " twodims"]
    monodromy: Float[Array, "twodims twodims"]  # d(x, x') at the end / at the beginning
    # of the steps, estimated, as `matrix_error` measures it; infinite: unknown
    error: Scalar
    # (x, x') at the end less that at the beginning, of a motion that begins on the orbit's nodes
    closure: Float[Array, " twodims"]

    @property
    def largest(self) -> Scalar:
        """Return the largest modulus: below 1 the orbit is stable."""
        return largest(self.values)


@eqx.filter_jit
def multipliers(system: System, x: Float[Array, "nodes dims"], steps: int = STEPS) -> Multipliers:
    """Return the multipliers of the orbit through `x`, with `steps` (a power of two) a period.

    Pure JAX, without slopes; NaN where the orbit is.
    """
    system, x = jax.lax.stop_gradient((system, x))
    return of_slopes(_looked(system, x), system.period, steps)


def monodromy(
    system: System, x: Float[Array, "nodes dims"], steps: int = STEPS
) -> Float[Array, "twodims twodims"]:
    """Return the matrix of the multipliers, with slopes by the system's numbers and the nodes."""
    return of_slopes(_looked(system, x), system.period, steps).monodromy


def _looked(system: System, x: Float[Array, "nodes dims"]) -> tuple[Array, ...]:
    """Return df/dx and df/dx' at equally spaced instants of the period."""
    return system.slopes(*system.at(x, max(LOOKS, len(x))))[0]


def of_slopes(
    slopes: tuple[Float[Array, "n dims dims"], ...], period: Scalar, steps: int = STEPS
) -> Multipliers:
    """Return the multipliers from df/dx and df/dx' at equally spaced instants of the period."""
    coarse, fine = (once_round(slopes, period, count) for count in (steps // 2, steps))
    return of_matrices(coarse, fine, jnp.zeros(len(fine)))


def of_matrices(
    coarse: Float[Array, "n n"], fine: Float[Array, "n n"], closure: Float[Array, " n"]
) -> Multipliers:
    """Return the multipliers of the monodromy matrix `fine`; `coarse` has half as many steps."""
    # Twice the steps leave a 64th of the error.
    left = (fine - coarse) / 63
    values = eigenvalues(fine, jnp.all(jnp.isfinite(left)))
    return Multipliers(values, fine, matrix_error(fine, left), closure)


def eigenvalues(matrix: Float[Array, "n n"], good: Bool[ArrayLike, ""]) -> Complex[Array, " n"]:
    """Return the eigenvalues; NaN unless the matrix is `good`, for LAPACK needs finite numbers."""
    return jnp.where(good, jnp.linalg.eigvals(jnp.where(good, matrix, 0.0)), jnp.nan)


def difference(coarse: Float[Array, "n n"], fine: Float[Array, "n n"]) -> Scalar:
    """Return by what two monodromy matrices differ, as a share of the largest entry of `fine`.

    Where this entry is below 1 the difference itself is returned. Where a contact leaves 1e-60 of a
    disturbance, for example, no digit is known, and none is needed.
    """
    return jnp.max(jnp.abs(fine - coarse)) / jnp.maximum(jnp.max(jnp.abs(fine)), 1.0)


def matrix_error(matrix: Float[Array, "n n"], left: Float[Array, "n n"]) -> Scalar:
    """Return the error of a monodromy matrix that may be off by `left`; infinite: unknown.

    It is the error of the matrix, by `difference`, or of its multipliers, by `spread`, whichever is
    larger. The size of an error is known better than its sign: where two multipliers almost
    coincide, one sign may part their moduli where the other one does not.
    """
    good = jnp.all(jnp.isfinite(left))
    values, above, below = (eigenvalues(m, good) for m in (matrix, matrix + left, matrix - left))
    apart = jnp.maximum(spread(values, above), spread(values, below))
    error = jnp.maximum(difference(matrix + left, matrix), apart)
    # Where steps overflow nothing is known.
    return jnp.where(jnp.isnan(error), jnp.inf, error)


def spread(one: Complex[Array, " n"], other: Complex[Array, " n"]) -> Scalar:
    """Return by how much the moduli of two sets of multipliers differ at most.

    For moduli larger than 1 it is relative. Stability depends on moduli alone. Two values that
    almost coincide move by the root of the matrix's change, but the modulus of a complex pair is
    the root of its product, which moves as the matrix does.
    """
    sizes, others = jnp.sort(jnp.abs(one)), jnp.sort(jnp.abs(other))
    return jnp.max(jnp.abs(sizes - others) / jnp.maximum(sizes, 1.0))


@jax.jit  # one by one its operations take longer than a look at an orbit should
def undecided(
    values: Complex[Array, "*batch n"], error: Float[Array, "*batch"]
) -> Bool[Array, "*batch"]:
    """Return whether multipliers whose moduli have an error leave open if disturbances die."""
    return ~(jnp.abs(largest(values) - 1) > error)


@jax.jit  # likewise
def largest(values: Complex[Array, "*batch n"]) -> Float[Array, "*batch"]:
    """Return the largest modulus of multipliers, zero of none."""
    return jnp.max(jnp.abs(values), axis=-1, initial=0.0)


def _driven_step(
    gauss: tuple[Array, ...], pushes: Float[Array, "m pushes"], halvings: int
) -> Array:
    """Return the matrix of a step that drives too, of a disturbance with ones behind it."""
    step, (size, count) = _step(*gauss, halvings=halvings), pushes.shape
    return jnp.block([[step, step @ pushes], [jnp.zeros((count, size)), jnp.eye(count)]])


def fundamental(
    slopes: tuple[Float[Array, "n dims dims"], ...],
    period: Scalar,
    steps: int = STEPS,
    pushes: Float[Array, "n dims pushes"] | None = None,
) -> tuple[Float[Array, "steps twodims columns"], Float[Array, "twodims columns"]]:
    """Return the derivatives of (x, x') by their initial values, at each step's start and the end.

    They follow from df/dx and df/dx', as in `of_slopes`. Further columns are the motions from zero
    that accelerations `pushes` at equally spaced instants drive. Their sum has the error of the
    rectangle rule, which vanishes fast for what is periodic.
    """
    step, looks, scale = _driven(slopes, period, steps, pushes)
    size, columns = scale.shape
    still = jnp.eye(size, columns)
    if on_a_gpu():
        matrices = jax.vmap(step)(*looks)
        after = jax.lax.associative_scan(lambda one, other: other @ one, matrices)[:, :size]
        return jnp.concatenate([still[None], after[:-1]]) / scale[None], after[-1] / scale

    # Step by step: XLA makes one kernel of the loop. Of all steps side by side it computes each
    # product again for every entry of the next.
    def pass_on(passed: Array, now: tuple) -> tuple[Array, Array]:
        gauss, push = now
        return _step(*gauss, halvings=_halvings(steps)) @ passed.at[:, size:].add(push), passed

    last, before = jax.lax.scan(pass_on, still, looks)
    return before / scale[None], last / scale


def once_round(
    slopes: tuple[Float[Array, "n dims dims"], ...],
    period: Scalar,
    steps: int,
    pushes: Float[Array, "n dims pushes"] | None = None,
) -> Float[Array, "twodims columns"]:
    """Return the last of what `fundamental` returns."""
    if not on_a_gpu():
        return fundamental(slopes, period, steps, pushes)[1]
    step, looks, scale = _driven(slopes, period, steps, pushes)
    return _product(jax.vmap(step)(*looks))[: len(scale)] / scale


def _driven(
    slopes: tuple[Array, ...], period: Scalar, steps: int, pushes: Array | None
) -> tuple[Callable[..., Array], tuple, Array]:
    """Return the function of a step, what it takes at each one, and the units of its columns."""
    units, gauss = _looks(slopes, period, steps)
    dims = len(units) // 2
    if pushes is None:
        pushes = jnp.zeros((len(slopes[0]), dims, 0))
    scale = units[:, None] / jnp.append(units, jnp.ones(pushes.shape[2]))[None]
    pushes = period / steps * units[None, dims:, None] * resample(pushes, steps)
    pushes = jnp.concatenate([jnp.zeros_like(pushes), pushes], axis=1)
    return eqx.Partial(_driven_step, halvings=_halvings(steps)), (gauss, pushes), scale


def _product(matrices: Float[Array, "n m m"]) -> Float[Array, "m m"]:
    """Multiply a power of two of matrices by pairs, the last on the left."""
    while len(matrices) > 1:
        matrices = matrices[1::2] @ matrices[::2]
    return matrices[0]


def _looks(
    slopes: tuple[Array, ...], period: Scalar, steps: int
) -> tuple[Array, tuple[Array, ...]]:
    """Return the units of a disturbance, and d(x', x'') / d(x, x') at Gauss' points of each step.

    In these units, and a step long.
    """
    by_x, dims = slopes[0], slopes[0].shape[1]
    # Rates in the unit of the fastest swing, so that all entries are of one size.
    pace = jnp.sqrt(jnp.max(jnp.abs(by_x)))
    units = jnp.concatenate([jnp.ones(dims), jnp.full(dims, 1 / pace)])
    scale, upper = units[:, None] / units[None], np.eye(dims, 2 * dims, dims)
    lower = jnp.concatenate(slopes, axis=2)

    def looked(shift: float) -> Array:
        found = resample(lower, steps, shift)
        both = jnp.concatenate([jnp.broadcast_to(upper, found.shape), found], axis=1)
        return period / steps * scale[None] * both

    return units, tuple(looked(0.5 + off) for off in (-GAUSS, 0.0, GAUSS))


def _halvings(steps: int) -> int:
    """Return how often the exponent of a step is halved for its series, one product each.

    More steps are asked for where it is large: a thin film makes it some hundreds. Half as many,
    which tell the error, are halved as often as needed too.
    """
    return 2 + max(0, math.ceil(math.log2(2 * steps / STEPS)))


def _step(early: Array, first: Array, late: Array, *, halvings: int) -> Array:
    """Return what a step multiplies a disturbance by."""
    second = (late - early) / (2 * GAUSS)
    third = (late - 2 * first + early) / (2 * GAUSS**2)
    inner = _bracket(first, second)
    outer = -_bracket(first, 2 * third + inner) / 60
    fourth = _bracket(-20 * first - third + inner, second + outer) / 240
    return _exponential(first + third / 12 + fourth, halvings)


def _bracket(a: Array, b: Array) -> Array:
    return a @ b - b @ a


def _exponential(matrix: Array, halvings: int) -> Array:
    """Sum a series of degree 8 for a matrix whose norm is of order one after some halvings.

    Grouped by powers of the cube (Paterson and Stockmeyer, SIAM J. Comput. 2, 1973).
    """
    part, eye = matrix / 2**halvings, jnp.eye(len(matrix))
    square = part @ part
    cube = part @ square

    def group(first: int) -> Array:
        one, two, three = (1 / math.factorial(first + k) for k in range(3))
        return one * eye + two * part + three * square

    found = group(6)
    for first in (3, 0):
        found = group(first) + cube @ found
    for _ in range(halvings):
        found = found @ found
    return found
