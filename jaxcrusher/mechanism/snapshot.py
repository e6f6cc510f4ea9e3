"""Everything known of one instant of the motion: positions, velocities, accelerations, forces."""

from typing import Any

import equinox as eqx
from jaxtyping import Scalar

from jaxcrusher.basics.plane import Vector, direction
from jaxcrusher.joint.clearance import Contact
from jaxcrusher.mechanism.equations import Accelerations
from jaxcrusher.mechanism.motion import Motion
from jaxcrusher.mechanism.named import Named


class FrameMotion(eqx.Module):
    """A frame on supports: motion of its mass centre in the ground's axes, and of its angle."""

    displacement: Vector  # from where it is drawn, m
    rotation: Scalar  # rad
    axis: Vector  # unit vector of its x axis
    velocity: Vector  # m/s
    spin: Scalar  # rad/s


def frame_at(displacement: Vector, rotation: Scalar, velocity: Vector, spin: Scalar) -> FrameMotion:
    """Return a frame that stands and moves so."""
    return FrameMotion(displacement, rotation, direction(rotation), velocity, spin)


class Snapshot(eqx.Module):
    """One instant, relative to the frame and in its axes, but for `frame` itself."""

    motion: Motion
    contacts: Named[Contact]  # of loose joints
    applied: Any  # what acts besides weight and joints, as the scene says it
    accelerations: Accelerations
    frame: FrameMotion | None = None  # None: clamped
    residual: Scalar | None = None  # of held joints, m or rad; None: they are held exactly
