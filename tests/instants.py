"""Energies along a motion, which no acceleration is solved for."""

from dataclasses import replace

from jaxcrusher.mechanism.acting import acting
from jaxcrusher.mechanism.state import contacts_of, frame_units


def at_state(snapshot, time, state, scene):
    """Return a snapshot with the places, velocities and contacts of a state.

    Energies ask for no more. To solve for accelerations too takes most of a trace.
    """
    motion = scene.formulation.motion(time, state, scene)
    return replace(
        snapshot,
        motion=motion,
        contacts=contacts_of(scene, motion, state.parts.memories),
        applied=acting(motion, scene.pushes, scene.springs, scene.supports),
        frame=None if state.frame is None else frame_units(scene).motion(state.frame),
    )
