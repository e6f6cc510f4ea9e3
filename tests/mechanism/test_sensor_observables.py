"""What sensors on bodies and on a frame show: the motion past the ground, in the ground's axes."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.basics.plane import Arm
from jaxcrusher.mechanism.linkage import Point
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.observables import cap_velocity, point_acceleration, point_velocity
from jaxcrusher.mechanism.topology import FRAME
from tests.mechanism.loosened import moved, scene_of

SENSORS = {"four-bar": "coupler", "slider-crank": "slider"}


def place(s, scene, point):
    """Where a point is past the ground, m."""
    at = s.motion.position(point)
    if s.frame is None:
        return at
    centre = scene.foundation.point
    return centre + s.frame.displacement + (at - centre).along(s.frame.axis)


@pytest.mark.parametrize(
    ("name", "loose", "drive", "frame"),
    [
        ("four-bar", ("big end",), "uneven", True),
        ("slider-crank", ("guide", "wrist"), "even", True),
        ("slider-crank", (), "torque", True),
        ("four-bar", ("small end",), "even", False),
    ],
)
def test_sensors_show_derivatives_of_their_place(name, loose, drive, frame, machine, linkages):
    """Of a body that swings, of its mass centre, of a slider, and of a frame that turns."""
    scene, body = scene_of(machine, linkages, name, loose, drive, frame), SENSORS[name]
    points = {"tip": Point(body, Arm(0.11, -0.07))}
    points |= {"corner": Point(FRAME, Arm(-0.4, 0.5))} if frame else {}
    scene, way = replace(scene, points=Named(points)), scene.formulation
    time, state = jnp.asarray(0.07), moved(way.initial(scene))
    rate = way.rate(way.snapshot(time, state, scene), state, scene)

    def seen(time, state):
        s = way.snapshot(time, state, scene)
        names = (*points, body, scene.linkage.crank)
        places = [place(s, scene, scene.point(one)).array() for one in names]
        velocities = [point_velocity(s, scene, one).array() for one in names]
        accelerations = [point_acceleration(s, scene, one).array() for one in names]
        joint = scene.linkage.joints.names[-1]
        places.append(place(s, scene, scene.linkage.joints.at(joint).bore).array())
        velocities.append(cap_velocity(s, scene, joint).array())
        return jnp.stack(places), jnp.stack(velocities), jnp.stack(accelerations)

    found, change = jax.jvp(seen, (time, state), (jnp.ones(()), rate))
    _, velocities, accelerations = (np.asarray(one) for one in found)
    # Rounding of sums of some m/s and of some 1e3 m/s2, under contacts of some 1e5 N.
    np.testing.assert_allclose(velocities, change[0], atol=1e-12 * np.abs(velocities).max())
    size = np.abs(accelerations).max()
    np.testing.assert_allclose(accelerations, change[1][:-1], atol=1e-11 * size)
    # Each of them moves.
    assert np.linalg.norm(velocities[:-1], axis=1).min() > 1e-3
