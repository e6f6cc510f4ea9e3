"""What a machine shows at a point of its numbers: harmonics, RMS values and statistics."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcrusher.basics.checks import require, require_known
from jaxcrusher.identification.measurements import RMS, WHOLE, Measurement
from jaxcrusher.mechanism.reductions import SAMPLES
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.turns import SIDES
from jaxcrusher.orbits.periodic_orbit import periodic_orbit
from jaxcrusher.orbits.result import PeriodicOrbit, turns_of
from jaxcrusher.scenes.machine import Family, Machine

# A number of an orbit beside its statistics.
LEAST_PENETRATION = "least_penetration"


def require_continuous(argument: str, names: Iterable[str], machine: Machine) -> None:
    """ValueError for a whole number of a machine, by which nothing has slopes."""
    numbers = machine.structure.numbers({**machine.given, **dict.fromkeys(names)})
    whole = [name for name in names if name in numbers and numbers[name].whole]
    require(not whole, argument, "name numbers that may vary continuously", ", ".join(whole))


class What(NamedTuple):
    """What is looked at: harmonics of observables up to an order, and statistics."""

    observables: tuple[str, ...]
    orders: int
    statistics: tuple[str, ...]


class Seen(NamedTuple):
    """What is seen of an orbit; of slopes each array has one more axis."""

    # by component; A e^(i phi) of each order, the mean first, and the RMS about it last
    spectra: dict[str, Any]
    statistics: dict[str, Any]
    stable: Any

    def of(self, quantity: str, order: int | str) -> Any:
        """Return one number, complex where it is a harmonic."""
        if order == WHOLE:
            return self.statistics[quantity]
        require_known(quantity, self.spectra)
        return self.spectra[quantity][-1 if order == RMS else order]


@dataclass(frozen=True)
class Quantities:
    """What a scene shows: names and SI units of observables, and of numbers of an orbit."""

    observables: Mapping[str, str]
    statistics: Mapping[str, str]
    angles: Float[np.ndarray, " n"]  # of the shaft, at equal steps of the phase over a turn

    def phase(self, angle: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the phase at angles of the shaft: another one where its drive is uneven."""
        begun = 2 * np.pi * np.floor(angle / (2 * np.pi))
        turn = np.linspace(0, 2 * np.pi, len(self.angles))
        return begun + np.interp(angle - begun, self.angles, turn)

    def observable(self, quantity: str) -> str:
        """Return the observable of a quantity, such as `ground_force` of `ground_force_y`."""
        is_side = quantity.endswith(SIDES) and quantity not in self.observables
        return quantity[:-2] if is_side and quantity[:-2] in self.observables else quantity

    def unit(self, quantity: str) -> str:
        """Return the SI unit of a quantity; ValueError for an unknown one."""
        name, known = self.observable(quantity), {**self.statistics, **self.observables}
        require_known(name, known)
        return known[name]

    def asked(self, measured: Iterable[Measurement]) -> What:
        """Return what is to be looked at; ValueError for what the scene does not show."""
        observables, orders, statistics = set(), [1], set()
        for one in measured:
            self.unit(one.quantity)
            name, is_whole = self.observable(one.quantity), one.order == WHOLE
            known = name in (self.statistics if is_whole else self.observables)
            must = f'suit {name}: "" of a statistic, and a number or "rms" of an observable'
            require(known, "order", must, repr(one.order))
            (statistics if is_whole else observables).add(name)
            orders += [one.order] if isinstance(one.order, int) else []
        return What(tuple(sorted(observables)), max(orders), tuple(sorted(statistics)))


def quantities_of(scene: Scene) -> Quantities:
    """Return what a scene shows."""
    observables = {name: one.unit for name, one in scene.observables.items()}
    statistics = {name: one.unit for name, one in scene.statistics.items()}
    drive, angles = scene.drive, np.linspace(0, 2 * np.pi, SAMPLES + 1)
    if drive.initial() is None:
        angles = np.asarray(jax.vmap(lambda at: drive.crank(at / drive.speed, None).angle)(angles))
    return Quantities(observables, {**statistics, LEAST_PENETRATION: "1"}, angles)


@eqx.filter_jit
def look(
    scenes: Family,
    moved: int,
    point: Float[Array, " n"],
    sizes: Float[Array, " n"],
    what: What,
    how: Mapping[str, Any],
) -> tuple[Seen, Seen]:
    """Return what is seen at a point, and its slopes by the first `moved` of its coordinates.

    These are the numbers of `scenes` in shares of `sizes`. `how` are arguments of `periodic_orbit`.
    NaN where there is no orbit.
    """

    def at(some: Float[Array, " moved"]) -> tuple[Seen, Seen]:
        numbers = sizes * jnp.concatenate([some, point[moved:]])
        orbit = periodic_orbit(scenes(numbers), **how)
        seen = _seen(orbit, what)
        return seen, seen

    slopes, values = jax.jacfwd(at, has_aux=True)(point[:moved])
    return values, slopes


def _seen(orbit: PeriodicOrbit, what: What) -> Seen:
    known, spectra = orbit.scene.observables, {}
    turns = turns_of(orbit, {name: known[name] for name in what.observables})
    for name, curve in turns.curves().items():
        orders = curve.amplitudes(what.orders * turns.length)[0, :: turns.length]
        spectra[name] = jnp.append(orders, curve.moving.rms[0].astype(complex))
    statistics = {
        name: orbit.least_penetration if name == LEAST_PENETRATION else orbit[name]
        for name in what.statistics
    }
    return Seen(spectra, statistics, jnp.asarray(orbit.stable, float))


def residual_rows(
    measured: Iterable[Measurement], seen: Mapping[float, tuple[Seen, Seen]]
) -> tuple[Float[np.ndarray, " rows"], Float[np.ndarray, "rows n"]]:
    """Return what is seen less what was measured, in sigmas, and its slopes.

    A harmonic with its phase has two rows. `seen` has values and slopes by speed.
    """
    residuals, slopes = [], []
    for one in measured:
        value, slope = (part.of(one.quantity, one.order) for part in seen[one.speed])
        if one.has_phase:
            apart = value - one.amplitude * np.exp(1j * one.phase)
            residuals += [apart.real / one.sigma, apart.imag / one.sigma]
            slopes += [slope.real / one.sigma, slope.imag / one.sigma]
            continue
        if one.is_harmonic:
            value, slope = abs(value), slope * np.exp(-1j * np.angle(value))
        residuals.append((value.real - one.amplitude) / one.sigma)
        slopes.append(slope.real / one.sigma)
    return np.array(residuals), np.array(slopes)
