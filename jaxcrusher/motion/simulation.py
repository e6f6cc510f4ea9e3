"""Simulate a scene and look at it at given times."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, PyTree, Scalar

from jaxcrusher.basics.checks import (
    concrete,
    require,
    require_choice,
    require_x64,
)
from jaxcrusher.crusher import observables
from jaxcrusher.crusher.observables import OBSERVABLES
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.motion.integrate import (
    RESULTS,
    Carried,
    Integration,
    Outcome,
    Problem,
    integrate,
)
from jaxcrusher.motion.method import Method, resolve

FIRST_STEP = 1e-6  # s

# The powers whose time integrals, with the energies, make the ledger.
WORKS = {
    "drive_work": observables.drive_power,
    "load_work": observables.load_power,
    "contact_loss": observables.contact_loss,
    "friction_loss": observables.friction_loss,
}
ENERGIES = {
    "kinetic": observables.kinetic_energy,
    "potential": observables.potential_energy,
    "elastic": observables.elastic_energy,
}
# What `simulate` can report; units stand in `jaxcrusher.crusher.observables.OBSERVABLES`.
OUTPUTS = (*OBSERVABLES, "energy")


class Energy(eqx.Module):
    """The energy ledger: energies, and work since time zero, all in J, shape (times,)."""

    kinetic: Float[Array, " times"]
    potential: Float[Array, " times"]
    elastic: Float[Array, " times"]
    drive_work: Float[Array, " times"]
    load_work: Float[Array, " times"]
    contact_loss: Float[Array, " times"]
    friction_loss: Float[Array, " times"]

    @property
    def imbalance(self) -> Float[Array, " times"]:
        """What the ledger fails to account for since the first time, J: ideally zero."""
        stored = self.kinetic + self.potential + self.elastic
        balance = stored - self.drive_work - self.load_work
        balance = balance + self.contact_loss + self.friction_loss
        return balance - balance[0]


class Trajectory(eqx.Module):
    """A motion at given times; forces in N, lengths in m, what was not asked for is None.

    Vectors have shape (times, 2), x to the right and y up. A failed simulation has
    `success` False, NaN from the failure on, and says why in `failure`.
    """

    time: Float[Array, " times"]  # s
    outcome: Outcome
    normal_force: Float[Array, " times"] | None = None  # F_n at A
    friction_force: Float[Array, " times"] | None = None  # F_t at A, on the jaw
    foundation_force: Float[Array, " times"] | None = None  # |R_O| + |R_C|
    net_foundation_force: Float[Array, " times"] | None = None  # |R_O + R_C|
    shaking_force: Float[Array, "times 2"] | None = None
    joint_force: Float[Array, "times 2"] | None = None  # on the jaw at A
    bearing_reaction: Float[Array, "times 2"] | None = None  # R_O, on the shaft
    elbow_reaction: Float[Array, "times 2"] | None = None  # R_B, on the jaw
    toggle_reaction: Float[Array, "times 2"] | None = None  # R_C, on the toggle
    drive_torque: Float[Array, " times"] | None = None  # N m
    drive_power: Float[Array, " times"] | None = None  # W
    shaft_speed: Float[Array, " times"] | None = None  # rad/s
    eccentricity: Float[Array, "times 2"] | None = None  # A_shaft - A_jaw
    penetration_ratio: Float[Array, " times"] | None = None  # delta / c, negative in flight
    penetration_rate: Float[Array, " times"] | None = None  # delta', m/s
    crushing_load: Float[Array, "times 2"] | None = None  # on the jaw at S2
    pin_position: Float[Array, "times 2"] | None = None  # A, the centre of the shaft's pin
    jaw_position: Float[Array, "times 2"] | None = None  # of its lower end B
    jaw_mass_centre: Float[Array, "times 2"] | None = None  # S2
    jaw_velocity: Float[Array, "times 2"] | None = None  # of B, m/s
    constraint_residual: Float[Array, " times"] | None = None  # multiplier form, m or rad
    energy: Energy | None = None

    @property
    def success(self) -> Array:
        """Whether the integration came to its end."""
        return self.outcome.success

    @property
    def failure(self) -> str:
        """Why and when (s) the integration stopped, or nothing (concrete values only)."""
        return failure_text(self.outcome, "s")

    @property
    def jaw_displacement(self) -> Array:
        """The displacement of B since the first time, shape (times, 2), m."""
        if self.jaw_position is None:
            raise ValueError("Argument `outputs` must contain 'jaw_position', but does not.")
        return self.jaw_position - self.jaw_position[0]

    @property
    def contact_fraction(self) -> Array:
        """The share of the given times at which pin and bore touch."""
        if self.penetration_ratio is None:
            raise ValueError("Argument `outputs` must contain 'penetration_ratio', but does not.")
        return jnp.mean((self.penetration_ratio > 0).astype(float))


def failure_text(outcome: Outcome, unit: str) -> str:
    """One line on a failed integration, empty for one that succeeded."""
    if bool(outcome.success):
        return ""
    reason = " ".join(str(RESULTS[outcome.result]).split())
    return f"stopped at {float(outcome.reached):.6g} {unit}: {reason}"


def simulate(
    scene: Scene,
    times: ArrayLike,
    *,
    outputs: tuple[str, ...] = OUTPUTS,
    rtol: float = 1e-11,
    method: Method = Method(),
) -> Trajectory:
    """Simulate from time zero and report at `times`.

    **Arguments:**

    - `scene`: what to simulate; its numbers may be traced.
    - `times`: shape (times,), in s, increasing, not negative.
    - `outputs`: the names of what to compute, any of `jaxcrusher.OUTPUTS`; the rest is
      neither computed nor traced.
    - `rtol`: tolerance of a step, in clearances and m/s. Forces over the first 20 ms of impacts
      are right to 1e-6 at 1e-11; at 30 ms, where errors have grown like exp(200 t), to 1e-4 of
      the largest force at worst, and to 4e-3 at 1e-9 (`benchmarks/crosschecks.py`).
    - `method`: solver, step-size controller, bounds and adjoint, see `jaxcrusher.Method`.

    **Returns:** a `Trajectory`.

    Raises ValueError for unordered, negative or not finite times and for unknown outputs. A
    failed integration does not raise: see `Trajectory.success` and `.failure`.
    """
    require_x64()
    require_times(times)
    for name in outputs:
        require_choice("outputs", name, OUTPUTS)
    how = resolve(scene, rtol, method, FIRST_STEP)
    return _simulate(scene, jnp.asarray(times, dtype=float), how, tuple(outputs))


def require_times(times: ArrayLike) -> None:
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
    scene: Scene, times: Array, method: Integration, outputs: tuple[str, ...]
) -> Trajectory:
    problem = _problem(outputs)
    values, outcome = integrate(scene, times[None], problem=problem, method=method)
    return Trajectory(times, outcome, **{name: _first(value) for name, value in values.items()})


def _first(value: PyTree) -> PyTree:
    """Drop the axis of the one segment."""
    if isinstance(value, dict):
        return Energy(**{name: leaf[0] for name, leaf in value.items()})
    return value[0]


def _problem(outputs: tuple[str, ...]) -> Problem:
    """Observe the named outputs, in real time."""
    with_energy = "energy" in outputs
    names = [name for name in outputs if name != "energy"]

    def initial(scene: Scene) -> Carried:
        totals = {name: jnp.zeros(()) for name in WORKS} if with_energy else {}
        return Carried(scene.formulation.initial(scene), totals)

    def field(time: Scalar, y: Carried, scene: Scene) -> Carried:
        snapshot = scene.formulation.snapshot(time, y.motion, scene)
        powers = {name: WORKS[name](snapshot, scene) for name in y.totals}
        return Carried(scene.formulation.rate(snapshot, y.motion, scene), powers)

    def observe(time: Scalar, y: Carried, scene: Scene) -> dict[str, PyTree]:
        snapshot = scene.formulation.snapshot(time, y.motion, scene)
        seen: dict[str, PyTree] = {name: OBSERVABLES[name](snapshot, scene) for name in names}
        if with_energy:
            stored = {name: energy(snapshot, scene) for name, energy in ENERGIES.items()}
            seen["energy"] = stored | y.totals
        return seen

    return Problem(initial, field, observe, lambda observed, totals: observed)
