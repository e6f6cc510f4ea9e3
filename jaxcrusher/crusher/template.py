"""The names of a crusher's results, and its observables beyond those of any linkage.

These are the forces on its foundation, and places of its jaw.
"""

from collections.abc import Mapping

from jaxtyping import Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.basics.smooth import norm
from jaxcrusher.crusher.machine import JOINTS, LETTERS
from jaxcrusher.crusher.outline import outline
from jaxcrusher.joint.validity import Tautness
from jaxcrusher.mechanism.observables import (
    cap_acceleration,
    cap_velocity,
    force_at,
    force_width,
    on_bore,
)
from jaxcrusher.mechanism.quantities import (
    Asked,
    Parts,
    Template,
    Title,
    asked_of,
    position,
    require_new,
    sensors_at,
)
from jaxcrusher.mechanism.reductions import LEAST, PEAK, PowerMean, Statistic
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.snapshot import Observable, OfPart, Snapshot


def _on_pin(s: Snapshot, scene: Scene, joint: str) -> Vector:
    """Return the force on the pin of a joint, N."""
    return -on_bore(s, scene, joint)


# The force of the shaft on the jaw at A, of the frame on the shaft (R_O), of the toggle on the jaw
# (R_B), and of the frame on the toggle (R_C), N; and S2, m.
joint_force = OfPart(on_bore, "main")
bearing_reaction = OfPart(_on_pin, "shaft_bearing")
elbow_reaction = OfPart(on_bore, "elbow")
toggle_reaction = OfPart(_on_pin, "pivot")
jaw_mass_centre = OfPart(position, "jaw")


def foundation_force(s: Snapshot, scene: Scene) -> Scalar:
    """|R_O| + |R_C|, N: the only definition of seven that meets the paper's numbers."""
    at_bearing = norm(bearing_reaction(s, scene), force_width(s, scene))
    return at_bearing + norm(toggle_reaction(s, scene), force_width(s, scene))


def net_foundation_force(s: Snapshot, scene: Scene) -> Scalar:
    """|R_O + R_C|, N: the length of the resultant on the foundation."""
    return norm(bearing_reaction(s, scene) + toggle_reaction(s, scene), force_width(s, scene))


def load_position(s: Snapshot, scene: Scene) -> Vector:
    """Where the crushing load acts on the jaw, m; S2 where there is none."""
    if not s.applied.pushes:
        return s.motion.centre("jaw")
    point, _ = s.applied.pushes[0]
    return s.motion.position(point)


def elbow_position(s: Snapshot, scene: Scene) -> Vector:
    """B, the jaw's lower end, m; C is the origin."""
    return s.motion.position(scene.linkage.joints.at("elbow").bore)


def elbow_velocity(s: Snapshot, scene: Scene) -> Vector:
    """Return the velocity of B, the jaw's lower end, m/s."""
    return s.motion.velocity(scene.linkage.joints.at("elbow").bore)


def pin_position(s: Snapshot, scene: Scene) -> Vector:
    """Return the centre A of the shaft's pin, m."""
    return s.motion.position(scene.linkage.joints.at("main").pin)


def rod_tension(s: Snapshot, scene: Scene) -> Scalar:
    """Return the tension of the rod, N."""
    return s.applied.springs[0].pull


def rod_margin(s: Snapshot, scene: Scene) -> Scalar:
    """Return the tension of the rod if it could push, N: where negative, the rod is slack."""
    return s.applied.springs[0].wanted


def crushing_load(s: Snapshot, scene: Scene) -> Vector:
    """Return the crushing load on the jaw, N; zero without one."""
    return s.applied.pushes[0][1] if s.applied.pushes else Vector(0.0, 0.0)


# The main joint, A, is what results of a crusher are of where they name no joint.
_TITLES = {
    joint: Title(f"{joint}_", letter, f"{joint.replace('_', ' ')} {letter}")
    for joint, letter in LETTERS.items()
} | {"main": Title("", "A", "main bearing A")}
_SEEN = {
    "foundation_force": Observable(foundation_force, "N", "|R_O| + |R_C|"),
    "net_foundation_force": Observable(net_foundation_force, "N", "|R_O + R_C|"),
    "joint_force": Observable(joint_force, "N", "force on the jaw at A"),
    "bearing_reaction": Observable(bearing_reaction, "N", "reaction R_O"),
    "elbow_reaction": Observable(elbow_reaction, "N", "reaction R_B"),
    "toggle_reaction": Observable(toggle_reaction, "N", "reaction R_C"),
    "crushing_load": Observable(crushing_load, "N", "crushing load on the jaw"),
    "load_position": Observable(load_position, "m", "where the load acts on the jaw"),
    "pin_position": Observable(pin_position, "m", "centre A of the pin"),
    "jaw_position": Observable(elbow_position, "m", "lower end B"),
    "jaw_mass_centre": Observable(jaw_mass_centre, "m", "mass centre S2 of the jaw"),
    "jaw_velocity": Observable(elbow_velocity, "m/s", "velocity of B"),
}
_USUAL = {
    "foundation_rms": Statistic("N", "RMS of |R_O| + |R_C|", foundation_force, PowerMean(2)),
    "foundation_mean": Statistic("N", "mean of |R_O| + |R_C|", foundation_force, PowerMean()),
    "foundation_peak": Statistic("N", "peak of |R_O| + |R_C|", foundation_force, PEAK),
}


def _cap(joint: str) -> dict[str, Observable]:
    called = f"the cap of the {_TITLES[joint].words}"
    return sensors_at(f"{joint}_cap", joint, cap_velocity, cap_acceleration, called)


def _own(parts: Parts) -> Asked:
    seen, usual, limits = dict(_SEEN), dict(_USUAL), {}
    # Within 20 % of a peak that lasts 5 % of a turn, and differentiable where the instant of the
    # peak jumps.
    smooth = Statistic("N", "(mean of (|R_O| + |R_C|)^16)^(1/16)", foundation_force, PowerMean(16))
    further = {"foundation_smooth_peak": smooth}
    for joint in dict.fromkeys(("main", *parts.loose)):
        title, force = _TITLES[joint], OfPart(force_at, joint)
        meaning = f"largest force at {title.title}"
        further[f"{title.prefix}joint_peak"] = Statistic("N", meaning, force, PEAK)
    # The housing of A is the jaw's; that of O moves with a frame on supports alone.
    sensors = _cap("main") | (_cap("shaft_bearing") if parts.supports else {})
    for point in parts.points:
        more = sensors_at(point, point)
        require_new(more, seen | sensors)
        sensors |= more
    seen |= sensors
    if parts.springs:
        seen["rod_tension"] = Observable(rod_tension, "N", "tension of the rod")
        meaning = "least tension of the rod; where it is negative the rod is slack"
        usual["rod_tension_least"] = Statistic("N", meaning, rod_margin, LEAST)
        limits["rod"] = Tautness, ("rod_tension_least",)
    return Asked(seen, usual, further, limits, tuple(sensors))


CRUSHER = Template(
    joints=tuple(_TITLES.items()),
    crank=Title("shaft_", "shaft", "shaft"),
    springs="rod_",
    origin="C",
    headline="foundation_rms",
    own=_own,
    outline=outline,
)
# A crusher all of whose joints are loose and rub, on supports, with a rod; the last has rollers.
_ONE = ("main",)
_EVERY = Parts(JOINTS, JOINTS, JOINTS, _ONE, _ONE, supports=True, springs=True, rests=True)
# Name -> what it is of a crusher, for where no scene is at hand: a scene has those of its parts.
OBSERVABLES: Mapping[str, Observable] = asked_of(CRUSHER, _EVERY).observables
STATISTIC: Mapping[str, Statistic] = asked_of(CRUSHER, _EVERY).statistics
# What a sentence calls the forces that a machine is judged by, which tables define: what frame and
# bearings carry, with weight and crushing load, what shakes the ground, and their largest values.
CALLED = {
    "foundation_rms": "RMS force on the foundation",
    "foundation_peak": "peak force on the foundation",
    "shaking_rms": "RMS shaking force",
    "shaking_peak": "peak shaking force",
    "joint_peak": "peak force in the main bearing",
}
# What `statistics` computes of the paper's crusher without being asked, by joint that is loose.
STATISTICS = tuple(asked_of(CRUSHER, Parts(JOINTS, ("main",))).usual)
ALWAYS = tuple(asked_of(CRUSHER, Parts(JOINTS, JOINTS)).usual)
