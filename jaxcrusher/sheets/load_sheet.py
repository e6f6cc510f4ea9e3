"""The load sheet of a foundation: its numbers in parts, in the units of the trade."""

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import jax
import numpy as np
import xarray as xr
from jaxtyping import Complex, Float, Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.joint.rollers import RollerBearing
from jaxcrusher.mechanism.observables import OF_SUPPORTS
from jaxcrusher.mechanism.reductions import (
    LARGEST,
    LEAST,
    Chosen,
    Statistic,
    require_orders,
    samples_of,
)
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.snapshot import Observable, OfPart, Snapshot
from jaxcrusher.mechanism.topology import FRAME
from jaxcrusher.motion.turns import Curve, Turns, curve_of
from jaxcrusher.orbits.result import PeriodicOrbit, turns_of
from jaxcrusher.sheets import severity
from jaxcrusher.sheets.natural_modes import amplification, natural_modes, run_up, shares_of_energy

SIDES = {"x": "horizontally", "y": "vertically"}
WAYS = tuple(SIDES.values())
# Unit of an observable -> that of the sheet, and how many of it the first is.
TRADE = {"N": ("kN", 1e-3), "N m": ("kN m", 1e-3), "m": ("um", 1e6), "m/s": ("mm/s", 1e3)}
# Names of quantities on the sheet.
EXCITING, SUPPORTS = "exciting force", ("left support", "right support", "both supports")
STATIC, UPLIFT, VERDICTS = "static loads", "uplift", "verdicts"
HARMONICS = "harmonics"
MOVING = "harmonics of motion"
RMS, EQUIVALENT = "RMS of what moves", "equivalent"
# Of a support that may pull.
DEAD, LIFT, LEFT_OVER, ANCHOR = "dead load", "greatest lift", "least pressing force", "anchor force"
# What is followed of each force and moment of a run.
ENDS = {"largest": LARGEST, "least": LEAST}
# Of a joint: how deep its pin is in the bore, over the clearance.
DEPTH = "penetration_ratio"
# A mode near an order is in resonance if it makes that order so many times larger, and what moves
# so is this share of the block's RMS speed. Both are judged: a mode with a damping ratio of a third
# amplifies its own frequency 1.5 times.
AMPLIFIED, MATTERS = 1.5, 0.05


@dataclass(frozen=True)
class Site:
    """What a sheet knows besides the motion; points (m) are in the frame's axes, from C."""

    power: float | None = None  # of the motor, W
    frame_mass: float | None = None  # of a clamped machine's frame, kg
    points: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # Times each order of the shaft between which a natural frequency may be in resonance.
    band: tuple[float, float] = (0.7, 1.3)
    factor: float = 3.0  # dynamic factor of the equivalent static loads
    seconds: float = 10.0  # of a run-up, and of a run-down


@dataclass(frozen=True)
class Row:
    """A number of the sheet.

    `order` is the order of a harmonic, or says that the number is an RMS, a peak or the like, or is
    empty. The `scatter` of a harmonic or an RMS is its standard error, that of a peak the standard
    deviation of the turns' peaks. `ideal` is the number with ideal joints. `lowest` and `highest`
    are the range over other assumed numbers of the same machine. `softer` and `stiffer` are the
    numbers with ideal joints on soil of half and of one and a half times the shear modulus. Columns
    that do not apply are empty.
    """

    part: str
    name: str
    order: float | str
    value: float
    unit: str
    phase_rad: float | str = ""
    remark: str = ""
    scatter: float | str = ""
    ideal: float | str = ""
    lowest: float | str = ""
    highest: float | str = ""
    softer: float | str = ""
    stiffer: float | str = ""


def joint_states(scene: Scene) -> str:
    """Say of each joint whether it is ideal, or what clearance it has, and of loose slides."""
    states = []
    for joint in scene.linkage.joints.names:
        one, state = scene.joints[joint], "is ideal"
        if one is not None:
            rolls = "rollers and " if isinstance(one, RollerBearing) else ""
            state = f"has {rolls}a radial clearance of {1e3 * float(one.clearance):.4g} mm"
        states.append(f"{scene.template.joint(joint).words} {state}")
    for slide in (one for one in scene.linkage.slides.names if one in scene.joints):
        gap = 1e3 * float(scene.joints.at(slide).clearance)
        states.append(f"{slide} has a gap of {gap:.4g} mm on either side")
    return ", ".join(states)


def quantities_of(scene: Scene) -> dict[str, Observable]:
    """Return what a sheet looks at along a motion."""
    names = [f"{scene.prefix(joint)}{DEPTH}" for joint in scene.joints.names]
    if scene.supports is None:
        names += ["ground_force", "ground_moment"]
        return {name: scene.observables[name] for name in names}
    names += [name for name in OF_SUPPORTS if name != "transmitted_force"]
    spin = Observable(_frame_spin, "rad/s", "spin of the frame")
    return {name: scene.observables[name] for name in names} | {"frame_spin": spin}


def outputs_of(scene: Scene) -> Chosen:
    """Return what a sheet needs of each turn of a run: its quantities, and extremes of forces."""
    ends = tuple(
        (f"{which} {name}", Statistic(unit, f"{which} {name}", OfPart(_now, name), how))
        for name, (unit, _) in _forces(scene).items()
        for which, how in ENDS.items()
    )
    return samples_of(quantities_of(scene)) + ends


def _now(s: Snapshot, scene: Scene, name: str) -> Scalar:
    """Return a force or a moment of the sheet at an instant."""
    known = quantities_of(scene)
    return _forces(scene)[name][1](lambda one: known[one](s, scene))


def _frame_spin(s, scene: Scene) -> Scalar:
    return s.frame.spin


def orbit_turns(orbit: PeriodicOrbit) -> Turns:
    """Return what a sheet looks at along a periodic orbit."""
    turns = turns_of(orbit, quantities_of(orbit.scene))
    return dataclasses.replace(turns, values=jax.tree.map(np.asarray, turns.values))


def sheet(motion: PeriodicOrbit | Turns, orders: int, site: Site = Site()) -> list[Row]:
    """Return the rows of the sheet of an orbit or of a run, part by part.

    `orders` is the highest harmonic of the shaft's speed. Raises ValueError as `harmonics` does.
    """
    require_orders(orders)
    turns = motion if isinstance(motion, Turns) else orbit_turns(motion)
    exciting = _curves(turns, _on_frame(turns.scene))
    exciting = {name: curve.moving for name, curve in exciting.items()}
    static = static_loads(turns, site)
    rows = [
        *static,
        *_uplift(static, site),
        *_harmonics(turns, exciting, HARMONICS, orders),
        *_peaks(turns, exciting, orders),
    ]
    if turns.scene.supports is None:
        return rows
    modes, carried = natural_modes(turns.scene), _curves(turns, _carried())
    (arms, moved), near = _moved(turns, site.points), _meetings(turns, modes, orders, site)
    motions = [
        *_motion(turns, arms, moved, modes, site),
        *_harmonics(turns, moved, MOVING, orders),
    ]
    rows += [*_harmonics(turns, carried, HARMONICS, orders), *_peaks(turns, carried, orders)]
    rows = [*_ground(turns.scene), *_modes(turns.scene, modes, near), *rows, *motions]
    verdicts = _verdicts(turns.scene, rows, near, site)
    return [*verdicts, *rows, *_running_up(turns, moved, orders, site)]


def beside(rows: Sequence[Row], **others: Sequence[Row]) -> list[Row]:
    """Return the rows with the numbers of other sheets beside them, each in a column by its name.

    The columns are `ideal`, `softer` and `stiffer`. A number that another sheet lacks, or has in
    another unit, is empty.
    """
    known = {
        column: {(row.part, row.name, row.order, row.unit): row.value for row in sheet}
        for column, sheet in others.items()
    }

    def told(row: Row) -> Row:
        key = row.part, row.name, row.order, row.unit
        return dataclasses.replace(row, **{n: values.get(key, "") for n, values in known.items()})

    return [told(row) for row in rows]


def between(rows: Sequence[Row], others: Sequence[Sequence[Row]]) -> list[Row]:
    """Return the rows, each equivalent load with its range over other static loads and its own.

    The others are of the same machine with other numbers of what is assumed.
    """
    known = [{(row.name, row.order): row.value for row in loads} for loads in others]
    found = []
    for row in rows:
        if others and str(row.order).startswith(EQUIVALENT):
            values = [row.value, *(loads[row.name, row.order] for loads in known)]
            row = dataclasses.replace(row, lowest=min(values), highest=max(values))
        found.append(row)
    return found


def moving_rms(turns: Turns) -> dict[str, Float[np.ndarray, " pieces"]]:
    """Return the RMS in each piece of the moving exciting and transmitted force, N.

    The transmitted force is there only if the frame stands on supports.
    """
    found = {"exciting_rms": list(_curves(turns, _on_frame(turns.scene)).values())[:2]}
    if turns.scene.supports is not None:
        found["transmitted_rms"] = list(_curves(turns, _carried()).values())[-2:]
    return {name: np.hypot(x.moving.rms, y.moving.rms) for name, (x, y) in found.items()}


def loses_contact(turns: Turns) -> bool:
    """Return whether a pin leaves its bore in a motion, and so comes back with a knock."""
    depths = (values for name, values in turns.values.items() if name.endswith(DEPTH))
    return any(bool((depth <= 0).any()) for depth in depths)


def knocks(turns: Turns, rows: Sequence[Row], orders: int) -> str:
    """Say what the knocks after a loss of contact amount to, with a block or without one."""
    if turns.scene.supports is None:
        return (
            "the frame is clamped, and what knocks exert stands here whole; a block filters them, "
            "since above its natural frequencies it passes on ever less"
        )
    known = {(row.name, row.order): row.value for row in rows if row.part == HARMONICS}

    def above(name: str) -> float:
        x, y = (known[f"{name}, {side}", _above(orders)] for side in WAYS)
        return float(np.hypot(x, y))

    sent, passed = above(EXCITING), above(f"force of {SUPPORTS[-1]}")
    return (
        f"the block filters them: above order {orders} the exciting force has an RMS of "
        f"{sent:.3g} kN, and the supports pass on {passed:.3g} kN"
    )


def running_frequency(scene: Scene) -> float:
    """Return the shaft's frequency, Hz."""
    return float(scene.drive.speed) / (2 * np.pi)


Curves = dict[str, Curve]
# Looks at a quantity of the sheet by its name, at an instant or at all.
Look = Callable[[str], Any]
# Unit of a force or moment, and how it follows from what the sheet looks at.
Forces = dict[str, tuple[str, Callable[[Look], Any]]]


def _curves(turns: Turns, forces: Forces) -> Curves:
    """Return forces and moments over a motion; the ends of an orbit are those of its instants."""
    found = {}
    for name, (unit, of) in forces.items():
        found[name] = curve_of(unit, np.asarray(of(turns.values.__getitem__)))
        if not turns.repeats:
            ends = (turns.values[f"{which} {name}"] for which in ENDS)
            found[name] = Curve(unit, found[name].values, *ends)
    return found


def _forces(scene: Scene) -> Forces:
    """Return all forces and moments of the sheet."""
    return _on_frame(scene) | ({} if scene.supports is None else _carried())


def _component(unit: str, names: Sequence[str], axis: int) -> tuple[str, Callable]:
    """Return a component of the sum of some vectors."""
    return unit, lambda look: sum(look(name)[..., axis] for name in names)


def _on_frame(scene: Scene) -> Forces:
    """Return force and moments of the bodies' motion past the frame, and on a clamped one weight.

    They are those on a frame at rest. A frame that gives way feels less, and whoever puts that into
    a model which has the machine's mass counts the frame's own inertia twice.
    """
    what = "ground" if scene.supports is None else "exciting"
    force, moment, place = f"{what}_force", f"{what}_moment", _place(scene)
    about = "G" if scene.supports is not None else "the foundation's point"
    if scene.foundation is None:
        about = scene.template.origin
    bearing = scene.template.joint(scene.linkage.bearing).title
    levels = {
        f"exciting moment about {about}": place,
        f"exciting moment at the shaft's level, about {bearing}": _bearing(scene),
    }
    if (foundation := scene.supports) is not None:
        middle = (foundation.left + foundation.right) / 2
        levels["exciting moment at the base, in its middle"] = Vector(middle, foundation.base)

    def moment_about(at: Vector) -> Callable:
        arm = place - at

        def moved(look: Look) -> Any:
            pushed = look(force)
            return look(moment) + (arm.x * pushed[..., 1] - arm.y * pushed[..., 0])

        return moved

    found = {f"{EXCITING}, {side}": _component("N", [force], i) for i, side in enumerate(WAYS)}
    return found | {name: ("N m", moment_about(at)) for name, at in levels.items()}


def _place(scene: Scene) -> Vector:
    """Return the point that moments on the ground are counted about, as drawn, m."""
    return Vector(0.0, 0.0) if scene.foundation is None else scene.foundation.point


def _bearing(scene: Scene) -> Vector:
    """Return the crank's bearing in the frame, as drawn, m."""
    linkage = scene.linkage
    return linkage.side_of(linkage.bearing, FRAME).vector()


def _carried() -> Forces:
    """Return the forces of the supports on the ground."""
    both = ["left_force", "right_force"]
    carried = zip(SUPPORTS, (both[:1], both[1:], both), strict=True)
    return {
        f"force of {name}, {side}": _component("N", names, i)
        for name, names in carried
        for i, side in enumerate(WAYS)
    }


def static_loads(turns: Turns, site: Site) -> list[Row]:
    """Return the static loads, and static loads equivalent to moving forces by a dynamic factor."""
    scene, frame = turns.scene, site.frame_mass
    clamped = scene.supports is None
    curves = _curves(turns, _on_frame(scene) if clamped else _carried())
    # What weight and reactions cancel is rounding, some 1e-12 of the largest load.
    rounding = 1e-9 * max(float(np.abs(curve.values).max()) for curve in curves.values())
    rows = []
    for name, curve in curves.items():
        unit, factor = TRADE[curve.unit]
        mean = float(curve.values.mean())
        still, remark = mean if abs(mean) > rounding else 0.0, ""
        if clamped:
            name, remark = name.replace("exciting ", ""), "without the frame"
            if frame is not None and "force" in name:
                remark = f"with the frame of {frame:.6g} kg"
                fall = float(scene.linkage.gravity) if "vertically" in name else 0.0
                still -= frame * fall
        rows.append(Row(STATIC, name, "static", factor * still, unit, remark=remark))
        for sign, end in (("+", curve.largest.max()), ("-", curve.least.min())):
            value = factor * (still + site.factor * (float(end) - mean))
            words = f"{EQUIVALENT}, {sign} {site.factor:g} times what moves"
            rows.append(Row(STATIC, name, words, value, unit))
    return rows


def _uplift(static: Sequence[Row], site: Site) -> list[Row]:
    """Return what holds each support down, what lifts it, and the anchor force that it needs.

    With the dead load G that a support carries, and the greatest force Z upwards of what moves,
    times the dynamic factor, it presses with G - factor Z at least. Where that is below zero it
    pulls, and anchors hold it with factor Z - G. A clamped frame has one support, if its mass is
    known.
    """
    rows = []
    for row in static:
        frame = "with the frame" in row.remark
        where = "frame" if frame else row.name.removeprefix("force of ").partition(",")[0]
        if row.order != "static" or WAYS[1] not in row.name or not (frame or where in SUPPORTS[:2]):
            continue
        (most,) = (
            r.value for r in static if r.name == row.name and f"{EQUIVALENT}, +" in str(r.order)
        )
        remark = "pulls: anchor it" if most > 0 else "presses at all times"
        numbers = {
            DEAD: -row.value,
            LIFT: (most - row.value) / site.factor,
            LEFT_OVER: -most,
            ANCHOR: max(most, 0.0),
        }
        rows += [
            Row(UPLIFT, where, words, value, row.unit, remark=remark if words == ANCHOR else "")
            for words, value in numbers.items()
        ]
    return rows


def _harmonics(turns: Turns, curves: Curves, part: str, orders: int) -> list[Row]:
    """Return the means of the pieces' amplitudes with their standard errors, and the RMS above."""
    rows = []
    for name, curve in curves.items():
        unit, factor = TRADE[curve.unit]
        pieces = factor * np.asarray(curve.amplitudes(orders * turns.length))[:, 1:]
        mean, count = pieces.mean(axis=0), len(pieces)
        spread = np.sum(np.abs(pieces - mean) ** 2, axis=0)
        error = np.sqrt(spread / max(count - 1, 1) / count)
        for i, (one, scatter) in enumerate(zip(mean, error, strict=True)):
            order, known = (i + 1) / turns.length, "" if turns.repeats else float(scatter)
            size, phase = float(np.abs(one)), float(np.angle(one))
            rows.append(Row(part, name, order, size, unit, phase, scatter=known))
        powers = np.var(factor * curve.values, axis=1) - np.sum(np.abs(pieces) ** 2, axis=1) / 2
        fast = np.sqrt(np.maximum(powers, 0.0))
        rows.append(_of_pieces(turns, part, name, _above(orders), fast, unit))
    return rows


def _by_order(
    turns: Turns, orders: int
) -> tuple[Float[np.ndarray, " orders"], Complex[np.ndarray, "3 orders"]]:
    """Return the circular frequencies of harmonics, rad/s, and what excites the block by them."""
    curves, highest = _curves(turns, _on_frame(turns.scene)), orders * turns.length
    pushing = list(curves.values())[:3]
    force = np.array([one.amplitudes(highest)[:, 1:].mean(axis=0) for one in pushing])
    each = np.arange(1, highest + 1) / turns.length
    return each * float(turns.scene.drive.speed), force


def _peaks(turns: Turns, curves: Curves, orders: int) -> list[Row]:
    """Return greatest and least values, the RMS of what moves, and how much of it is fast."""
    rows, largest = [], {}
    for curve in curves.values():
        size = float(np.abs(curve.values).max())
        largest[curve.unit] = max(largest.get(curve.unit, 0.0), size)
    for name, curve in curves.items():
        (unit, factor), values = TRADE[curve.unit], curve.values
        rms, powers = factor * np.asarray(curve.moving.rms), np.var(values, axis=1)
        orders_of_pieces = np.asarray(curve.amplitudes(orders * turns.length))[:, 1:]
        slow = np.sum(np.abs(orders_of_pieces) ** 2, axis=1) / 2
        # Beside the largest of its kind what hardly moves is rounding.
        moves = bool(powers.mean() > (1e-9 * largest[curve.unit]) ** 2)
        share = 100 * (1 - slow.sum() / powers.sum()) if moves else 0.0
        of_turns = 100 * np.std(1 - slow / powers, ddof=1) if moves and not turns.repeats else 0.0
        scatter = "" if turns.repeats else float(of_turns) * len(values) ** -0.5
        rows += [
            _of_pieces(turns, "peaks", name, "greatest", factor * curve.largest, unit),
            _of_pieces(turns, "peaks", name, "least", factor * curve.least, unit),
            _of_pieces(turns, "peaks", name, RMS, rms, unit),
            Row("peaks", name, _share_above(orders), max(float(share), 0.0), "%", scatter=scatter),
        ]
    return rows


def _above(orders: int) -> str:
    return f"RMS above order {orders}"


def _share_above(orders: int) -> str:
    return f"power above order {orders}"


def _of_pieces(turns: Turns, part: str, name: str, what: str, pieces: np.ndarray, unit: str) -> Row:
    """Return the row of a number of each piece: its extreme, or the root of its mean square."""
    over = {"greatest": np.max, "peak": np.max, "least": np.min}
    value = float(over.get(what, lambda each: np.sqrt(np.mean(each**2)))(pieces))
    # Of a mean it is the standard error, of an extreme that of the turns' own.
    share = 1.0 if what in over else len(pieces) ** -0.5
    scatter = "" if turns.repeats else share * float(np.std(pieces, ddof=1))
    return Row(part, name, what, value, unit, scatter=scatter)


def _ground(scene: Scene) -> list[Row]:
    """Return springs and dampers of both supports together; rocking is about their middle."""
    supports = scene.supports
    assert supports is not None
    arm = float(supports.right - supports.left) / 2
    upright = 2 * float(supports.vertical_stiffness), 2 * float(supports.vertical_damping)
    turned = 0.0 if supports.rocking_damping is None else float(supports.rocking_damping)
    numbers = {
        "stiffness horizontally": (2 * float(supports.horizontal_stiffness), "MN/m"),
        "stiffness vertically": (upright[0], "MN/m"),
        "stiffness in rocking": (upright[0] * arm**2, "MN m/rad"),
        "damping horizontally": (2 * float(supports.horizontal_damping), "MN s/m"),
        "damping vertically": (upright[1], "MN s/m"),
        "damping in rocking": (upright[1] * arm**2 + turned, "MN m s/rad"),
    }
    part = "springs and dampers"
    return [Row(part, name, "", 1e-6 * value, unit) for name, (value, unit) in numbers.items()]


class Meeting(NamedTuple):
    """A mode whose natural frequency lies near an order, and what it does to that order."""

    mode: int
    times: float  # the natural frequency over that of the order
    order: float
    amplification: float
    share: float  # of the block's RMS speed

    @property
    def resonates(self) -> bool:
        """Return whether the mode makes the order larger, and the order matters."""
        return self.amplification >= AMPLIFIED and self.share >= MATTERS

    @property
    def words(self) -> str:
        """Say where the mode lies, and its effect."""
        return (
            f"{self.times:.2f} times order {self.order:g}, amplified {self.amplification:.2f} "
            f"times, {100 * self.share:.2g} % of the RMS speed"
        )


def _meetings(turns: Turns, modes: xr.Dataset, orders: int, site: Site) -> list[Meeting]:
    """Return the modes whose natural frequencies lie in the band about an order."""
    rates, force = _by_order(turns, orders)
    shares = np.sqrt(shares_of_energy(turns.scene, force, rates))
    (low, high), found = site.band, []
    both = zip(modes.frequency.values, modes.damping_ratio.values, strict=True)
    for mode, (frequency, ratio) in enumerate(both):
        for i, rate in enumerate(rates):
            times = float(2 * np.pi * frequency / rate)
            if low <= times <= high:
                larger = float(amplification(1 / times, ratio))
                order = (i + 1) / turns.length
                found.append(Meeting(mode, times, order, larger, float(shares[mode, i])))
    return found


def _modes(scene: Scene, modes: xr.Dataset, near: Sequence[Meeting]) -> list[Row]:
    part, running, found = "natural modes", running_frequency(scene), []
    for i in range(modes.sizes["mode"]):
        one, mode = modes.isel(mode=i), f"mode {i + 1}"
        frequency, ratio = float(one.frequency), float(one.damping_ratio)
        moves = str(one.coordinate.values[int(np.argmax(one.share.values))])
        remark = f"damping ratio {ratio:.4g}, {frequency / running:.3g} times the running frequency"
        remark += f", most in {moves}"
        for meeting in near:
            if meeting.mode == i:
                verdict = "resonance" if meeting.resonates else "no resonance"
                remark += f"; {verdict}: {meeting.words}"
        found.append(Row(part, f"undamped frequency of {mode}", "", frequency, "Hz", remark=remark))
    # Dampers couple the modes: what moves freely is no single mode, and need not vibrate.
    for i, (decay, damped) in enumerate(zip(modes.decay, modes.damped_frequency, strict=True)):
        frequency, ratio = float(damped), float(decay / np.hypot(decay, 2 * np.pi * damped))
        remark = f"vibrates at {frequency:.4g} Hz, damping ratio {ratio:.4g}"
        remark = remark if frequency else "overdamped, does not vibrate"
        name = f"decay of free motion {i + 1}"
        found.append(Row(part, name, "", float(decay), "1/s", remark=remark))
    return found


def _moved(
    turns: Turns, points: Mapping[str, tuple[float, float]]
) -> tuple[dict[str, np.ndarray], Curves]:
    """Return where G, the main bearing and the points are from G (m), and how they move."""
    shift, turned = turns.values["frame_displacement"], turns.values["frame_rotation"]
    rate, spin = turns.values["frame_velocity"], turns.values["frame_spin"]
    cos, sin = np.cos(turned), np.sin(turned)
    places = {"G": _place(turns.scene), "the main bearing": _bearing(turns.scene)}
    places |= {name: Vector(*at) for name, at in points.items()}
    arms, curves = {}, {}
    for name, at in places.items():
        arm = arms[name] = np.asarray((at - _place(turns.scene)).array())
        x, y = cos * arm[0] - sin * arm[1], sin * arm[0] + cos * arm[1]
        path = shift + np.stack([x - arm[0], y - arm[1]], axis=-1)
        velocity = rate + spin[..., None] * np.stack([-y, x], axis=-1)
        for i, side in enumerate(WAYS):
            curves[f"displacement of {name}, {side}"] = curve_of("m", path[..., i]).moving
            curves[f"velocity of {name}, {side}"] = curve_of("m/s", velocity[..., i])
    return arms, curves


def _motion(
    turns: Turns, arms: dict[str, np.ndarray], curves: Curves, modes: xr.Dataset, site: Site
) -> list[Row]:
    """Return RMS and peaks of displacement and velocity, with the zones of the standard."""
    part, running = "motion", running_frequency(turns.scene)
    outside, machines = severity.outside_scope(running, site.power), severity.group(site.power)
    rows = []
    for place, arm in arms.items():
        for quantity, axis in itertools.product(("displacement", "velocity"), SIDES):
            name = f"{quantity} of {place}, {SIDES[axis]}"
            curve = curves[name]
            unit, factor = TRADE[curve.unit]
            row = _of_pieces(turns, part, name, "RMS", factor * np.asarray(curve.rms), unit)
            kind = severity.support_kind(modes, running, arm, axis)
            grade = severity.zone(kind, quantity, row.value, machines)
            said = "" if outside else f"zone {grade}, {kind} support"
            rows += [
                dataclasses.replace(row, remark=said),
                _of_pieces(turns, part, name, "peak", factor * curve.peak, unit),
            ]
    return rows


def _verdicts(scene: Scene, rows: Sequence[Row], near: Sequence[Meeting], site: Site) -> list[Row]:
    """Return the overall grade with what decides it, and the resonances."""
    part, running = VERDICTS, running_frequency(scene)
    close = [one for one in near if one.resonates]
    named = "; ".join(f"mode {one.mode + 1}: {one.words}" for one in close)
    found = [Row(part, "resonances", "", len(close), "1", remark=named or "none")]
    pulls = [row for row in rows if row.order == ANCHOR and row.value > 0]
    told = "; ".join(f"{row.name} by {row.value:.4g} {row.unit}" for row in pulls)
    found.append(Row(part, "supports that pull", "", len(pulls), "1", remark=told or "none"))
    if outside := severity.outside_scope(running, site.power):
        return [Row(part, "overall zone", "", 60 * running, "rpm", remark=outside), *found]
    zones = [row for row in rows if row.remark.startswith("zone ")]
    machines = severity.group(site.power)

    def bad(row: Row) -> tuple[str, float]:
        _, grade, kind, _ = row.remark.replace(",", "").split()
        return grade, severity.share(kind, row.name.split()[0], row.value, machines)

    worst = max(zones, key=bad)
    assumed = "" if site.power else ", assumed: motor_power is not given"
    group = severity.GROUPS[machines] + assumed
    said = f"{worst.remark}; decided by the {worst.order} {worst.name} ({group})"
    return [Row(part, "overall zone", "", worst.value, worst.unit, remark=said), *found]


def _running_up(turns: Turns, moved: Curves, orders: int, site: Site) -> list[Row]:
    """Return what G does on the way up and down, beside the running speed."""
    part, rows, scene = "run-up and run-down", [], turns.scene
    force = _by_order(turns, orders)[1][:, turns.length - 1 :: turns.length]  # orders of a turn
    for words, down in (("up", False), ("down", True)):
        path = run_up(scene, force, site.seconds, down=down)
        for i, axis in enumerate(SIDES):
            peak = 1e6 * np.abs(path[:, i]).max()
            running = 1e6 * moved[f"displacement of G, {SIDES[axis]}"].peak.max()
            name = f"peak displacement of G on the way {words}, {SIDES[axis]}"
            remark = f"in {site.seconds:g} s; {peak / running:.2f} times that at the running speed"
            rows.append(Row(part, name, "", float(peak), "um", remark=remark))
    return rows
