"""Linkages with loose joints, any drive and a frame on supports, in motion."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxcrusher.basics.plane import Vector
from jaxcrusher.mechanism.drives import ConstantSpeed, GivenTorque, UnevenSpeed
from jaxcrusher.mechanism.starts import Given
from jaxcrusher.mechanism.supports import OnSupports

SUPPORTS = OnSupports(
    mass=60.0,
    inertia=3.0,
    point=Vector(0.1, -0.1),
    left=-0.2,
    right=0.4,
    base=-0.3,
    horizontal_stiffness=1e6,
    vertical_stiffness=2e6,
    horizontal_damping=1e3,
    vertical_damping=2e3,
)
DRIVES = {"even": ConstantSpeed(20.0), "uneven": UnevenSpeed(20.0, 0.2, 2.0, 0.5)}
DRIVES["torque"] = GivenTorque(30.0, 20.0)


def scene_of(machine, linkages, name, loose, drive, frame):
    loose = linkages[name].joints.names if loose == "all" else loose
    rubbing = ["guide"] if "rubbing guide" in loose else []
    loose = [one for one in loose if one != "rubbing guide"]
    scene = machine(name, loose, DRIVES[drive], rubbing)
    random = np.random.default_rng(7)
    at = {joint: random.normal(size=2) for joint in loose}
    start = Given(
        # Some 3 % beyond touching, and moving.
        {joint: Vector(*(1.03 * one / np.hypot(*one))) for joint, one in at.items()},
        {joint: Vector(*random.normal(scale=0.05, size=2)) for joint in loose},
    )
    foundation = SUPPORTS if frame else None
    return eqx.tree_at(
        lambda s: (s.start, s.foundation), scene, (start, foundation), is_leaf=lambda x: x is None
    )


def moved(state):
    """The state with its frame off its place, turning."""
    if state.frame is None:
        return state
    where = (lambda s: s.frame.rotation, lambda s: s.frame.spin, lambda s: s.frame.velocity.y)
    return eqx.tree_at(
        lambda s: [one(s) for one in where], state, [jnp.asarray(x) for x in (0.3, 0.4, -0.2)]
    )
