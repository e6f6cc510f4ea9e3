"""Harmonics of what can be observed along a periodic orbit."""

import numpy as np
import xarray as xr

from jaxcrusher.basics.checks import (
    require,
    require_kind,
    require_names,
    require_own_process,
    require_untraced,
)
from jaxcrusher.mechanism.reductions import require_orders
from jaxcrusher.orbits.result import PeriodicOrbit, require_one, turns_of

# What a foundation is laid out for: what a clamped frame passes to the ground, and what excites one
# on supports.
OUTPUTS = ("ground_force", "ground_moment")
ON_SUPPORTS = ("exciting_force", "exciting_moment")


def harmonics(
    orbit: PeriodicOrbit, orders: int = 6, *, outputs: tuple[str, ...] | None = None
) -> xr.Dataset:
    """Return amplitudes and phases of observables of an orbit, by harmonics of the shaft's turn.

    A quantity is a(theta) = mean + sum of A_k cos(k theta + phi_k) of the phase theta = omega t:
    the shaft's angle at its mean speed, counted on through all turns of the period.

    **Arguments:**

    - `orbit`: one that was found, with concrete values.
    - `orders`: the highest order k, a whole number from 1 to 511. An orbit of p turns has the
      orders 1/p, 2/p and so on up to it.
    - `outputs`: names of the scene's `observables`. None is the force and the
      moment on the ground, and of a frame on supports those that excite it.

    **Returns:** an `xarray.Dataset` with `amplitude` (in `unit`) and `phase` (rad), both of the
    dimensions `quantity` and `order`. A vector has two quantities, such as `ground_force_x` and
    `ground_force_y`. Of order 0 the amplitude is the mean, with its sign, and the phase is zero.
    Sums over 1024 instants a turn determine them.

    Raises ValueError for an orbit that was not found, for orders out of range, for unknown outputs,
    and under `jax.jit`.
    """
    require_own_process()
    require_kind("orbit", orbit, PeriodicOrbit, "jaxcrusher.periodic_orbit(scene)")
    require_untraced("orbit", orbit.values, "harmonics", "PeriodicOrbit.motion")
    require_one(orbit)
    require(bool(orbit.success), "orbit", "be one that was found", orbit.failure)
    require_orders(orders)
    known, usual = orbit.scene.observables, OUTPUTS if orbit.scene.supports is None else ON_SUPPORTS
    outputs = usual if outputs is None else outputs
    require_names("outputs", outputs, tuple(known))
    turns = turns_of(orbit, {name: known[name] for name in outputs})
    curves, highest = turns.curves(), orders * turns.length
    spectrum = np.concatenate([one.amplitudes(highest) for one in curves.values()])
    amplitude, phase = np.abs(spectrum), np.angle(spectrum)
    amplitude[:, 0], phase[:, 0] = np.real(spectrum[:, 0]), 0.0
    axes = ("quantity", "order")
    return xr.Dataset(
        {
            "amplitude": (axes, amplitude, {"long_name": "amplitude; of order 0 the mean"}),
            "phase": (axes, phase, {"units": "rad", "long_name": "phase of the cosine"}),
        },
        {
            "quantity": list(curves),
            "order": np.arange(highest + 1) / turns.length,
            "unit": ("quantity", [one.unit for one in curves.values()]),
        },
        {"period": turns.length, "speed": float(orbit.scene.drive.speed)},
    )
