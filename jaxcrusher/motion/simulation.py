"""Simulate a scene and look at it at given times."""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float, PyTree, Scalar
from typing_extensions import override

from jaxcrusher.basics.checks import concrete, require
from jaxcrusher.basics.integrate import (
    Carried,
    InitialValueProblem,
    Integration,
    Outcome,
    failure_text,
    integrate,
)
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.crusher.machine import JOINTS
from jaxcrusher.crusher.template import CRUSHER
from jaxcrusher.files import svg
from jaxcrusher.files.summary import Row, Summarised, Summary, range_of, value_text
from jaxcrusher.files.text import number, quantity
from jaxcrusher.mechanism import observables
from jaxcrusher.mechanism.acting import push_power, spring_loss
from jaxcrusher.mechanism.quantities import Parts, asked_of
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.flow import Flow, unflattened
from jaxcrusher.motion.method import Method, resolve, warn_of_slopes
from jaxcrusher.motion.named import AbstractNamed, Known, made_of
from jaxcrusher.motion.names import ObservableNames

FIRST_STEP = 1e-6  # s

# The powers whose time integrals, with the energies, make the ledger.
WORKS = {
    "drive_work": observables.drive_power,
    "contact_loss": observables.contact_loss,
    "friction_loss": observables.friction_loss,
    "load_work": push_power,
}
ENERGIES = {
    "kinetic": observables.kinetic_energy,
    "potential": observables.potential_energy,
    "elastic": observables.elastic_energy,
}
# What pictures show first: a crusher's |R_O| + |R_C|, or what shakes the ground.
LEADING_FORCES = ("foundation_force", "shaking_force")
# What `simulate` can report of any crusher. One with further loose joints, on supports or with a
# tension rod has more: `scene.observables` has all, with units.
OUTPUTS = (*asked_of(CRUSHER, Parts(JOINTS, ())).observables, "energy")


def _works(scene: Scene) -> dict[str, Callable]:
    """Return the powers of a scene's ledger: drive, loads, contacts, dampers."""
    found = dict(WORKS)
    if scene.springs:
        found[f"{scene.template.springs}loss"] = spring_loss
    if scene.supports is not None:
        found["support_loss"] = observables.support_loss
    return found


class Energy(Summarised, eqx.Module):
    """The energy ledger: energies, and work since time zero, J; shape (times,) or one instant.

    Springs of supports and rod count as elastic. `support_loss` is the energy that supports'
    dampers took, None where the frame is clamped. `rod_loss` is that of a rod's damper,
    `spring_loss` that of dampers beside springs; None without one.
    """

    kinetic: Float[Array, "*times"]
    potential: Float[Array, "*times"]
    elastic: Float[Array, "*times"]
    drive_work: Float[Array, "*times"]
    load_work: Float[Array, "*times"]
    contact_loss: Float[Array, "*times"]
    friction_loss: Float[Array, "*times"]
    support_loss: Float[Array, "*times"] | None = None
    rod_loss: Float[Array, "*times"] | None = None
    spring_loss: Float[Array, "*times"] | None = None

    @property
    def imbalance(self) -> Float[Array, "*times"]:
        """Return the energy that the ledger does not account for since the first time, J."""
        stored = self.kinetic + self.potential + self.elastic
        balance = stored - self.drive_work - self.load_work
        balance = balance + self.contact_loss + self.friction_loss
        for loss in (self.support_loss, self.rod_loss, self.spring_loss):
            balance = balance if loss is None else balance + loss
        return balance - balance[..., :1]

    @override
    def _summary(self) -> Summary:
        parts = {one.name: getattr(self, one.name) for one in dataclasses.fields(self)}
        rows = [Row(name, value_text(of, "J")) for name, of in parts.items() if of is not None]
        return Summary(f"Energy: {self._balance}", rows)

    @property
    def _balance(self) -> str:
        if not self.kinetic.ndim:
            return "of one instant"
        return f"balanced to {quantity(float(np.nanmax(np.abs(self.imbalance))), 'J')}"


class Trajectory(AbstractNamed, eqx.Module, ObservableNames):
    """A motion at given times, by name: the scene's `observables` have units and meanings.

    Vectors have shape (times, 2), x to the right and y up. A failed simulation has
    `success` False, NaN from the failure on, and says why in `failure`.
    """

    time: Float[Array, " times"]  # s
    outcome: Outcome
    values: Mapping[str, Float[Array, " times"] | Float[Array, "times 2"] | Energy]
    known: Known = eqx.field(static=True, default=())

    @override
    def units(self) -> dict[str, str]:
        return {name: one.unit for name, one in self.known} | {"energy": "J"}

    @property
    def energy(self) -> Energy:
        """The energy ledger."""
        return self["energy"]

    @property
    @override
    def success(self) -> Bool[Array, "*batch"]:
        """Whether the integration came to its end."""
        return self.outcome.success

    @property
    @override
    def failure(self) -> str:
        """Why and when (s) the integration stopped, or nothing (concrete values only)."""
        return failure_text(self.outcome, "s")

    @made_of("jaw_position")
    def jaw_displacement(self) -> Float[Array, "*batch times 2"]:
        """The displacement of B since the first time, m."""
        places = self["jaw_position"]
        return places - places[..., :1, :]

    @override
    def _entries(self) -> Mapping[str, Any]:
        return dict(self.known)

    @override
    def _headline(self) -> str:
        first, last = (float(self.time[i]) for i in (0, -1))
        return f"{len(self.time)} times from {number(first)} to {number(last)} s"

    @override
    def _rows(self) -> list[Row]:
        rows = self._rows_of(name for name in self._told if name != "energy")
        if "energy" in self.values:
            rows.append(Row("energy", self.energy._balance, "its ledger"))
        return rows

    @override
    def _picture(self) -> str:
        shape = self.time.shape
        scalars = [n for n, of in self.values.items() if getattr(of, "shape", None) == shape]
        if not self._is_one or not scalars:
            return ""
        name = next((name for name in LEADING_FORCES if name in scalars), scalars[0])
        told = f"{name}, {range_of(self[name], self.units()[name])}, over time"
        return svg.curve(self.time, self[name], told) + self._pins()

    def _pins(self) -> str:
        """Return the way of each pin in its bore, as far as it was asked for."""
        ways = []
        for name in self.values:
            at = name.removesuffix("eccentricity")
            if name != at and f"{at}penetration_ratio" in self.values:
                # Their length is the clearance and the penetration.
                depth = 1 + np.asarray(self[f"{at}penetration_ratio"])[:, None]
                length = np.linalg.norm(self[name], axis=1, keepdims=True)
                ways.append(np.asarray(self[name]) * depth / np.where(length > 0, length, 1.0))
        return svg.pins_in_bores(ways) if ways else ""

    @made_of("penetration_ratio")
    def contact_fraction(self) -> Float[Array, "*batch"]:
        """The share of the given times at which pin and bore touch."""
        return jnp.mean((self["penetration_ratio"] > 0).astype(float), axis=-1)


def simulate(
    scene: Scene,
    times: ArrayLike | Sequence[float],
    *,
    outputs: tuple[str, ...] | None = None,
    state: Float[ArrayLike, " dims"] | None = None,
    rtol: float | Scalar = 1e-11,
    method: Method = Method(),
) -> Trajectory:
    """Simulate from time zero and report at `times`.

    **Arguments:**

    - `scene`: what to simulate; its numbers may be traced.
    - `times`: shape (times,), in s, increasing, not negative.
    - `outputs`: the names of what to compute, any of `scene.observables` and `energy`; the rest is
      neither computed nor traced. None is all that the scene has.
    - `state`: at time zero, in place of the scene's start: shape (dims,), with the shaft at angle
      zero, as `Statistics.state` and `Section.state` have it.
    - `rtol`: tolerance of a step, in clearances and m/s. With 1e-11, forces over the first 20 ms of
      impacts are right to 1e-6. At 30 ms errors have grown like exp(200 t), to 1e-4 of the largest
      force at worst, and with 1e-9 to 4e-3 (`benchmarks/crosschecks.py`).
    - `method`: solver, step-size controller, bounds and adjoint, see `jaxcrusher.Method`.

    **Returns:** a `Trajectory`.

    Raises ValueError for unordered, negative or not finite times, outputs that the
    scene does not have, and a state of another shape. A failed integration does not
    raise: see `Trajectory.success` and `.failure`. Warns of derivatives as `statistics` does.
    """
    require_set_up()
    require_times(times)
    how = resolve(scene, rtol, method, FIRST_STEP)
    outputs = (*scene.observables, "energy") if outputs is None else outputs
    scene.require_outputs(outputs, scene.observables, "energy")
    found = _simulate(scene, jnp.asarray(times, dtype=float), state, how, tuple(outputs))
    start = scene.drive.crank(jnp.zeros(()), scene.drive.initial())
    warn_of_slopes(found, found.outcome, start.speed)
    return found


def require_times(times: ArrayLike | Sequence[float]) -> None:
    """Check that times are one-dimensional, finite, increasing and not negative."""
    known = concrete(times)
    if known is None:
        return
    require(known.ndim == 1 and known.size > 0, "times", "have shape (n,), n > 0", known.shape)
    bad = ~np.isfinite(known) | (known < 0)
    require(not bad.any(), "times", "be finite and >= 0 s", known[bad][:1])
    step = known[1:] - known[:-1]
    require(bool((step > 0).all()), "times", "increase", f"{known[1:][step <= 0][:1]} s after more")


@eqx.filter_jit
def _simulate(
    scene: Scene,
    times: Array,
    state: ArrayLike | None,
    method: Integration,
    outputs: tuple[str, ...],
) -> Trajectory:
    flow, problem = Flow(scene, unflattened(state, scene)), _problem(outputs)
    seen, outcome = integrate(flow, times[None], problem=problem, method=method)
    values = jax.tree.map(lambda leaf: leaf[0], seen)
    return Trajectory(times, outcome, values, tuple(scene.observables.items()))


@functools.cache  # so that programs of other counts share its trace
def _problem(outputs: tuple[str, ...]) -> InitialValueProblem:
    """Observe the named outputs, in real time."""

    def works(scene: Scene) -> dict[str, Callable]:
        return _works(scene) if "energy" in outputs else {}

    def initial(flow: Flow) -> Carried:
        return Carried(flow.initial(), dict.fromkeys(works(flow.scene), jnp.zeros(())))

    def field(time: Scalar, y: Carried, flow: Flow) -> Carried:
        formulation, scene = flow.scene.formulation, flow.scene
        snapshot = formulation.snapshot(time, y.motion, scene)
        powers = {name: power(snapshot, scene) for name, power in works(scene).items()}
        return Carried(formulation.rate(snapshot, y.motion, scene), powers)

    def observe(time: Scalar, y: Carried, flow: Flow) -> dict[str, PyTree]:
        snapshot = flow.scene.formulation.snapshot(time, y.motion, flow.scene)

        def seen(name: str) -> PyTree:
            if name != "energy":
                return flow.scene.observables[name](snapshot, flow.scene)
            stored = {name: energy(snapshot, flow.scene) for name, energy in ENERGIES.items()}
            return Energy(**stored, **y.totals)

        return {name: seen(name) for name in outputs}

    return InitialValueProblem(initial, field, observe, lambda observed, end, kept: observed)


def headline_force(scene: Scene) -> str:
    """Return the observable that pictures show."""
    return next(name for name in LEADING_FORCES if name in scene.observables)
