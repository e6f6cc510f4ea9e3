"""What the bearings stand along a run: loads, life, impacts, each with its scatter."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Scalar

from jaxcrusher.basics.checks import require_choice
from jaxcrusher.files.table import Column
from jaxcrusher.joint.rollers import LIFE_EXPONENT, RollerBearing
from jaxcrusher.mechanism.observables import (
    HOUR,
    RATED_TURNS,
    force_at,
    ring_speed,
    roller_pressure,
)
from jaxcrusher.mechanism.reductions import (
    LARGEST,
    Chosen,
    PowerMean,
    RisesAboveZero,
    ShareAboveZero,
    Statistic,
)
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.snapshot import OfPart, Snapshot
from jaxcrusher.motion.turns import Turns
from jaxcrusher.sheets.wear import Archard

# The most events of which none is seen with 16 %, as far off as a standard error: Gehrels,
# Astrophys. J. 303 (1986) 336, table 1. No event in some turns tells nothing of their share of the
# time, nor of their speed.
NONE_SEEN = 1.841
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
    "wear": Column("m/h", "growth of the clearance by wear"),
}
SHAKING = Column("N", "RMS of the shaking force on the frame")
COLUMNS = {
    name + suffix: Column(column.unit, words + column.meaning)
    for name, column in (NUMBERS | {"shaking_rms": SHAKING}).items()
    for suffix, words in (("", ""), ("_scatter", "scatter of the "))
}


def bearings_of(scene: Scene, joint: str | None = None) -> tuple[str, ...]:
    """Return the joints of a sheet: the one looked at, the crank's bearing, and loose joints.

    The first is the named joint, which may be ideal, or the joint whose results have no prefix, or
    the only loose joint. Slides are left out. Raises ValueError if there is no first joint.
    """
    only = scene.bearings.names[0] if len(scene.bearings) == 1 else None
    first = joint or scene.template.first or only or scene.joint_looked_at()
    require_choice("joint", first, scene.linkage.joints.names)
    return tuple(dict.fromkeys((first, scene.linkage.bearing, *scene.bearings.names)))


def _friction(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    contact = s.contacts[joint]
    loss = None if contact is None else contact.friction_loss
    return jnp.zeros_like(s.motion.crank.speed) if loss is None else loss


def _swings(scene: Scene, joint: str) -> bool:
    """Return whether a joint has rollers between two bodies of which none is the crank."""
    one = scene.linkage.joints.at(joint)
    rolls = isinstance(scene.joints[joint], RollerBearing)
    return rolls and scene.linkage.crank not in (one.bore.body, one.pin.body)


def _wearing(s: Snapshot, scene: Scene, joint: str) -> Scalar:
    """Return load^(10/3) times the speed of the rings: ISO 281 averages over revolutions.

    Uneven speed does not spread these evenly over time. It is the crank's speed, but where rollers
    swing.
    """
    speed = ring_speed(s, scene, joint) if _swings(scene, joint) else _speed(s, scene)
    return force_at(s, scene, joint) ** LIFE_EXPONENT * speed


def _speed(s: Snapshot, scene: Scene) -> Scalar:
    """Return the crank's speed, whichever way it turns, rad/s."""
    return jnp.abs(s.motion.crank.speed)


def outputs_of(scene: Scene, first: str | None = None) -> Chosen:
    """Return what the sheet asks of each turn of a motion: of joints, of the crank, of all.

    `first` is the joint to look at, as in `bearings_of`.
    """
    found = {
        "shaking_rms": scene.statistics["shaking_rms"],
        "speed": Statistic("rad/s", "mean speed of the shaft", _speed, PowerMean()),
    }
    for joint in bearings_of(scene, first):
        load, wearing = OfPart(force_at, joint), OfPart(_wearing, joint)
        of_joint = {
            "load": Statistic("N", "mean load", load, PowerMean()),
            "wear": Statistic("N^(10/3) rad/s", "what wears the rings", wearing, PowerMean()),
            "peak": Statistic("N", "peak load", load, LARGEST),
        }
        bearing = scene.bearings[joint]
        if bearing is not None:
            depth, rate = (
                scene.observables[scene.prefix(joint) + name]
                for name in ("penetration_ratio", "penetration_rate")
            )
            friction = OfPart(_friction, joint)
            of_joint |= {
                "contact": Statistic("1", "share of time in contact", depth, ShareAboveZero()),
                "impacts": Statistic("1", "impacts", depth, RisesAboveZero()),
                "approach": Statistic("m/s", "fastest approach", rate, LARGEST),
                "friction": Statistic("W", "power of friction", friction, PowerMean()),
            }
            if bearing.friction is not None:
                of_joint["rubbing"] = scene.statistics[scene.prefix(joint) + "sliding_power"]
        if isinstance(bearing, RollerBearing):
            pressure = OfPart(roller_pressure, joint)
            of_joint["pressure"] = Statistic("Pa", "pressure", pressure, LARGEST)
        if _swings(scene, joint):
            rings = OfPart(ring_speed, joint)
            of_joint["rings"] = Statistic("rad/s", "mean speed of the rings", rings, PowerMean())
        found |= {f"{joint} {name}": statistic for name, statistic in of_joint.items()}
    return tuple(found.items())


def _mean(pieces: np.ndarray) -> tuple[float, float]:
    return float(pieces.mean()), float(np.std(pieces, ddof=1) / np.sqrt(len(pieces)))


def _peak(pieces: np.ndarray) -> tuple[float, float]:
    return float(pieces.max()), float(np.std(pieces, ddof=1))


def _count(pieces: np.ndarray) -> tuple[float, float]:
    value, error = _mean(pieces)
    return value, error if value else NONE_SEEN / len(pieces)


def bearing_sheet(
    turns: Turns, joint: str | None = None, wear: Archard | None = None
) -> dict[str, dict[str, tuple[float, float]]]:
    """Return the numbers of each bearing of a run, by joint and name, each with its scatter.

    The `turns` hold the `outputs_of` their scene and joint. For several bearings side by side,
    life, safety and pressure are those of one bearing. Sliding surfaces have a wear if `wear` is
    given.
    """
    return {one: _of_joint(turns, one, wear) for one in bearings_of(turns.scene, joint)}


def shaking_rms(turns: Turns) -> tuple[float, float]:
    """Return the RMS of the shaking force, N, with its standard error."""
    square, error = _mean(turns.values["shaking_rms"] ** 2)
    return square**0.5, error / (2 * square**0.5)


def _of_joint(turns: Turns, joint: str, wear: Archard | None) -> dict[str, tuple[float, float]]:
    def of(name: str) -> np.ndarray:
        return turns.values[f"{joint} {name}"]

    bearing = turns.scene.bearings[joint]
    rings = of("rings") if _swings(turns.scene, joint) else turns.values["speed"]
    speed = float(rings.mean())
    worn, error = _mean(of("wear") / speed)
    equivalent = worn ** (1 / LIFE_EXPONENT)
    found = {
        "mean_load": _mean(of("load")),
        "equivalent_load": (equivalent, equivalent / LIFE_EXPONENT * error / worn),
        "peak_load": _peak(of("peak")),
    }
    if isinstance(bearing, RollerBearing):
        many = float(bearing.bearings)
        hours = RATED_TURNS / (speed / (2 * np.pi) * HOUR)
        life = hours * (float(bearing.dynamic_rating) * many) ** LIFE_EXPONENT / worn
        safety = float(bearing.static_rating) * many / of("peak")
        found |= {
            "life": (life, life * error / worn),
            "static_safety": (float(safety.min()), float(np.std(safety, ddof=1))),
            "pressure": _peak(of("pressure")),
        }
    if bearing is not None:
        # What a pin approaches its bore by while it stays in contact is no impact.
        speeds = np.where(of("impacts") > 0, of("approach"), 0.0)
        lost = _mean(1 - of("contact"))
        found |= {
            "contact_lost": lost if lost[0] else (0.0, np.nan),
            "impacts": _count(of("impacts")),
            "impact_speed": _peak(speeds) if speeds.any() else (0.0, np.nan),
            "friction_power": _mean(of("friction")),
        }
        if wear is not None and bearing.friction is not None:
            of_a_watt = float(wear.growth(1.0, float(bearing.bore_radius)))
            found["wear"] = _mean(HOUR * of_a_watt * of("rubbing"))
    return found
