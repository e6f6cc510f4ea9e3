"""Scenes by which of their joints are loose, in hard contact, and what pushes their frame."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

import jaxcrusher as jc
from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher import observables as ob
from jaxcrusher.mechanism.starts import Given

LOOSE = {f"{joint}.clearance": 1e-4 for joint in ("elbow", "pivot")}
KINDS = {
    "A": {},
    "ideal": {"joint": "ideal"},
    "A by multipliers": {"formulation": "multiplier"},
    "all": LOOSE,
    "all by multipliers": {"formulation": "multiplier", **LOOSE},
}


def sliding(kind, **values):
    """Return a scene of a kind whose joints with clearance start in hard contact and slide."""
    scene = jc.build_scene({"slip": "surface", **KINDS[kind], **values})
    if kind == "ideal":
        return scene
    at = Vector(-0.9, -0.6), Vector(0.5, 0.9)
    start = Given(*(scene.joints.map(lambda _, one=one: one) for one in at))
    return eqx.tree_at(lambda s: s.start, scene, start)


def at_start(scene):
    """Return the snapshot of a scene at time zero."""
    return scene.formulation.snapshot(jnp.array(0.0), scene.formulation.initial(scene), scene)


def check_pushes_of_the_frame(scene, kind):
    """Bearing, pivot, drive, fixed jaw and rod push the frame by what the bodies' momentum says."""

    @eqx.filter_jit
    def apart(scene):
        s = at_start(scene)
        at_bearing, at_pivot = ob.bearing_reaction(s, scene), ob.toggle_reaction(s, scene)
        point = Vector(0.0, 0.0) if scene.foundation is None else scene.foundation.point
        force = -(at_bearing + at_pivot) - s.applied.load.force
        moment = point.cross(at_pivot) - (scene.machine.bearing - point).cross(at_bearing)
        moment -= ob.drive_torque(s, scene)
        moment -= (ob.load_position(s, scene) - point).cross(s.applied.load.force)
        if scene.rod is not None:
            pull = s.applied.rod.force
            force, moment = force - pull, moment - (scene.rod.on_frame - point).cross(pull)
        if "pivot" in s.contacts:
            moment += s.contacts["pivot"].bearing_moment
        force, moment = force - ob.ground_force(s, scene), moment - ob.ground_moment(s, scene)
        return force.array(), moment, ob.foundation_force(s, scene)

    force, moment, size = apart(scene)
    # Rounding of forces and of their moments at arms of half a metre; q'' of the multipliers is
    # known to 1e-10 of them.
    allowed = (1e-9 if "multipliers" in kind else 1e-11) * float(size)
    np.testing.assert_allclose(force, 0, atol=allowed)
    assert abs(float(moment)) < allowed
