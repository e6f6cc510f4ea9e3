"""The load sheet of a foundation: its numbers in parts, in the units of the trade."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Complex, Float, Scalar

from jaxcrusher.crusher.machine import LETTERS
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.joint.rollers import RollerBearing
from jaxcrusher.mechanism.observables import OF_SUPPORTS
from jaxcrusher.mechanism.reductions import SAMPLES, require_orders
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.mechanism.snapshot import Observable
from jaxcrusher.mechanism.topology import FRAME
from jaxcrusher.motion.turns import Turns
from jaxcrusher.orbits import severity
from jaxcrusher.orbits.natural_modes import linearised, natural_modes
from jaxcrusher.orbits.result import PeriodicOrbit, seen_along
from jaxcrusher.orbits.run_up import run_up

SIDES = {"x": "horizontally", "y": "vertically"}
# Unit of an observable -> that of the sheet, and how many of it the first is.
TRADE = {"N": ("kN", 1e-3), "N m": ("kN m", 1e-3), "m": ("um", 1e6), "m/s": ("mm/s", 1e3)}
# Names of quantities on the sheet.
EXCITING, SUPPORTS = "exciting force", ("left support", "right support", "both supports")
HARMONICS = "harmonics"
MOVING = "harmonics of motion"


@dataclass(frozen=True)
class Site:
    """What a sheet knows besides the motion; points (m) are in the frame's axes, from C."""

    power: float | None = None  # of the motor, W
    frame_mass: float | None = None  # of a clamped machine's frame, kg
    points: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # Times each order of the shaft between which a natural frequency is in resonance.
    band: tuple[float, float] = (0.7, 1.3)
    factor: float = 3.0  # dynamic factor of the equivalent static loads
    seconds: float = 10.0  # of a run-up, and of a run-down


@dataclass(frozen=True)
class Row:
    """A number of the sheet.

    `order` is that of a harmonic, or says whether it is the RMS, the peak or the like, or is empty.
    The `scatter` of a harmonic or an RMS is its standard error, that of a peak the standard
    deviation of the turns' peaks. `ideal` is the number with ideal joints. Of what has none of
    these they are empty.
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


def joint_states(scene: AbstractScene) -> str:
    """Say of each joint whether it is ideal, or what clearance it has."""
    states = []
    for joint in scene.linkage.joints.names:
        one, state = scene.joints[joint], "is ideal"
        if one is not None:
            rolls = "rollers and " if isinstance(one, RollerBearing) else ""
            state = f"has {rolls}a radial clearance of {1e3 * float(one.clearance):.4g} mm"
        name = "main bearing" if joint == "main" else joint.replace("_", " ")
        states.append(f"{name} {LETTERS.get(joint, '')} {state}".replace("  ", " "))
    return ", ".join(states)


def quantities_of(scene: AbstractScene) -> dict[str, Observable]:
    """Return what a sheet looks at along a motion."""
    names = ["ground_force", "ground_moment"]
    if scene.supports is None:
        return {name: scene.observables[name] for name in names}
    names += [name for name in OF_SUPPORTS if name != "transmitted_force"]
    spin = Observable(_frame_spin, "rad/s", "spin of the frame")
    return {name: scene.observables[name] for name in names} | {"frame_spin": spin}


def _frame_spin(s, scene: AbstractScene) -> Scalar:
    return s.frame.spin


def orbit_turns(orbit: PeriodicOrbit) -> Turns:
    """Return what a sheet looks at along a periodic orbit."""
    angles = 2 * np.pi / SAMPLES * jnp.arange(SAMPLES * orbit.period, dtype=float)
    seen = seen_along(orbit, angles, tuple(quantities_of(orbit.scene).items()))
    return Turns(orbit.scene, orbit.period, {n: np.asarray(v)[None] for n, v in seen.items()})


def sheet(motion: PeriodicOrbit | Turns, orders: int, site: Site = Site()) -> list[Row]:
    """Return the rows of the sheet of an orbit or of a run, part by part.

    `orders` is the highest harmonic of the shaft's speed. Raises ValueError as `harmonics` does.
    """
    require_orders(orders)
    turns = motion if isinstance(motion, Turns) else orbit_turns(motion)
    exciting = _exciting(turns)
    rows = [
        *_static(turns, site),
        *_harmonics(turns, exciting, HARMONICS, orders),
        *_peaks(turns, exciting),
    ]
    if turns.scene.supports is None:
        return rows
    modes, carried = natural_modes(turns.scene), _carried(turns)
    moved = _moved(turns, site.points)
    motions = [
        *_motion(turns, moved, modes, site),
        *_harmonics(turns, _named(moved), MOVING, orders),
    ]
    rows += [*_harmonics(turns, carried, HARMONICS, orders), *_peaks(turns, carried)]
    rows = [*_ground(turns.scene), *_modes(turns.scene, modes, rows, site), *rows, *motions]
    verdicts = _verdicts(turns.scene, rows, site)
    return [*verdicts, *rows, *_running_up(turns, orders, site)]


def beside(rows: Sequence[Row], ideal: Sequence[Row]) -> list[Row]:
    """Return the rows of a loose machine with the numbers of its ideal joints beside them."""
    known = {(row.part, row.name, row.order): row.value for row in ideal}
    return [
        dataclasses.replace(row, ideal=known.get((row.part, row.name, row.order), ""))
        for row in rows
    ]


def running_frequency(scene: AbstractScene) -> float:
    """Return the shaft's frequency, Hz."""
    return float(scene.drive.speed) / (2 * np.pi)


# A quantity of the sheet: its unit as observed, and values of shape (pieces, samples).
Curves = dict[str, tuple[str, Float[np.ndarray, "pieces samples"]]]


def _both(name: str, unit: str, values: Float[np.ndarray, "pieces samples 2"]) -> Curves:
    return {f"{name}, {SIDES[a]}": (unit, values[..., i]) for i, a in enumerate("xy")}


def _exciting(turns: Turns) -> Curves:
    """Return force and moments of the bodies on the frame."""
    force, moment = turns.values["ground_force"], turns.values["ground_moment"]
    scene, place = turns.scene, _place(turns.scene)
    about = "G" if scene.supports is not None else "the foundation's point"
    if scene.foundation is None:
        about = "C" if isinstance(scene, Scene) else "the frame's origin"
    bearing = LETTERS.get(scene.linkage.bearing, scene.linkage.bearing)
    levels = {
        f"exciting moment about {about}": place,
        f"exciting moment at the shaft's level, about {bearing}": _bearing(scene),
    }
    if (foundation := scene.supports) is not None:
        middle = float(foundation.left + foundation.right) / 2
        levels["exciting moment at the base, in its middle"] = np.array(
            [middle, float(foundation.base)]
        )
    found = _both(EXCITING, "N", force)
    for name, at in levels.items():
        x, y = place - at
        found[name] = ("N m", moment + x * force[..., 1] - y * force[..., 0])
    return found


def _place(scene: AbstractScene) -> Float[np.ndarray, "2"]:
    """Return the point that moments on the ground are counted about, as drawn, m."""
    return np.zeros(2) if scene.foundation is None else np.asarray(scene.foundation.point.array())


def _bearing(scene: AbstractScene) -> Float[np.ndarray, "2"]:
    """Return the crank's bearing in the frame, as drawn, m."""
    linkage = scene.linkage
    return np.asarray(linkage.side_of(linkage.bearing, FRAME).vector().array())


def _carried(turns: Turns) -> Curves:
    """Return the forces of the supports on the ground."""
    left, right = turns.values["left_force"], turns.values["right_force"]
    found: Curves = {}
    for name, force in zip(SUPPORTS, (left, right, left + right), strict=True):
        found |= _both(f"force of {name}", "N", force)
    return found


def _static(turns: Turns, site: Site) -> list[Row]:
    """Return the static loads, and those that stand for what moves by a dynamic factor."""
    scene, frame = turns.scene, site.frame_mass
    clamped = scene.supports is None
    curves = _exciting(turns) if clamped else _carried(turns)
    # What weight and reactions cancel is rounding, some 1e-12 of the largest load.
    rounding = 1e-9 * max(float(np.abs(values).max()) for _, values in curves.values())
    rows = []
    for name, (observed, values) in curves.items():
        unit, factor = TRADE[observed]
        mean = float(values.mean())
        still, remark = mean if abs(mean) > rounding else 0.0, ""
        if clamped:
            name, remark = name.replace("exciting ", ""), "without the frame"
            if frame is not None and "force" in name:
                remark = f"with the frame of {frame:.6g} kg"
                fall = float(scene.linkage.gravity) if "vertically" in name else 0.0
                still -= frame * fall
        rows.append(Row("static loads", name, "static", factor * still, unit, remark=remark))
        for sign, end in (("+", values.max()), ("-", values.min())):
            value = factor * (still + site.factor * (float(end) - mean))
            words = f"equivalent, {sign} {site.factor:g} times what moves"
            rows.append(Row("static loads", name, words, value, unit))
    return rows


def _spectrum(
    values: Float[np.ndarray, "pieces samples"], highest: int
) -> tuple[Complex[np.ndarray, " orders"], Float[np.ndarray, " orders"]]:
    """Return the mean of the pieces' complex amplitudes from the first on, and its error."""
    # numpy.fft sums a exp(-i k theta): its angle is the phase of the cosine.
    pieces = 2 * np.fft.rfft(values, axis=1)[:, 1 : highest + 1] / values.shape[1]
    mean, count = pieces.mean(axis=0), len(pieces)
    spread = np.sum(np.abs(pieces - mean) ** 2, axis=0)
    return mean, np.sqrt(spread / max(count - 1, 1) / count)


def _harmonics(turns: Turns, curves: Curves, part: str, orders: int) -> list[Row]:
    rows = []
    for name, (observed, values) in curves.items():
        unit, factor = TRADE[observed]
        mean, error = _spectrum(factor * values, orders * turns.length)
        for i, (one, scatter) in enumerate(zip(mean, error, strict=True)):
            order, known = (i + 1) / turns.length, "" if turns.repeats else float(scatter)
            size, phase = float(np.abs(one)), float(np.angle(one))
            rows.append(Row(part, name, order, size, unit, phase, scatter=known))
    return rows


def _peaks(turns: Turns, curves: Curves) -> list[Row]:
    """Return the greatest and least values, and the RMS of what moves."""
    rows = []
    for name, (observed, values) in curves.items():
        unit, factor = TRADE[observed]
        moves = factor * np.sqrt(np.mean((values - values.mean()) ** 2, axis=1))
        rows += [
            _of_pieces(turns, "peaks", name, "greatest", factor * values.max(axis=1), unit),
            _of_pieces(turns, "peaks", name, "least", factor * values.min(axis=1), unit),
            _of_pieces(turns, "peaks", name, "RMS of what moves", moves, unit),
        ]
    return rows


def _of_pieces(turns: Turns, part: str, name: str, what: str, pieces: np.ndarray, unit: str) -> Row:
    """Return the row of a number of each piece: its extreme, or the root of its mean square."""
    over = {"greatest": np.max, "peak": np.max, "least": np.min}
    value = float(over.get(what, lambda each: np.sqrt(np.mean(each**2)))(pieces))
    # Of a mean it is the standard error, of an extreme that of the turns' own.
    share = 1.0 if what in over else len(pieces) ** -0.5
    scatter = "" if turns.repeats else share * float(np.std(pieces, ddof=1))
    return Row(part, name, what, value, unit, scatter=scatter)


def _ground(scene: AbstractScene) -> list[Row]:
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


def _modes(scene: AbstractScene, modes: xr.Dataset, rows: Sequence[Row], site: Site) -> list[Row]:
    part, running, found = "natural modes", running_frequency(scene), []
    shaken = {
        order: max(r.value for r in rows if r.order == order and r.unit == "kN")
        for order in sorted({float(r.order) for r in rows if r.part == HARMONICS})
    }
    most = max(shaken.values(), default=1.0) or 1.0
    for i in range(modes.sizes["mode"]):
        one, mode = modes.isel(mode=i), f"mode {i + 1}"
        frequency, ratio = float(one.frequency), float(one.damping_ratio)
        moves = str(one.coordinate.values[int(np.argmax(one.share.values))])
        remark = f"damping ratio {ratio:.4g}, {frequency / running:.3g} times the running frequency"
        remark += f", most in {moves}"
        low, high = site.band
        for order, size in shaken.items():
            times = frequency / (order * running)
            if low <= times <= high:
                remark += f"; resonance: {times:.2f} times order {order:g}"
                remark += f" ({size / most:.1%} of the largest harmonic)"
        found.append(Row(part, f"undamped frequency of {mode}", "", frequency, "Hz", remark=remark))
    # Dampers couple the modes: what moves freely is no single mode, and need not vibrate.
    for i, (decay, damped) in enumerate(zip(modes.decay, modes.damped_frequency, strict=True)):
        frequency, ratio = float(damped), float(decay / np.hypot(decay, 2 * np.pi * damped))
        remark = f"vibrates at {frequency:.4g} Hz, damping ratio {ratio:.4g}"
        remark = remark if frequency else "overdamped, does not vibrate"
        name = f"decay of free motion {i + 1}"
        found.append(Row(part, name, "", float(decay), "1/s", remark=remark))
    return found


# Place -> arm from G (m), displacement from the mean place (m) and velocity (m/s) in time.
Moved = dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]


def _moved(turns: Turns, points: Mapping[str, tuple[float, float]]) -> Moved:
    """Return how G, the main bearing and the points move."""
    shift, turned = turns.values["frame_displacement"], turns.values["frame_rotation"]
    rate, spin = turns.values["frame_velocity"], turns.values["frame_spin"]
    cos, sin = np.cos(turned), np.sin(turned)
    places = {"G": _place(turns.scene), "the main bearing": _bearing(turns.scene)}
    places |= {name: np.array(at) for name, at in points.items()}
    found = {}
    for name, at in places.items():
        arm = at - _place(turns.scene)
        x, y = cos * arm[0] - sin * arm[1], sin * arm[0] + cos * arm[1]
        path = shift + np.stack([x - arm[0], y - arm[1]], axis=-1)
        velocity = rate + spin[..., None] * np.stack([-y, x], axis=-1)
        found[name] = arm, path - path.mean(axis=(0, 1)), velocity
    return found


def _named(moved: Moved) -> Curves:
    found: Curves = {}
    for place, (_, path, velocity) in moved.items():
        found |= _both(f"displacement of {place}", "m", path)
        found |= _both(f"velocity of {place}", "m/s", velocity)
    return found


def _motion(turns: Turns, moved: Moved, modes: xr.Dataset, site: Site) -> list[Row]:
    """Return RMS and peaks of displacement and velocity, with the zones of the standard."""
    part, running = "motion", running_frequency(turns.scene)
    outside, machines = severity.outside_scope(running, site.power), severity.group(site.power)
    rows = []
    for place, (arm, path, velocity) in moved.items():
        for quantity, values, observed in (
            ("displacement", path, "m"),
            ("velocity", velocity, "m/s"),
        ):
            unit, factor = TRADE[observed]
            for i, axis in enumerate(SIDES):
                one, name = factor * values[..., i], f"{quantity} of {place}, {SIDES[axis]}"
                kind = severity.support_kind(modes, running, arm, axis)
                rms, peaks = np.sqrt(np.mean(one**2, axis=1)), np.abs(one).max(axis=1)
                row = _of_pieces(turns, part, name, "RMS", rms, unit)
                grade = severity.zone(kind, quantity, row.value, machines)
                said = "" if outside else f"zone {grade}, {kind} support"
                rows += [
                    dataclasses.replace(row, remark=said),
                    _of_pieces(turns, part, name, "peak", peaks, unit),
                ]
    return rows


def _verdicts(scene: AbstractScene, rows: Sequence[Row], site: Site) -> list[Row]:
    """Return the overall grade with what decides it, and the resonances."""
    part, running = "verdicts", running_frequency(scene)
    low, high = site.band
    close = [row for row in rows if "resonance" in row.remark]
    named = "; ".join(
        f"{r.name.removeprefix('undamped frequency of ')} {r.remark.partition('; ')[2]}"
        for r in close
    )
    band = f"natural frequencies from {low:g} to {high:g} times an order"
    found = [Row(part, band, "", len(close), "1", remark=named or "none")]
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


def _running_up(turns: Turns, orders: int, site: Site) -> list[Row]:
    """Return what G does on the way up and down, beside the running speed."""
    part, rows, scene = "run-up and run-down", [], turns.scene
    supports, mass = scene.supports, linearised(scene)[0]
    assert supports is not None
    moved, turned = turns.values["frame_displacement"], turns.values["frame_rotation"]
    pushing = [values for _, values in list(_exciting(turns).values())[:3]]
    each = slice(turns.length - 1, None, turns.length)  # of the orders of a turn
    force, swing = (
        np.array([_spectrum(one, orders * turns.length)[0][each] for one in curves])
        for curves in (pushing, (moved[..., 0], moved[..., 1], turned))
    )
    # The inertia of bodies that move with the frame is in the mass, and not in the force on it.
    carried = mass - np.diag([float(n) for n in (supports.mass, supports.mass, supports.inertia)])
    rates = float(scene.drive.speed) * np.arange(1, force.shape[1] + 1)
    force = force - carried @ (rates**2 * swing)
    # So is the moment of weights that lean with it in the stiffness.
    force[2] += float(scene.linkage.gravity) * carried[0, 2] * swing[2]
    for words, down in (("up", False), ("down", True)):
        path = run_up(scene, force, site.seconds, down=down)
        for i, axis in enumerate(SIDES):
            own = moved[..., i] - moved[..., i].mean()
            peak, running = 1e6 * np.abs(path[:, i]).max(), 1e6 * np.abs(own).max()
            name = f"peak displacement of G on the way {words}, {SIDES[axis]}"
            remark = f"in {site.seconds:g} s; {peak / running:.2f} times that at the running speed"
            rows.append(Row(part, name, "", float(peak), "um", remark=remark))
    return rows
