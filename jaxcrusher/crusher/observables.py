"""What a crusher alone has at an instant: forces on its foundation, and points of its jaw."""

from jaxtyping import Scalar

from jaxcrusher.basics.plane import Vector
from jaxcrusher.basics.smooth import norm
from jaxcrusher.crusher.loads import JawMotion
from jaxcrusher.mechanism.acting import Stretched

# It was here first, and is one of any linkage.
from jaxcrusher.mechanism.observables import bearing_stiffness as bearing_stiffness
from jaxcrusher.mechanism.observables import force_width, on_bore, on_pin
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.snapshot import OfPart, Snapshot

# The force of the shaft on the jaw at A, of the frame on the shaft (R_O), of the toggle on the jaw
# (R_B), and of the frame on the toggle (R_C), N.
joint_force = OfPart(on_bore, "main")
bearing_reaction = OfPart(on_pin, "shaft_bearing")
elbow_reaction = OfPart(on_bore, "elbow")
toggle_reaction = OfPart(on_pin, "pivot")


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
        return JawMotion(s.motion).position()
    point, _ = s.applied.pushes[0]
    return s.motion.position(point)


def elbow_position(s: Snapshot, scene: Scene) -> Vector:
    """B, the jaw's lower end, m; C is the origin."""
    return s.motion.position(scene.linkage.joint("elbow").bore)


def elbow_velocity(s: Snapshot, scene: Scene) -> Vector:
    """Return the velocity of B, the jaw's lower end, m/s."""
    return s.motion.velocity(scene.linkage.joint("elbow").bore)


def pin_position(s: Snapshot, scene: Scene) -> Vector:
    """Return the centre A of the shaft's pin, m."""
    return s.motion.position(scene.linkage.joint("main").pin)


def jaw_mass_centre(s: Snapshot, scene: Scene) -> Vector:
    """S2, m."""
    return s.motion.centre("jaw")


def _rod(s: Snapshot) -> Stretched:
    """Return the tension rod as it is stretched."""
    return s.applied.springs[0]


def rod_tension(s: Snapshot, scene: Scene) -> Scalar:
    """Return the tension of the rod, N."""
    return _rod(s).pull


def rod_margin(s: Snapshot, scene: Scene) -> Scalar:
    """Return the tension that a rod would have that can push, N: it is slack where negative."""
    return _rod(s).wanted


def crushing_load(s: Snapshot, scene: Scene) -> Vector:
    """Return the crushing load on the jaw, N; zero without one."""
    return s.applied.pushes[0][1] if s.applied.pushes else Vector(0.0, 0.0)
