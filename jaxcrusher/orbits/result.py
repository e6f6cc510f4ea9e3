"""A periodic orbit: what is known of it, however it was found, and the one way to make it."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Complex, Float, PyTree, Scalar
from typing_extensions import override

from jaxcrusher.basics.checks import (
    all_finite,
    is_concrete,
    nan_unless,
    require,
    require_own_process,
)
from jaxcrusher.basics.record import words
from jaxcrusher.files import svg
from jaxcrusher.files.summary import Row, range_of, value_text
from jaxcrusher.files.text import with_error
from jaxcrusher.joint.validity import Validity
from jaxcrusher.mechanism.eccentricity import EccentricityState
from jaxcrusher.mechanism.reductions import SAMPLES
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.snapshot import Observable
from jaxcrusher.motion.named import AbstractNamed
from jaxcrusher.motion.names import StatisticNames
from jaxcrusher.motion.simulation import headline_force, simulate
from jaxcrusher.motion.statistics import Statistics, limits_of
from jaxcrusher.motion.turns import Turns
from jaxcrusher.orbits import forced
from jaxcrusher.periodic import newton
from jaxcrusher.periodic.multipliers import largest, undecided
from jaxcrusher.periodic.trigonometric import evaluate

# Tolerance of the motion along an orbit that is shot for.
FINE = 1e-9
# Instants a turn of the force in a small picture.
PICTURED = 128


class RESULTS(newton.RESULTS):  # pyright: ignore
    """How Newton's method ended, or why its root is no orbit."""

    contact_lost = "The motion loses contact, which these nodes do not resolve."
    unresolved = "The motion is not resolved by these nodes."
    not_closed = "The motion does not repeat when it is integrated over its period."
    impacts = "The motion goes on losing contact, and each impact sets its tracked velocity anew."
    not_integrated = "The motion from rest cannot be integrated."
    too_long = "The motion from rest takes more steps a turn than this effort waits for."
    whirl = "The motion from rest is a friction whirl: the pin rolls round its bore."
    repeats_1 = "The motion from rest repeats after each turn."
    repeats_2 = "The motion from rest repeats after 2 turns."
    repeats_3 = "The motion from rest repeats after 3 turns."
    repeats_4 = "The motion from rest repeats after 4 turns."
    repeats_late = "The motion from rest repeats after 5 to 32 turns."
    chaotic = "The motion from rest is chaotic: disturbances of it grow."
    unsettled = "The motion from rest has not settled within the wait: its spread still changes."
    quasi_periodic = "The motion from rest looks quasi-periodic: it does not repeat or settle."
    aperiodic = "The motion from rest does not repeat within the wait, and is not chaotic."


class WAYS(eqx.Enumeration):  # pyright: ignore
    """How an orbit was found."""

    sum = "as a sum over a turn: there is nothing to solve for"
    rest = "from the pins at rest"
    guess = "from a guess"
    neighbour = "from a stable orbit of a neighbour"
    damping = "from the pins at rest, by a damping lowered to none"
    waiting = "from the mean of turns that were waited for"
    shooting = "by shooting"
    unresolved = "from a motion that nodes did not resolve"
    doubling = "from an unstable orbit of half the turns, whose period has doubled"
    branch = "along a branch"


class PeriodicOrbit(AbstractNamed, eqx.Module, StatisticNames):
    """A motion that repeats after `period` turns, and its statistics by name.

    `orbit.foundation_rms` and so on: the scene's `statistics` have units and
    meanings. A failed search has `success` False, NaN in
    every number, and says why in `failure`. Slopes of a failure are NaN, and so are slopes of the
    multipliers and of what follows from them.
    """

    scene: Scene
    period: int = eqx.field(static=True)  # turns
    # e / c at equal steps of phase: x and y of each joint with clearance, A, B, C; behind
    # them x, y and rotation of a frame on supports, in the units of its state. None: no state
    eccentricity: Float[Array, "nodes dims"] | None
    section: Float[Array, " states"]  # the state at phase zero: a section point
    result: RESULTS
    steps: Array  # Newton's
    values: Mapping[str, Scalar]  # statistics
    error: Scalar  # estimated, of the RMS as a share of it
    # Least delta / c at any dry joint: contact is kept if > 0. Infinite where none can be lost.
    least_penetration: Scalar
    multipliers: Complex[Array, " n"]  # of a disturbance, in one period: 4 a loose joint
    multipliers_error: Scalar  # estimated, of their moduli; infinite where nothing is known of it
    # by what a motion that begins on the orbit misses its beginning after a period, in clearances
    # and m/s, estimated; zero where the integrator has closed it
    closure: Scalar
    validity: Validity
    way: WAYS
    # m/s, by joint that tracks its impact velocity: what it comes to, and is held at, one for each
    # corner of a slider; None: not tracked
    frozen_impact_velocities: Mapping[str, Float[Array, "*touches"]] | None = None
    # what the motion from the pins at rest does, if it was waited for and led to no stable orbit,
    # and its headline statistic over the last half of the turns that were waited for
    from_rest: RESULTS | None = None
    run: Statistics | None = None
    # what was tried for an orbit that was not found, in words
    tried: str = eqx.field(static=True, default="")

    @override
    def units(self) -> dict[str, str]:
        return {name: one.unit for name, one in self.scene.statistics.items()}

    @property
    @override
    def success(self) -> Bool[Array, "*batch"]:
        """Whether this is an orbit."""
        return self.result == RESULTS.successful

    @property
    @override
    def failure(self) -> str:
        """Say why there is no orbit, and what was tried; nothing if there is one.

        Concrete values only.
        """
        if bool(self.success):
            return ""
        return " ".join(filter(None, (words(RESULTS, self.result), self._run(), self.tried)))

    @property
    def found(self) -> str:
        """Say by which way the orbit was found (concrete values only)."""
        held = self.frozen_impact_velocities or {}
        said = [
            f"{', '.join(f'{one:.4g}' for one in np.ravel(v))} m/s at the {name} joint"
            for name, v in held.items()
        ]
        kept = f", with the tracked impact velocity held at {', '.join(said)}" if said else ""
        return words(WAYS, self.way) + kept

    @property
    def alike(self) -> dict[str, Any]:
        """Return the arguments by which `periodic_orbit` finds this orbit after a small change.

        Concrete values of one orbit only.
        """
        require_one(self)
        if bool(self.way == WAYS.shooting):
            return {"period": self.period, "method": "shooting", "guess": self}
        nodes = None if self.eccentricity is None else len(self.eccentricity) // self.period
        how = {"period": self.period, "nodes": nodes}
        # From rest the same program finds it again; from elsewhere another orbit might be found.
        found = (self.way == WAYS.sum) | (self.way == WAYS.rest) | (self.way == WAYS.damping)
        return how if bool(found) else how | {"guess": self}

    @property
    def largest_multiplier(self) -> Float[Array, "*batch"]:
        """Return the largest modulus of the multipliers."""
        return largest(self.multipliers)

    @property
    def stable(self) -> Bool[Array, "*batch"]:
        """Whether disturbances are known to die.

        Where it is False disturbances grow, unless the orbit is `undecided`.
        """
        return self.success & (self.largest_multiplier < 1) & ~self.undecided

    @property
    def undecided(self) -> Bool[Array, "*batch"]:
        """Whether it is unknown if disturbances of this orbit die.

        Its largest multiplier is 1 within `multipliers_error`.
        """
        return self.success & undecided(self.multipliers, self.multipliers_error)

    @property
    def settling_turns(self) -> Float[Array, "*batch"]:
        """Return the turns in which a disturbance falls to 1/e in the end; infinite if it grows."""
        largest = self.largest_multiplier
        return jnp.where(largest >= 1, jnp.inf, -self.period / jnp.log(largest))

    @property
    def instability(self) -> str:
        """Say how disturbances of an orbit grow, or that it is not known (concrete values only).

        Empty if they die. It also says what the motion from the pins at rest does instead, if it
        was integrated.
        """
        require_one(self)
        if not bool(self.success) or bool(self.stable):
            return ""
        instead = "" if self.from_rest is None else words(RESULTS, self.from_rest)
        return " ".join(filter(None, (self._growth(), instead, self._run())))

    def _run(self) -> str:
        """Say how large the headline statistic of the motion from rest is."""
        if self.run is None or not bool(self.run.success):
            return ""
        name = self.scene.headline
        value, error = float(self.run[name]), float(self.run.standard_error(name))
        unit = self.scene.statistics[name].unit
        return f"Its RMS is {with_error(value, error)} {unit} over {self.run.turns} turns."

    def _growth(self) -> str:
        """Say how disturbances of an orbit grow that is not known to be stable."""
        error = float(self.multipliers_error)
        if not error < 1:
            return "Its multipliers are not known. Disturbances of it may die or grow."
        largest = max(np.asarray(self.multipliers).tolist(), key=abs)
        if bool(self.undecided):
            return f"Its largest multiplier is 1 within the error of multipliers, {error:.1g}."
        if largest.imag:
            return (
                f"A pair of multipliers has a modulus of {abs(largest):.6g}: disturbances grow "
                "while they turn round the orbit, and the motion may be quasi-periodic."
            )
        if largest.real < 0:
            return (
                f"Its largest multiplier is {largest.real:.6g}: disturbances change sides each "
                f"period and grow, so the motion repeats after {2 * self.period} turns or more."
            )
        return f"Its largest multiplier is {largest.real:.6g}: disturbances grow to one side."

    @override
    def _entries(self) -> Mapping[str, Any]:
        return self.scene.statistics

    @override
    def _headline(self) -> str:
        is_stable = "stable" if self.stable else "UNDECIDED" if self.undecided else "UNSTABLE"
        turns = "each turn" if self.period == 1 else f"after {self.period} turns"
        return f"{is_stable}, repeats {turns}, {self.validity.verdict()}"

    @override
    def _counted(self) -> Mapping[str, Any]:
        return {"stable": self.stable, "inside the contact model": self.validity.inside}

    @override
    def _rows(self) -> list[Row]:
        scene, error = self.scene, np.asarray(self.error * abs(self.values[self.scene.headline]))
        usual = (scene.headline, *(n for n in scene.usual_statistics if n != scene.headline))
        errors = {} if error.ndim else {scene.headline: float(error)}
        rows = self._rows_of((name for name in usual if name in self.values), errors)
        if not scene.has_unknowns:
            return rows
        kept = "penetration over clearance: contact is kept above 0"
        return [
            *rows,
            Row("least_penetration", value_text(self.least_penetration, "1"), kept),
            Row(
                "largest_multiplier",
                value_text(self.largest_multiplier, "1", self._multiplier_error()),
            ),
            Row(
                "settling_turns",
                value_text(self.settling_turns, "turns"),
                "to 1/e of a disturbance",
            ),
        ]

    def _multiplier_error(self) -> float:
        known = np.asarray(self.multipliers_error)
        return np.nan if known.ndim else float(known)

    @override
    def _remarks(self) -> list[str]:
        return list(filter(None, (f"Found {self.found}.", self.instability)))

    @override
    def _picture(self) -> str:
        """Return the pins in their bores, and the headline force over the period."""
        if not self._is_one:
            return ""
        name, scene = headline_force(self.scene), self.scene
        phases = np.linspace(0, 2 * np.pi * self.period, PICTURED * self.period)
        clearances = {
            f"{scene.prefix(joint)}eccentricity": float(bearing.clearance)
            for joint, bearing in scene.bearings.items()
        }
        seen = self.motion(phases, (name, *clearances))
        forces = np.asarray(seen[name])
        forces = np.linalg.norm(forces, axis=1) if forces.ndim > 1 else forces
        drawn = svg.curve(phases, forces, f"{name}, {range_of(forces, 'N')}, over the period")
        pins = [np.asarray(seen[path]) / size for path, size in clearances.items()]
        return (svg.pins_in_bores(pins) if pins else "") + drawn

    def state(self, angle: ArrayLike = 0.0) -> EccentricityState:
        """Return where the motion is at a phase (rad); it may be handed to a formulation.

        The phase is omega t, the shaft's angle at its mean speed, through all turns of the period.
        Raises ValueError for a batch of orbits, which `jax.vmap` takes, and for a bearing with a
        memory, whose state is in `section`.
        """
        require_own_process()
        require_one(self)
        require(self.eccentricity is not None, "scene", "have a clearance joint", "an ideal one")
        must = "have bearings without a memory: see `PeriodicOrbit.section`"
        require(not forced.remembers(self.scene), "scene", must, "with one")
        return _state(self, jnp.asarray(angle, dtype=float))

    def motion(
        self, angles: Float[ArrayLike, " n"], outputs: tuple[str, ...] | None = None
    ) -> dict[str, Array]:
        """Return observables at any phases (rad), by name, shape (n,) or (n, 2).

        A phase is omega t, the shaft's angle at its mean speed, through all turns of the period.

        `outputs` of None are all observables. Where a bearing has a memory, the motion is
        integrated from `section` on, up to phases that are known. Raises ValueError for a name that
        its `observables` lack, and for a batch of orbits.
        """
        require_own_process()
        require_one(self)
        known = self.scene.observables
        outputs = tuple(known) if outputs is None else outputs
        self.scene.require_outputs(outputs, known)
        if forced.remembers(self.scene):
            return _integrated(self, angles, outputs)
        entries = tuple((name, known[name]) for name in outputs)
        return observables_along(self, jnp.asarray(angles, dtype=float), entries)


def require_one(orbit: PeriodicOrbit) -> None:
    """Check that it is one orbit, and no batch as `jax.vmap` returns it."""
    require(orbit.success.ndim == 0, "orbit", "be one orbit", f"a batch {orbit.success.shape}")


def built(
    scene: Scene,
    period: int,
    path: Float[Array, "nodes dims"] | None,
    section: Float[ArrayLike, " states"],
    values: Mapping[str, Scalar],
    *,
    result: RESULTS,
    error: Scalar,
    least_penetration: Scalar,
    multipliers: ArrayLike,
    multipliers_error: ArrayLike,
    way: WAYS,
    closure: ArrayLike = 0.0,
    steps: ArrayLike = 0,
) -> PeriodicOrbit:
    """Return an orbit; its statistics tell the limits of the contact model.

    A scene with a number that is not finite, as one outside its limits becomes, has no orbit.
    """
    result = RESULTS.where(all_finite(scene), result, RESULTS.promote(newton.RESULTS.not_finite))
    return PeriodicOrbit(
        scene,
        period,
        path,
        jnp.asarray(section, float),
        result,
        jnp.asarray(steps),
        values,
        error,
        least_penetration,
        jnp.asarray(multipliers, complex),
        jnp.asarray(multipliers_error, float),
        jnp.asarray(closure, float),
        limits_of(scene, values),
        way,
    )


@eqx.filter_jit
def missing(scene: Scene, period: int, result: RESULTS) -> PeriodicOrbit:
    """Return a failed orbit, for a reason: NaN in every number."""
    nan, dims = jnp.asarray(jnp.nan), forced.states(scene)
    return built(
        scene,
        period,
        jnp.full((SAMPLES * period, forced.unknowns(scene)), jnp.nan),
        jnp.full(dims, jnp.nan),
        dict.fromkeys(scene.statistics, nan),
        result=result,
        error=nan,
        least_penetration=nan,
        multipliers=jnp.full(dims, jnp.nan),
        multipliers_error=nan,
        way=WAYS.shooting,
    )


@eqx.filter_jit
def _state(orbit: PeriodicOrbit, phase: Scalar) -> EccentricityState:
    assert orbit.eccentricity is not None
    place = phase / (2 * np.pi * orbit.period)
    rate = evaluate(orbit.eccentricity, place, 1) / orbit.period
    return forced.state(evaluate(orbit.eccentricity, place), rate, orbit.scene)


def _integrated(
    orbit: PeriodicOrbit, angles: Float[ArrayLike, " n"], outputs: tuple[str, ...]
) -> dict[str, Array]:
    """Return observables at phases (rad), of the motion that begins on the orbit's section."""
    period = 2 * np.pi * orbit.period
    # The end of a period is not its beginning, for whoever asks up to there.
    phases = np.asarray(angles, float)
    within = np.where(phases == period, period, phases % period)
    places, order = np.unique(within, return_inverse=True)
    times = places / orbit.scene.drive.speed
    found = simulate(orbit.scene, times, outputs=outputs, state=orbit.section, rtol=FINE)
    return {name: jnp.asarray(found[name])[order] for name in outputs}


@eqx.filter_jit
def observables_along(
    orbit: PeriodicOrbit, phases: Float[Array, " n"], entries: tuple[tuple[str, Observable], ...]
) -> dict[str, Array]:
    """Return observables at phases (rad) of an orbit, by the names of their entries."""

    def look(phase: Scalar) -> dict[str, Array]:
        scene = orbit.scene.steady()
        still = orbit.eccentricity is None
        state = scene.formulation.initial(scene) if still else _state(orbit, phase)
        snapshot = scene.formulation.snapshot(phase / scene.drive.speed, state, scene)
        return {name: one(snapshot, scene) for name, one in entries}

    return jax.vmap(look)(phases)


def turns_of(orbit: PeriodicOrbit, entries: Mapping[str, Observable]) -> Turns:
    """Return observables at `SAMPLES` instants a turn of an orbit: a piece that repeats."""
    phases = 2 * np.pi / SAMPLES * jnp.arange(SAMPLES * orbit.period, dtype=float)
    seen = observables_along(orbit, phases, tuple(entries.items()))
    return Turns(orbit.scene, orbit.period, {name: seen[name][None] for name in entries})


def finished(
    orbit: PeriodicOrbit,
    scene: Scene,
    frozen_impact_velocities: Mapping[str, Float[Array, "*touches"]] | None = None,
) -> PeriodicOrbit:
    """Return the orbit of `scene` as it is handed out: NaN in all numbers and slopes of a failure.

    Slopes of multipliers and errors are NaN too. They are computed without slopes, and a slope of
    zero would be wrong.
    """
    # Programs are compiled for each of the words that they are handed.
    tried, run, orbit = orbit.tried, orbit.run, dataclasses.replace(orbit, tried="", run=None)
    if not is_concrete(scene):
        orbit = _masked_with_slopes(orbit, scene)
    elif not (is_concrete(orbit.result) and bool(orbit.success)):
        orbit = _masked(orbit)
    fields = {"frozen_impact_velocities": frozen_impact_velocities, "tried": tried, "run": run}
    return dataclasses.replace(orbit, scene=scene, **fields)


@eqx.filter_jit
def _masked(orbit: PeriodicOrbit) -> PeriodicOrbit:
    numbers, others = eqx.partition(orbit, eqx.is_inexact_array)
    return eqx.combine(nan_unless(orbit.success, numbers), others)


@eqx.filter_jit  # one program for all numbers: one by one they took most of an eager gradient
def _masked_with_slopes(orbit: PeriodicOrbit, scene: Scene) -> PeriodicOrbit:
    own = _masked(orbit)
    own = _sloped_if(own.success, own, scene)
    names = ("error", "multipliers", "multipliers_error")
    bare = {name: getattr(own, name) for name in names}
    return dataclasses.replace(own, **_sloped_if(None, bare, scene))


def _sloped_if(good: Bool[Array, ""] | None, tree: PyTree, scene: Scene) -> PyTree:
    """Return the numbers of a tree, whose slopes by those of `scene` are NaN unless `good`.

    None is never.
    """
    leaves = [leaf for leaf in jax.tree.leaves(scene) if eqx.is_inexact_array(leaf)]
    total = sum(map(jnp.sum, leaves), jnp.zeros(()))
    numbers, others = eqx.partition(tree, eqx.is_inexact_array)
    return eqx.combine(jax.tree.map(lambda leaf: _marked(leaf, good, total), numbers), others)


@jax.custom_jvp
def _marked(number: Array, good: Bool[Array, ""] | None, total: Scalar) -> Array:
    return number


@_marked.defjvp
def _marked_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    number, good, _ = primals
    slope, _, by_scene = tangents
    # A constant where it is known: a slope that nobody asks for is then not computed.
    added = jnp.nan if good is None else jnp.where(good, 0.0, jnp.nan)
    return number, slope + (added * by_scene).astype(slope.dtype)
