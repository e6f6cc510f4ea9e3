"""What a machine shows at a point of its numbers: harmonics, RMS values and statistics."""

import functools
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcrusher.basics.checks import require, require_choice, require_known
from jaxcrusher.identification.measurements import RMS, WHOLE, Measurement
from jaxcrusher.mechanism.reductions import SAMPLES
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.turns import SIDES, curve_of
from jaxcrusher.orbits.periodic_orbit import periodic_orbit
from jaxcrusher.orbits.result import PeriodicOrbit, turns_of
from jaxcrusher.scenes.machine import Family, Machine
from jaxcrusher.scenes.units import NUMBER

# A number of an orbit beside its statistics.
LEAST_PENETRATION = "least_penetration"
# A component of a vector along another direction than x and y: its name and the angle, in degrees.
_OBLIQUE = re.compile(rf"(.+)_({NUMBER})deg")


def require_continuous(argument: str, names: Iterable[str], machine: Machine) -> None:
    """Raise ValueError for a whole number of a machine, since nothing has slopes by it."""
    numbers = machine.structure.numbers({**machine.given, **dict.fromkeys(names)})
    whole = [name for name in names if name in numbers and numbers[name].whole]
    require(not whole, argument, "name numbers that may vary continuously", ", ".join(whole))


class What(NamedTuple):
    """What is looked at: harmonics of observables up to an order, and statistics.

    Vectors are seen along x and y; `oblique` are components along other directions.
    """

    observables: tuple[str, ...]
    orders: int
    statistics: tuple[str, ...]
    oblique: tuple[str, ...] = ()


class Predicted(NamedTuple):
    """What is seen of an orbit, or its slopes, whose arrays have one more axis."""

    # by component; A e^(i phi) of each order, the mean first, and the RMS about it last
    spectra: dict[str, Any]
    statistics: dict[str, Any]
    stable: Any

    def of(self, quantity: str, order: int | str) -> Any:
        """Return one number, complex where it is a harmonic."""
        if order == WHOLE:
            return self.statistics[quantity]
        return self.spectra[quantity][-1 if order == RMS else order]


@dataclass(frozen=True)
class Quantities:
    """What a scene shows: observables and numbers of an orbit, by name, and their SI units.

    `meanings` say what observables are, `measurable` are those that sensors show, and `vectors`
    those with two components.
    """

    observables: Mapping[str, str]
    statistics: Mapping[str, str]
    meanings: Mapping[str, str]
    measurable: tuple[str, ...]
    vectors: frozenset[str]
    angles: Float[np.ndarray, " n"]  # of the shaft, at equal steps of the phase over a turn

    def phase(self, angle: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the phase at angles of the shaft: they differ where its drive is uneven."""
        begun = 2 * np.pi * np.floor(angle / (2 * np.pi))
        turn = np.linspace(0, 2 * np.pi, len(self.angles))
        return begun + np.interp(angle - begun, self.angles, turn)

    def observable(self, quantity: str) -> str:
        """Return the observable of a quantity, such as `ground_force` of `ground_force_y`."""
        oblique = _OBLIQUE.fullmatch(quantity)
        name = oblique[1] if oblique else quantity[:-2] if quantity.endswith(SIDES) else quantity
        return name if name in self.vectors and quantity not in self.observables else quantity

    def called(self, quantity: str) -> str:
        """Return what an observable is, with the way of a component along x or y."""
        name = self.observable(quantity)
        way = {"_x": " horizontally", "_y": " vertically"}.get(quantity.removeprefix(name), "")
        return self.meanings[name] + way

    def unit(self, quantity: str) -> str:
        """Return the SI unit of a quantity; ValueError for an unknown one."""
        name, known = self.observable(quantity), {**self.statistics, **self.observables}
        require_known(name, known)
        return known[name]

    def unit_of(self, quantity: str, order: int | str) -> str:
        """Return the SI unit of a measured quantity; ValueError for one that is not shown."""
        name, known = self.observable(quantity), {**self.statistics, **self.observables}
        if name not in known:
            near = get_close_matches(name, known, n=1)
            require_choice("quantity", quantity, tuple(known if near else self.measurable))
        must = f"have a direction, as {name}_x, {name}_y or {name}_30deg"
        require(quantity not in self.vectors, "quantity", must, quantity)
        fits = name in (self.statistics if order == WHOLE else self.observables)
        must = f'suit {name}: "" of a statistic, and a number or "rms" of an observable'
        require(fits, "order", must, repr(order))
        return known[name]

    def asked(self, measured: Iterable[Measurement]) -> What:
        """Return what is to be looked at; ValueError for what the scene does not show."""
        observables, orders, statistics, oblique = set(), [1], set(), set()
        for one in measured:
            self.unit_of(one.quantity, one.order)
            name = self.observable(one.quantity)
            (statistics if one.order == WHOLE else observables).add(name)
            if name != one.quantity and not one.quantity.endswith(SIDES):
                oblique.add(one.quantity)
            orders += [one.order] if isinstance(one.order, int) else []
        named = (tuple(sorted(names)) for names in (observables, statistics, oblique))
        seen, whole, along = named
        return What(seen, max(orders), whole, along)


@functools.partial(jax.jit, static_argnums=(1, 2))
def _shown(numbers: Any, rest: tuple[Any, ...], structure: Any) -> dict[str, Array]:
    """Return all observables of a scene at rest, whose shapes a trace tells; JAX keeps the trace.

    The scene comes in two parts: its numbers, and the leaves and the structure of all else.
    """
    scene = eqx.combine(numbers, jax.tree.unflatten(structure, rest))
    state = scene.formulation.initial(scene)
    snapshot = scene.formulation.snapshot(jnp.zeros(()), state, scene)
    return {name: one(snapshot, scene) for name, one in scene.observables.items()}


def quantities_of(scene: Scene) -> Quantities:
    """Return what a scene shows."""
    observables = {name: one.unit for name, one in scene.observables.items()}
    statistics = {name: one.unit for name, one in scene.statistics.items()}
    meanings = {name: one.meaning for name, one in scene.observables.items()}
    traced = (jax.Array, np.ndarray, np.generic)
    numbers, others = eqx.partition(scene.steady(), lambda leaf: isinstance(leaf, traced))
    rest, structure = jax.tree.flatten(others)
    seen = _shown.eval_shape(numbers, tuple(rest), structure)
    vectors = frozenset(name for name, one in seen.items() if one.ndim)
    drive, angles = scene.drive, np.linspace(0, 2 * np.pi, SAMPLES + 1)
    if drive.initial() is None:
        angles = np.asarray(jax.vmap(lambda at: drive.crank(at / drive.speed, None).angle)(angles))
    statistics |= {LEAST_PENETRATION: "1"}
    return Quantities(observables, statistics, meanings, scene.measurable, vectors, angles)


@eqx.filter_jit
def look(
    scenes: Family,
    moved: int,
    point: Float[Array, " n"],
    sizes: Float[Array, " n"],
    what: What,
    how: Mapping[str, Any],
) -> tuple[Predicted, Predicted]:
    """Return what is seen at a point, and its slopes by the first `moved` of its coordinates.

    The coordinates are the numbers of `scenes` in shares of `sizes`. `how` are arguments of
    `periodic_orbit`. NaN where there is no orbit.
    """

    def at(some: Float[Array, " moved"]) -> tuple[Predicted, Predicted]:
        numbers = sizes * jnp.concatenate([some, point[moved:]])
        orbit = periodic_orbit(scenes(numbers), **how)
        seen = _predicted(orbit, what)
        return seen, seen

    slopes, values = jax.jacfwd(at, has_aux=True)(point[:moved])
    return values, slopes


def _predicted(orbit: PeriodicOrbit, what: What) -> Predicted:
    known, spectra = orbit.scene.observables, {}
    turns = turns_of(orbit, {name: known[name] for name in what.observables})
    curves = turns.curves()
    for name in what.oblique:
        observable, angle = _oblique_component(name)
        x, y = (curves[f"{observable}{side}"] for side in SIDES)
        values = np.cos(angle) * x.values + np.sin(angle) * y.values
        curves[name] = curve_of(x.unit, values)
    for name, curve in curves.items():
        orders = curve.amplitudes(what.orders * turns.length)[0, :: turns.length]
        spectra[name] = jnp.append(orders, curve.moving.rms[0].astype(complex))
    statistics = {
        name: orbit.least_penetration if name == LEAST_PENETRATION else orbit[name]
        for name in what.statistics
    }
    return Predicted(spectra, statistics, jnp.asarray(orbit.stable, float))


def _oblique_component(quantity: str) -> tuple[str, float]:
    """Return the observable of an oblique component, and its angle, rad."""
    match = _OBLIQUE.fullmatch(quantity)
    assert match is not None, quantity
    return match[1], float(np.radians(float(match[2])))


def residual_rows(
    measured: Iterable[Measurement], seen: Mapping[float, tuple[Predicted, Predicted]]
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
