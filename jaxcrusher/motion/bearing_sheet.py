"""What the bearings stand along a run: loads, life, impacts, each with its scatter."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Scalar

from jaxcrusher.crusher.observables import HOUR, OBSERVABLES, RATED_TURNS, roller_pressure
from jaxcrusher.files.table import Column
from jaxcrusher.joint.rollers import LIFE_EXPONENT, RollerBearing
from jaxcrusher.mechanism.named import before
from jaxcrusher.mechanism.observables import force_at
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.mechanism.snapshot import Observable, OfPart, Snapshot
from jaxcrusher.motion.turns import Turns

# Numbers of a bearing. Behind each stands its scatter: of a mean its standard error, of a peak the
# standard deviation of the turns' peaks.
NUMBERS = {
    "mean_load": Column("N", "mean load"),
    "equivalent_load": Column("N", "equivalent load, of the exponent 10/3"),
    "peak_load": Column("N", "peak load"),
    "life": Column("h", "life L10 of one bearing by ISO 281"),
    "static_safety": Column("1", "static safety, C0 over the peak load"),
    "pressure": Column("Pa", "largest pressure of a roller"),
    "contact_lost": Column("1", "share of time without contact"),
    "impacts": Column("1", "impacts a turn"),
    "impact_speed": Column("m/s", "fastest impact"),
    "friction_power": Column("W", "power of friction"),
}
SHAKING = Column("N", "RMS of the shaking force on the frame")
COLUMNS = {
    name + suffix: Column(column.unit, words + column.meaning)
    for name, column in (NUMBERS | {"shaking_rms": SHAKING}).items()
    for suffix, words in (("", ""), ("_scatter", "scatter of the "))
}


def bearings_of(scene: AbstractScene) -> tuple[str, ...]:
    """Return the joints that a sheet is of: A and O, and B and C where they are loose."""
    seats = (joint for joint in ("elbow", "pivot") if scene.joints[joint] is not None)
    return "main", "shaft_bearing", *seats


def _friction(s: Snapshot, scene: AbstractScene, joint: str) -> Scalar:
    contact = s.contacts[joint]
    loss = None if contact is None else contact.friction_loss
    return jnp.zeros_like(s.motion.crank.speed) if loss is None else loss


def quantities_of(scene: AbstractScene) -> dict[str, Observable]:
    """Return what the sheet looks at along a motion."""
    found = {name: OBSERVABLES[name] for name in ("shaking_force", "shaft_speed")}
    for joint in bearings_of(scene):
        found[f"{joint} load"] = Observable(OfPart(force_at, joint), "N", "load")
        if scene.joints[joint] is None:
            continue
        for name in ("penetration_ratio", "penetration_rate"):
            found[f"{joint} {name}"] = OBSERVABLES[before(joint) + name]
        found[f"{joint} friction"] = Observable(OfPart(_friction, joint), "W", "friction")
    if isinstance(scene.joints["main"], RollerBearing):
        found["main pressure"] = Observable(roller_pressure, "Pa", "pressure")
    return found


def _mean(pieces: np.ndarray) -> tuple[float, float]:
    return float(pieces.mean()), float(np.std(pieces, ddof=1) / np.sqrt(len(pieces)))


def _peak(pieces: np.ndarray) -> tuple[float, float]:
    return float(pieces.max()), float(np.std(pieces, ddof=1))


def bearing_sheet(turns: Turns) -> dict[str, dict[str, tuple[float, float]]]:
    """Return the numbers of each bearing of a run, by joint and name, each with its scatter.

    Impacts are counted at 1024 instants a turn: shorter rebounds are missed. Of a bearing of
    several side by side, life, safety and pressure are those of one of them.
    """
    return {joint: _of_joint(turns, joint) for joint in bearings_of(turns.scene)}


def shaking_rms(turns: Turns) -> tuple[float, float]:
    """Return the RMS of the shaking force, N, with its standard error."""
    square, error = _mean(np.mean(np.sum(turns.values["shaking_force"] ** 2, axis=-1), axis=1))
    return square**0.5, error / (2 * square**0.5)


def _of_joint(turns: Turns, joint: str) -> dict[str, tuple[float, float]]:
    load, speed = turns.values[f"{joint} load"], np.abs(turns.values["shaft_speed"])
    # ISO 281 averages over revolutions, which uneven speed does not spread evenly over time.
    worn, error = _mean(np.mean(load**LIFE_EXPONENT * speed, axis=1) / speed.mean())
    equivalent = worn ** (1 / LIFE_EXPONENT)
    peaks = load.max(axis=1)
    found = {
        "mean_load": _mean(load.mean(axis=1)),
        "equivalent_load": (equivalent, equivalent / LIFE_EXPONENT * error / worn),
        "peak_load": _peak(peaks),
    }
    bearing = turns.scene.joints[joint]
    if isinstance(bearing, RollerBearing):
        many = float(bearing.bearings)
        hours = RATED_TURNS / (float(speed.mean()) / (2 * np.pi) * HOUR)
        life = hours * (float(bearing.dynamic_rating) * many) ** LIFE_EXPONENT / worn
        safety = float(bearing.static_rating) * many / peaks
        found |= {
            "life": (life, life * error / worn),
            "static_safety": (float(safety.min()), float(np.std(safety, ddof=1))),
            "pressure": _peak(turns.values["main pressure"].max(axis=1)),
        }
    if bearing is not None:
        touching = turns.values[f"{joint} penetration_ratio"] > 0
        # In time, over the ends of turns: the first instant has none before it.
        joined, rate = touching.ravel(), turns.values[f"{joint} penetration_rate"].ravel()
        begins = np.concatenate([[False], joined[1:] & ~joined[:-1]])
        speeds = np.where(begins, np.maximum(rate, np.roll(rate, 1)), 0.0).reshape(touching.shape)
        found |= {
            "contact_lost": _mean(1 - touching.mean(axis=1)),
            "impacts": _mean(begins.reshape(touching.shape).sum(axis=1)),
            "impact_speed": _peak(speeds.max(axis=1)),
            "friction_power": _mean(turns.values[f"{joint} friction"].mean(axis=1)),
        }
    return found
