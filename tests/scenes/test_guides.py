"""Guides by a file: what their keys say, orbits with slopes, lanes, pictures, and closing."""

from pathlib import Path

import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.joint.friction import AmbrosioFriction, SurfaceSlip
from jaxcrusher.joint.guide import Guide
from jaxcrusher.joint.normal import sphere_stiffness
from jaxcrusher.pictures.plots import pins_and_force
from jaxcrusher.scenes.reader import linkage
from tests.differences import assert_slopes
from tests.pairs import slow

EXAMPLES = Path(__file__).parents[2] / "examples"
# The weight presses the slider to its lower edge: it keeps contact.
PRESSED = {"slides.guide.impact_law": "constant", "gravity": 9.81, "speed": 10.0}


def loose(**extra):
    return jc.read_machine(EXAMPLES / "loose_guide.toml").replace(**PRESSED | extra)


def rubbing(**extra):
    own = {"slides.guide.friction": 0.1, "slides.guide.length": 0.05}
    return jc.read_machine(EXAMPLES / "pump.toml").replace(**own | extra)


def test_a_file_says_what_a_guide_is():
    one = loose(**{"slides.guide.friction": 0.2}).scene()
    guide, slide = one.joints.at("guide"), one.linkage.slides.at("guide")
    assert isinstance(guide, Guide) and len(one.guides) == 0
    assert float(guide.clearance) == 5e-4 and float(guide.corner_radius) == 1e-3
    assert float(guide.normal.stiffness) == float(sphere_stiffness(1e-3, 207e9, 0.3))
    assert isinstance(guide.friction, AmbrosioFriction)
    assert isinstance(guide.friction.slip, SurfaceSlip)
    assert (float(slide.length), float(slide.height)) == (0.05, 0.05)

    other = rubbing().scene()
    assert other.guides.names == ("guide",) and "guide" not in other.joints
    assert float(other.guides.at("guide").coefficient) == 0.1
    assert len(rubbing(**{"slides.guide.friction": 0.0}).scene().guides) == 0


CASES = [
    (loose, "slides.guide.clearance", 5e-4),
    (rubbing, "slides.guide.friction", 0.1),
]


@pytest.mark.parametrize(("made", "name", "value"), slow(*CASES))
def test_an_orbit_has_slopes_by_the_numbers_of_a_guide(made, name, value):
    """Central differences over 1e-3 of a value leave 1e-6 of third derivatives of order one.

    Orbits are known to 1e-14 of torques of 0.1 N m: over 1e-6 m that is 3e-7 of the slope.
    """
    orbit = jc.periodic_orbit(made().scene())
    assert bool(orbit.stable)

    def torque(number):
        found = jc.periodic_orbit(made().scene(**{name: number}), guess=orbit)
        return found.values["drive_torque_rms"]

    assert_slopes(torque, value, 1e-3 * value, rtol=2e-6)
    # What friction takes the drive gives.
    taken = float(orbit.values["drive_power"])
    assert (taken > 1.0) if made is rubbing else abs(taken) < 1e-9


@pytest.mark.parametrize("made", [loose, rubbing])
def test_lanes_have_the_same_statistics(made):
    """The engine of sweeps steps as the lone run does, with another order of sums."""
    machine = made(speed=300.0)
    grid = jc.sweep(machine, {"speed": [300.0, 310.0]}, 0, 1, rtol=1e-9)
    alone = jc.statistics(machine.scene(), 0, 1, rtol=1e-11)
    # Impacts of the loose guide tear trajectories apart, by exp(200 t) or more: 1e-9 becomes 1e-7
    # over the 21 ms of a turn.
    assert float(grid.shaking_rms[0]) == pytest.approx(float(alone.shaking_rms), rel=1e-6)


def test_each_gap_has_a_picture():
    """A circle for a pin, a square for a slider, each with its clearance in the title."""
    scene = jc.read_machine(EXAMPLES / "loose_guide.toml").scene()
    seen = {"guide_eccentricity": np.array([[0.0, 0.0], [2e-4, -3e-4]])}
    figure, _ = pins_and_force(scene, seen)
    (first, *_) = figure.axes
    assert first.get_title() == "guide: gap on either side 0.5 mm"
    square, path = (line.get_xydata() for line in first.lines)
    np.testing.assert_allclose(np.abs(square).sum(axis=1), 0.5, rtol=1e-12)
    np.testing.assert_allclose(path, [[0.0, 0.0], [0.2, -0.3]], rtol=1e-12)


def test_links_close_wherever_the_slider_is_in_its_gap():
    """A rod that is just long enough without the gap is refused with it."""
    of = {"length": 0.05, "height": 0.05, "clearance": 5e-4, "corner_radius": 1e-3}

    def made(rod, guide):
        return linkage(
            crank="crank",
            speed=20.0,
            bodies={name: {"mass": 0.2, "inertia": 1e-4} for name in ("crank", "rod", "slider")},
            joints={
                "O": {"bore": ["frame", 0, 0], "pin": ["crank", 0, 0]},
                "A": {"bore": ["rod", 0, 0], "pin": ["crank", 0.05, 0]},
                "B": {"bore": ["rod", rod, 0], "pin": ["slider", 0, 0]},
            },
            slides={"guide": {"body": "slider", "along": [1, 0], **guide}},
        )

    made(0.0502, {})
    with pytest.raises(ValueError, match="with all clearances"):
        made(0.0502, of)
    made(0.052, of)
