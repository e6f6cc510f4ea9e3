"""Numbers of a block from sensors on it alone, against a program by hand."""

import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.identification.identify import identify
from jaxcrusher.identification.measurements import Measurement
from jaxcrusher.identification.model import quantities_of, residual_rows
from tests.differences import differences
from tests.identification import by_hand

pytestmark = pytest.mark.filterwarnings("ignore::jaxcrusher.basics.setup.UnusualNumbers")
CORNER = {"foundation.points.corner": "0.9 m, -0.4 m"}
FREE = {
    "foundation.vertical_stiffness": 4e6,
    "foundation.horizontal_stiffness": 1.5e6,
    "foundation.mass": 6e3,
}
SPEEDS, NODES = (20.0, 33.0, 60.0), 16
# Of each sensor its place in the frame, how often displacement is differentiated, its direction.
SENSORS = {
    "corner_velocity_x": ((0.9, -0.4), 1, 0.0),
    "corner_velocity_-60deg": ((0.9, -0.4), 1, -np.pi / 3),
    "shaft_bearing_cap_acceleration_y": (by_hand.BEARING, 2, np.pi / 2),
}


def shown(values, speed):
    """Harmonics A e^(i phi) of the sensors, of small rotations."""
    x, y, rotation = by_hand.block(values, speed)
    found = {}
    for name, ((right, up), times, angle) in SENSORS.items():
        arm = right - values["foundation.x"], up - values["foundation.y"]
        at = x - rotation * arm[1], y + rotation * arm[0]
        found[name] = (1j * speed) ** times * (np.cos(angle) * at[0] + np.sin(angle) * at[1])
    return found


def rows(values, noise):
    found = []
    for speed in SPEEDS:
        for name, value in shown(values, speed).items():
            sigma = noise * abs(value)
            found.append(
                Measurement(speed, name, 1, float(abs(value)), sigma, float(np.angle(value)))
            )
    return found


@pytest.fixture(scope="module")
def found():
    machine = jc.paper_machine(**by_hand.BLOCK | CORNER | FREE)
    return identify(machine, rows(by_hand.BLOCK, 1e-4), [*FREE], starts=1, nodes=NODES)


def test_sensors_alone_give_mass_and_stiffness_of_a_block(found):
    right = [by_hand.BLOCK[name] for name in FREE]
    # The block's model is linear to 1e-6 of its motion.
    np.testing.assert_allclose([*found.values.values()], right, rtol=1e-5)
    assert not found.unidentifiable and not found.remarks


def test_slopes_of_sensors_are_differences_of_harmonics_by_hand(found):
    measured, size = rows(by_hand.BLOCK, 1.0), found.problem.size
    u = np.array([by_hand.BLOCK[name] / size[name] for name in FREE])
    seen = found.problem.look(u, found.problem.quantities.asked(measured))
    _, slopes = residual_rows(measured, seen)

    def harmonics(shares):
        values = dict(zip(FREE, shares * u * np.array([size[n] for n in FREE]), strict=True))
        one = [z for s in SPEEDS for z in shown(by_hand.BLOCK | values, s).values()]
        return (np.array(one) / [m.amplitude for m in measured]).view(float)

    by = differences(harmonics, np.ones(3), 1e-5) / u
    most = np.abs(by).max(axis=0)
    # Central differences of a step of 1e-5, of a model that is linear to 1e-6.
    np.testing.assert_allclose(slopes / most, by / most, atol=1e-5)


def test_what_can_be_measured_of_a_block():
    """Motion of points and bearing caps, forces of supports, torque and power of the motor."""
    scene = jc.paper_machine(**by_hand.BLOCK | CORNER).scene()
    at = ("main_cap", "shaft_bearing_cap", "corner")
    moves = [f"{one}_{what}" for one in at for what in ("velocity", "acceleration")]
    forces = ["left_force", "right_force", "transmitted_force"]
    assert [*scene.measurable] == ["drive_torque", "drive_power", *moves, *forces]
    known = quantities_of(scene)
    assert known.called("corner_velocity_y") == "velocity of corner vertically"
    assert known.called("left_force_x") == "force of the left support on the ground horizontally"
    assert known.observable("corner_velocity_-22.5deg") == "corner_velocity"
