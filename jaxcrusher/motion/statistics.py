"""Statistics of a motion over whole turns, integrated or sampled along with it."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree, Scalar

from jaxcrusher.basics.checks import require, require_choice, require_whole, require_x64
from jaxcrusher.basics.plane import Vector
from jaxcrusher.basics.smooth import norm
from jaxcrusher.crusher.observables import FORCE_WIDTH, OBSERVABLES, drive_power, foundation_force
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.crusher.snapshot import Snapshot
from jaxcrusher.joint.validity import Validity, validity
from jaxcrusher.motion.integrate import Carried, Integration, Outcome, Problem, integrate
from jaxcrusher.motion.method import Method, resolve
from jaxcrusher.motion.simulation import failure_text

# What `statistics` computes if not told otherwise; units stand at the fields of `Statistics`.
STATISTICS = (
    "foundation_rms",
    "foundation_mean",
    "foundation_peak",
    "contact_fraction",
    "penetration_ratio",
    "impact_speed",
    "winding",
)
# What may be asked for besides.
FURTHER_STATISTICS = ("foundation_smooth_peak", "joint_peak", "sliding_power", "drive_power")

# The smooth peak is the mean of this power, to its root: within 20 % of a peak that lasts 5 % of
# a turn, and differentiable where the instant of the peak jumps.
PEAK_POWER = 16

# Instants per turn at which peaks and contact are looked at.
SAMPLES = 1024

# Friction whirl: the pin rolls round the bore, in contact, hundreds of times a turn. A pin
# that rests in the bore follows the joint force, which goes round at most once or twice.
WHIRL_CONTACT = 0.99
WHIRL_WINDING = 10.0


class Statistics(eqx.Module):
    """Statistics over the turns after settling; what was not asked for is None.

    A failed run has `success` False, NaN in every number, and says why in `failure`.
    """

    turns: int = eqx.field(static=True)
    outcome: Outcome
    foundation_rms: Scalar | None = None  # of |R_O| + |R_C|, N
    foundation_mean: Scalar | None = None  # N
    foundation_peak: Scalar | None = None  # N
    contact_fraction: Scalar | None = None
    penetration_ratio: Scalar | None = None  # largest delta / c
    impact_speed: Scalar | None = None  # fastest approach of pin and bore, m/s
    winding: Scalar | None = None  # revolutions of the pin round the bore per turn
    foundation_smooth_peak: Scalar | None = None  # (mean of |R_O| + |R_C| to the 16th)^(1/16), N
    joint_peak: Scalar | None = None  # largest force in the main bearing, N
    sliding_power: Scalar | None = None  # mean of F_n |surface slip|, W: Archard's wear rate
    drive_power: Scalar | None = None  # mean, W
    turn_mean_square: Float[Array, " turns"] | None = None  # of each turn, N^2
    validity: Validity | None = None  # with penetration_ratio and impact_speed; None if ideal

    @property
    def success(self) -> Bool[Array, ""]:
        """Whether the integration came to its end."""
        return self.outcome.success

    @property
    def failure(self) -> str:
        """Why and when the integration stopped, or nothing (concrete values only)."""
        return failure_text(self.outcome, "rad of shaft angle")

    @property
    def whirl(self) -> Bool[Array, ""]:
        """Whether the motion is a friction whirl: the pin rolls backwards round the bore.

        Its penetrations, of the order of the clearance, are outside Hertz's theory.
        """
        if self.contact_fraction is None or self.winding is None:
            raise ValueError(
                "Argument `outputs` must contain 'contact_fraction' and 'winding', but does not."
            )
        return (self.contact_fraction > WHIRL_CONTACT) & (self.winding < -WHIRL_WINDING)

    @property
    def foundation_rms_error(self) -> Scalar:
        """Standard error of the RMS (N), from the scatter of up to ten batches of turns.

        Right for turns that are independent from batch to batch; infinite for one turn.
        """
        if self.turn_mean_square is None or self.foundation_rms is None:
            raise ValueError("Argument `outputs` must contain 'foundation_rms', but does not.")
        batches = min(10, self.turns)
        if batches == 1:
            return jnp.full_like(self.foundation_rms, jnp.inf)
        length = self.turns // batches
        used = self.turn_mean_square[..., : batches * length]
        means = jnp.mean(used.reshape(*used.shape[:-1], batches, length), axis=-1)
        scatter = jnp.std(means, axis=-1, ddof=1) / math.sqrt(batches)
        return scatter / (2 * self.foundation_rms)


def statistics(
    scene: Scene,
    settle_turns: int,
    turns: int,
    *,
    outputs: tuple[str, ...] = STATISTICS,
    rtol: float = 1e-9,
    method: Method = Method(),
) -> Statistics:
    """Statistics over `turns` turns of the shaft, after `settle_turns` turns.

    **Arguments:**

    - `scene`: what to simulate; its numbers may be traced.
    - `settle_turns`, `turns`: whole numbers, >= 0 and >= 1.
    - `outputs`: any of `jaxcrusher.STATISTICS` and `FURTHER_STATISTICS`; the rest is neither
      computed nor traced.
    - `rtol`, `method`: as in `jaxcrusher.simulate`, with time in radians of shaft angle and
      steps counted per turn.

    **Returns:** a `Statistics`. RMS and mean are integrated with the motion; the rest is
    seen at 1024 instants a turn, the peak as the top of a parabola through three of them.

    Raises ValueError for counts that are not whole numbers in range, unknown outputs, and a
    sliding power asked of a scene without friction.
    """
    require_x64()
    require_whole("settle_turns", settle_turns, 0)
    require_whole("turns", turns, 1)
    for name in outputs:
        require_choice("outputs", name, (*STATISTICS, *FURTHER_STATISTICS))
    if "sliding_power" in outputs:
        slides = scene.joint is not None and scene.joint.friction is not None
        require(slides, "outputs", "not ask for sliding_power without friction", outputs)
    how = resolve(scene, rtol, method)
    return _statistics(scene, settle_turns, turns, tuple(outputs), how)


@eqx.filter_jit
def _statistics(
    scene: Scene, settle_turns: int, turns: int, outputs: tuple[str, ...], method: Integration
) -> Statistics:
    grid = jnp.arange(1, SAMPLES + 1) / SAMPLES if sampled_observables(outputs) else jnp.ones(1)
    times = 2 * jnp.pi * (jnp.arange(settle_turns + turns)[:, None] + grid)
    by_turn, outcome = integrate(scene, times, problem=statistics_problem(outputs), method=method)
    kept = {name: values[settle_turns:] for name, values in by_turn.items()}
    largest = ("foundation_peak", "penetration_ratio", "impact_speed", "joint_peak")
    reduce = dict.fromkeys(largest, jnp.max)
    values = {name: reduce.get(name, jnp.mean)(turn) for name, turn in kept.items()}
    failed = ~outcome.success
    values = {name: jnp.where(failed, jnp.nan, value) for name, value in values.items()}
    mean_square = values.pop("mean_square", None)
    if mean_square is not None:
        values["foundation_rms"] = jnp.sqrt(mean_square)
    if "foundation_smooth_peak" in values:
        mean_power = values["foundation_smooth_peak"]
        values["foundation_smooth_peak"] = mean_power ** (1 / PEAK_POWER)
    limits = None
    if scene.joint is not None and {"penetration_ratio", "impact_speed"} <= set(outputs):
        limits = validity(scene.joint, values["penetration_ratio"], values["impact_speed"])
    return Statistics(
        turns, outcome, turn_mean_square=kept.get("mean_square"), validity=limits, **values
    )


def sampled_observables(outputs: tuple[str, ...]) -> list[str]:
    """The observables to sample for these statistics."""
    names = []
    if "foundation_peak" in outputs:
        names.append("foundation_force")
    if "contact_fraction" in outputs or "penetration_ratio" in outputs:
        names.append("penetration_ratio")
    if "impact_speed" in outputs:
        names.append("penetration_rate")
    if "joint_peak" in outputs:
        names.append("joint_force")
    return names


def statistics_problem(outputs: tuple[str, ...]) -> Problem:
    """Totals and samples by shaft angle, in radians: every design has the same span."""
    observed = sampled_observables(outputs)
    wanted = {
        "mean_square": "foundation_rms" in outputs,
        "foundation_mean": "foundation_mean" in outputs,
        **{
            name: name in outputs
            for name in ("winding", "foundation_smooth_peak", "sliding_power", "drive_power")
        },
    }
    totals = [name for name, asked in wanted.items() if asked]

    def initial(scene: Scene) -> Carried:
        zeros = {name: jnp.zeros(()) for name in totals}
        return Carried(scene.formulation.initial(scene), zeros)

    def integrands(snapshot: Snapshot, scene: Scene) -> dict[str, Scalar]:
        rates = {}
        if {"mean_square", "foundation_mean", "foundation_smooth_peak"} & set(totals):
            force = foundation_force(snapshot, scene)
            rates = {
                "mean_square": force**2,
                "foundation_mean": force,
                "foundation_smooth_peak": force**PEAK_POWER,
            }
        if "sliding_power" in totals:
            rates["sliding_power"] = _sliding_power(snapshot)
        if "drive_power" in totals:
            rates["drive_power"] = drive_power(snapshot, scene)
        if "winding" in totals:
            orbit = 0.0 if snapshot.contact is None else snapshot.contact.orbit_speed
            rates["winding"] = orbit / scene.drive.speed
        return {name: rates[name] / (2 * jnp.pi) for name in totals}

    def field(angle: Scalar, y: Carried, scene: Scene) -> Carried:
        speed = scene.drive.speed
        snapshot = scene.formulation.snapshot(angle / speed, y.motion, scene)
        rate = scene.formulation.rate(snapshot, y.motion, scene)
        by_angle = jax.tree.map(lambda leaf: leaf / speed, rate)
        return Carried(by_angle, integrands(snapshot, scene))

    def observe(angle: Scalar, y: Carried, scene: Scene) -> dict[str, Array]:
        snapshot = scene.formulation.snapshot(angle / scene.drive.speed, y.motion, scene)
        return {name: OBSERVABLES[name](snapshot, scene) for name in observed}

    def summarise(seen: PyTree, totals: PyTree) -> dict[str, Scalar]:
        summary = dict(totals)
        if "foundation_peak" in outputs:
            summary["foundation_peak"] = _peak(seen["foundation_force"])
        if "contact_fraction" in outputs:
            touching = (seen["penetration_ratio"] > 0).astype(float)
            summary["contact_fraction"] = jnp.mean(touching)
        if "penetration_ratio" in outputs:
            summary["penetration_ratio"] = jnp.max(seen["penetration_ratio"])
        if "impact_speed" in outputs:
            summary["impact_speed"] = jnp.max(seen["penetration_rate"])
        if "joint_peak" in outputs:
            force = seen["joint_force"]
            summary["joint_peak"] = _peak(norm(Vector(force[:, 0], force[:, 1]), FORCE_WIDTH))
        return summary

    return Problem(initial, field, observe, summarise)


def _sliding_power(snapshot: Snapshot) -> Scalar:
    """F_n times the slip of the surfaces, W, whatever slip the friction law reads."""
    contact = snapshot.contact
    assert contact is not None and contact.surface_speed is not None
    return contact.normal_force * jnp.abs(contact.surface_speed)


def _peak(samples: Float[Array, " n"]) -> Scalar:
    """The top of the parabola through the largest sample and its neighbours."""
    index = jnp.clip(jnp.argmax(samples), 1, samples.size - 2)
    before, top, after = samples[index - 1], samples[index], samples[index + 1]
    slope, bend = (after - before) / 2, before - 2 * top + after
    concave = bend < 0
    shift = jnp.where(concave, -slope / jnp.where(concave, bend, 1), 0)
    vertex = top + shift * (slope + shift * bend / 2)
    return jnp.where(jnp.abs(shift) <= 1, vertex, jnp.max(samples))
