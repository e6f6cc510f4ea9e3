"""From tolerances of a machine's numbers to the scatter of what its periodic orbit shows."""

from collections.abc import Callable, Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from jaxcrusher.basics.checks import require, require_names, require_positive
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.identification.model import What, look, quantities_of, require_continuous
from jaxcrusher.mechanism.reductions import require_orders
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.scenes.earlier import of_description
from jaxcrusher.scenes.machine import Machine, machine_of

# What changes a standard deviation by more than this share counts: 500 draws have such an error.
LINEAR = 0.03
STEP = np.sqrt(3)  # the outer points of Gauss and Hermite, in standard deviations
SAME = 1e-12  # rounding of two ways to one number
TINY = np.finfo(float).tiny


@of_description
def propagate(
    machine: Machine | Callable[..., Scene],
    orbit: PeriodicOrbit,
    sigmas: Mapping[str, float | tuple[float, float]],
    *,
    outputs: tuple[str, ...] | None = None,
    observables: tuple[str, ...] | None = None,
    orders: int = 2,
) -> xr.Dataset:
    """Return the standard deviations of statistics and harmonics of an orbit, and their causes.

    The slopes are exact. Each number is also moved by sqrt(3) of its deviation to either side,
    where Gauss and Hermite's three points lie: the slopes there give the second order of each
    number, and of each product of two. A move of all numbers at once tells what this leaves out.
    Numbers are normal and independent. Neighbours of the orbit have its period, and are found by
    shooting if the orbit was.

    **Arguments:**

    - `machine`: as in `jaxcrusher.identify`; a function has the numbers of `sigmas` alone.
    - `orbit`: a `PeriodicOrbit` of its scene.
    - `sigmas`: names of numbers -> standard deviations, or of a function value and deviation.
    - `outputs`: statistics, or `least_penetration`; None is those that are computed always.
    - `observables`: those whose amplitudes up to `orders` are wanted; None is the force and the
      moment on the ground.

    **Returns:** an `xarray.Dataset` over `quantity`, such as "ground_force_y, order 1": `value`,
    `standard_deviation`, `second_order` (the deviation with the second order), `shift` (of the mean
    by it) in `unit`, and `linear`, which is logical; over `number` too, `share` of the variance. A
    quantity is linear where the second order, and what it leaves out, change the deviation by 3 %
    at most. Where it is not, `second_order` is the deviation of parabolas through three points. At
    the peak of a resonance this is 1 to 1.4 times the true deviation for a natural frequency with a
    deviation of up to two half-widths of the peak, and twice that for ten. NaN, and not linear,
    where a machine of moved numbers has no such orbit.

    Raises ValueError for bad arguments, an orbit that was not found, and one of another machine.
    """
    require_set_up()
    require_orders(orders)
    require(len(sigmas) > 0, "sigmas", "name a number", "empty")
    require(bool(orbit.success), "orbit", "be one that was found", f"none: {orbit.failure}")
    machine, names = machine_of(machine), tuple(sigmas)
    require_continuous("sigmas", names, machine)
    pairs = [of if isinstance(of, tuple) else (machine.number(n), of) for n, of in sigmas.items()]
    first, sizes = np.array(pairs, float).T
    for name, size in zip(names, sizes, strict=True):
        require_positive(f"sigmas[{name!r}]", size, "")
    example = machine.scene(**dict(zip(names, first, strict=True)))
    same = bool(eqx.tree_equal(example, orbit.scene, rtol=SAME))
    require(same, "machine", "have the scene of the orbit", "another one")
    quantities = quantities_of(example)
    outputs = example.usual_statistics if outputs is None else outputs
    observables = ("ground_force", "ground_moment") if observables is None else observables
    require_names("outputs", outputs, tuple(quantities.statistics))
    require_names("observables", observables, tuple(quantities.observables))
    what, scenes, how = What(observables, orders, outputs), machine.over(*names), orbit.alike

    def seen(u: np.ndarray) -> tuple[dict[str, float], dict[str, np.ndarray]]:
        """Return numbers by quantity, and their slopes by standard deviations."""
        found = look(scenes, len(u), jnp.asarray(u), jnp.asarray(sizes), what, how)
        values, slopes = jax.tree.map(np.asarray, found)
        numbers = {name: float(value) for name, value in values.statistics.items()}
        by = dict(slopes.statistics)
        for quantity, spectrum in values.spectra.items():
            for order in range(1, orders + 1):
                name, value = f"{quantity}, order {order}", spectrum[order]
                size = max(abs(value), TINY)
                numbers[name] = float(abs(value))
                by[name] = (np.conj(value) * slopes.spectra[quantity][order]).real / size
        return numbers, by

    middle = first / sizes
    value, by = seen(middle)
    known = list(value)

    def moved(shifts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the numbers of machines moved by standard deviations, and their slopes."""
        found = [seen(middle + shift) for shift in shifts]
        numbers = np.array([[values[name] for name in known] for values, _ in found])
        return numbers, np.array([[slopes[name] for name in known] for _, slopes in found])

    centre, slopes = np.array([*value.values()]), np.array([by[name] for name in known])
    steps, count = STEP * np.eye(len(names)), len(names)
    (ahead, slopes_ahead), (behind, slopes_behind) = moved(steps), moved(-steps)
    # With normal z a function is m + a z + (z B z - tr B) / 2 and less: a is its mean slope, and B
    # its mean second derivative, whose variance is a^2 + B^2 / 2 (Hermite's polynomials).
    shift = ((ahead + behind) / 2 - centre).sum(axis=0) / 3
    mean_slopes = slopes + ((slopes_ahead + slopes_behind) / 2 - slopes).sum(axis=0) / 3
    bends = (slopes_ahead - slopes_behind).swapaxes(0, 1) / (2 * STEP)
    bends = (bends + bends.swapaxes(1, 2)) / 2
    bends[:, range(count), range(count)] = ((ahead + behind).T - 2 * centre[:, None]) / 3
    deviation = np.linalg.norm(slopes, axis=1)
    second = np.hypot(
        np.linalg.norm(mean_slopes, axis=1), np.linalg.norm(bends, axis=(1, 2)) / np.sqrt(2)
    )
    # As far off as draws are, to either side.
    signs = np.random.default_rng(0).choice((-1.0, 1.0), count) * [[1.0], [-1.0]]
    curved = np.einsum("di,qij,dj->dq", signs, bends, signs) - np.trace(bends, axis1=1, axis2=2)
    left_out = moved(signs)[0] - (centre + shift + signs @ mean_slopes.T + curved / 2)
    whole = np.hypot(second, np.sqrt(np.mean(left_out**2, axis=0)))
    turned = np.linalg.norm(mean_slopes - slopes, axis=1)
    columns = {
        "value": centre,
        "standard_deviation": deviation,
        "second_order": second,
        "shift": shift,
        "linear": np.maximum(whole - deviation, turned) <= LINEAR * deviation,
    }
    return xr.Dataset(
        {name: ("quantity", column) for name, column in columns.items()}
        | {"share": (("quantity", "number"), (slopes / np.maximum(deviation, TINY)[:, None]) ** 2)},
        {
            "quantity": known,
            "number": list(names),
            "unit": ("quantity", [quantities.unit(name.partition(",")[0]) for name in known]),
        },
    )
