"""From tolerances of a machine's numbers to the scatter of what its periodic orbit shows."""

from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from jaxcrusher.basics.checks import require, require_names, require_positive
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.identification.model import (
    Machine,
    What,
    look,
    maker_of,
    quantities_of,
    require_continuous,
)
from jaxcrusher.mechanism.reductions import require_orders
from jaxcrusher.orbits.result import PeriodicOrbit

# The second order counts if it changes a standard deviation by more than this share.
LINEAR = 0.05
SAME = 1e-12  # rounding of two ways to one number
TINY = np.finfo(float).tiny


def propagate(
    orbit: PeriodicOrbit,
    machine: Machine,
    sigmas: Mapping[str, float | tuple[float, float]],
    *,
    outputs: tuple[str, ...] | None = None,
    observables: tuple[str, ...] | None = None,
    orders: int = 2,
) -> xr.Dataset:
    """Return the standard deviations of statistics and harmonics of an orbit, and their causes.

    By exact slopes. Each number is also moved by its deviation to either side, which gives the
    second order of each number by itself. Numbers are normal and independent. Neighbours of the
    orbit are found as it was: of its period, and by shooting if it was shot for.

    **Arguments:**

    - `orbit`: a `PeriodicOrbit`.
    - `machine`: what its scene was made of, which has the names of numbers: one as of
      `jaxcrusher.identify`; a function has the numbers of `sigmas` alone.
    - `sigmas`: names of numbers -> standard deviations, or of a function value and deviation.
    - `outputs`: statistics, or `least_penetration`; None is those that are computed always.
    - `observables`: those whose amplitudes up to `orders` are wanted; None is the force and the
      moment on the ground.

    **Returns:** an `xarray.Dataset` over `quantity`, such as "ground_force_y, order 1": `value`,
    `standard_deviation`, `second_order` (the deviation with the second order), `shift` (of the
    mean by it) in `unit`, and `linear`, which is logical; over `number` too, `share` of the
    variance. NaN, and not linear, where a machine of moved numbers has no such orbit.

    Raises ValueError for bad arguments, an orbit that was not found, and one of another machine.
    """
    require_set_up()
    require_orders(orders)
    require(len(sigmas) > 0, "sigmas", "name a number", "empty")
    require(bool(orbit.success), "orbit", "be one that was found", f"none: {orbit.failure}")
    make, names = maker_of(machine), tuple(sigmas)
    require_continuous("sigmas", names)
    pairs = [of if isinstance(of, tuple) else (make.value(n), of) for n, of in sigmas.items()]
    first, sizes = np.array(pairs, float).T
    for name, size in zip(names, sizes, strict=True):
        require_positive(f"sigmas[{name!r}]", size, "")
    example = make(**dict(zip(names, first, strict=True)))
    same = bool(eqx.tree_equal(example, orbit.scene, rtol=SAME))
    require(same, "machine", "make the scene of the orbit", "another one")
    quantities = quantities_of(example)
    outputs = example.usual_statistics if outputs is None else outputs
    observables = ("ground_force", "ground_moment") if observables is None else observables
    require_names("outputs", outputs, tuple(quantities.statistics))
    require_names("observables", observables, tuple(quantities.observables))
    what, make, how = What(observables, orders, outputs), make.without(names), orbit.alike

    def seen(u: np.ndarray) -> tuple[dict[str, float], dict[str, np.ndarray]]:
        """Return numbers by quantity, and their slopes by standard deviations."""
        found = look(make, names, len(u), jnp.asarray(u), jnp.asarray(sizes), what, how)
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

    def moved(shifts: np.ndarray) -> np.ndarray:
        """Return the numbers of machines whose numbers are moved by standard deviations."""
        return np.array([[seen(middle + shift)[0][name] for name in known] for shift in shifts])

    centre, slopes = np.array([*value.values()]), np.array([by[name] for name in known])
    ahead, behind = moved(np.eye(len(names))).T, moved(-np.eye(len(names))).T
    # Of f = f0 + s z + c z^2 with a normal z the mean is f0 + c, and the variance s^2 + 2 c^2.
    bends = (ahead + behind) / 2 - centre[:, None]
    deviation = np.linalg.norm(slopes, axis=1)
    second = np.hypot(deviation, np.sqrt(2) * np.linalg.norm(bends, axis=1))
    # Of third order.
    turned = np.linalg.norm((ahead - behind) / 2 - slopes, axis=1)
    columns = {
        "value": centre,
        "standard_deviation": deviation,
        "second_order": second,
        "shift": bends.sum(axis=1),
        "linear": (second - deviation <= LINEAR * deviation) & (turned <= LINEAR * deviation),
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
