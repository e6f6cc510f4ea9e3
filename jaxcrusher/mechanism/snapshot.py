"""Everything known of one instant of the motion: positions, velocities, accelerations, forces."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from jaxtyping import Array, Scalar

from jaxcrusher.basics.plane import Vector, direction
from jaxcrusher.basics.record import Record
from jaxcrusher.joint.clearance import Contact
from jaxcrusher.mechanism.equations import Accelerations
from jaxcrusher.mechanism.motion import Motion
from jaxcrusher.mechanism.named import Named


class FrameMotion(Record):
    """A frame on supports: motion of its mass centre in the ground's axes, and of its angle."""

    displacement: Vector  # from where it is drawn, m
    rotation: Scalar  # rad
    axis: Vector  # unit vector of its x axis
    velocity: Vector  # m/s
    spin: Scalar  # rad/s


def frame_at(displacement: Vector, rotation: Scalar, velocity: Vector, spin: Scalar) -> FrameMotion:
    """Return the frame with this place and motion."""
    return FrameMotion(displacement, rotation, direction(rotation), velocity, spin)


class Snapshot(Record):
    """One instant, relative to the frame and in its axes, but for `frame` itself."""

    motion: Motion
    contacts: Named[Contact]  # of loose joints
    applied: Any  # what acts besides weight and joints, as the scene says it
    accelerations: Accelerations
    frame: FrameMotion | None = None  # None: clamped


class Observable(NamedTuple):
    """A named function of an instant, a scalar or a vector."""

    function: Callable[[Snapshot, Any], Scalar | Vector]
    unit: str
    meaning: str

    def __call__(self, snapshot: Snapshot, scene: Any) -> Array:
        """The value, a vector as an array of shape (2,)."""
        value = self.function(snapshot, scene)
        return value.array() if isinstance(value, Vector) else value


@dataclass(frozen=True)
class OfPart:
    """A function of an instant at one joint, slide, body or point, by its name.

    It equals its copies, also of another process: programs are kept for it.
    """

    function: Callable[[Snapshot, Any, str], Any]
    part: str

    def __call__(self, snapshot: Snapshot, scene: Any) -> Any:
        """The value at the part."""
        return self.function(snapshot, scene, self.part)
