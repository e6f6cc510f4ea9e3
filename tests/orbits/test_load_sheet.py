"""The load sheet of a foundation beside the observables of its orbit."""

import itertools

import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.orbits.load_sheet import SAMPLES, ZONES, sheet, zone


@pytest.fixture(scope="module")
def orbit():
    values = {"joint": "ideal", "foundation.mass": 6e3, "foundation.x": 0.3, "speed": 31.0}
    return jc.periodic_orbit(jc.build_scene(values))


def test_the_frame_moves_as_a_rigid_body(orbit):
    """G's displacement and velocity are observables; the main bearing turns about G."""
    rows = {row.name: row.value for row in sheet(orbit, 1)}
    angles = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
    names = ("frame_displacement", "frame_velocity", "frame_rotation")
    place, velocity, turned = (np.asarray(orbit.motion(angles, names)[name]) for name in names)
    arm = orbit.scene.machine.bearing.array() - np.array([0.3, orbit.scene.supports.point.y])
    cos, sin = np.cos(turned), np.sin(turned)
    seat = place + np.stack([cos * arm[0] - sin * arm[1], sin * arm[0] + cos * arm[1]], axis=1)
    expected = {
        "RMS displacement of G": 1e6 * place.std(axis=0),
        "RMS velocity of G": 1e3 * np.sqrt(np.mean(velocity**2, axis=0)),
        "RMS displacement of the main bearing": 1e6 * seat.std(axis=0),
    }
    for words, two in expected.items():
        found = [rows[f"{words}, horizontally"], rows[f"{words}, vertically"]]
        # The velocity is differentiated by harmonics, and rounding grows with their order.
        np.testing.assert_allclose(found, two, rtol=1e-6, err_msg=words)


def test_peaks_and_modes_are_the_orbit_s(orbit):
    rows = {row.name: row for row in sheet(orbit, 1)}
    peak = rows["peak of what moves of the force on the ground"].value
    assert peak == float(orbit["transmitted_peak"])
    away = rows["how far G comes from its mean place"]
    assert (away.unit, away.value) == ("um", 1e6 * float(orbit["frame_displacement_peak"]))
    mode = rows["frequency of mode 1"]
    # Of three digits.
    times = mode.value / (31.0 / (2 * np.pi))
    assert mode.remark.startswith(f"{times:.3g} times the running frequency, most in ")


def test_a_clamped_frame_has_a_shorter_sheet():
    rows = sheet(jc.periodic_orbit(jc.ideal_scene(30.0)), 1)
    assert {row.part for row in rows} == {"static loads", "harmonics", "peaks"}
    named = {row.name for row in rows}
    assert "ground force, vertically" in named and not any("support" in name for name in named)
    # The load and its reaction cancel, which rounding does not quite.
    assert next(row.value for row in rows if row.name == "ground force, horizontally") == 0.0


# ISO 10816-3:2009, table A.2, copied a second time.
@pytest.mark.parametrize(
    ("kind", "quantity", "edges"),
    [
        ("rigid", "velocity", (1.4, 2.8, 4.5)),
        ("flexible", "velocity", (2.3, 4.5, 7.1)),
        ("rigid", "displacement", (22, 45, 71)),
        ("flexible", "displacement", (37, 71, 113)),
    ],
)
def test_zones_are_those_of_the_standard(kind, quantity, edges):
    """A zone ends where the next one begins, to a thousandth."""
    for edge, (below, above) in zip(edges, itertools.pairwise("ABCD"), strict=True):
        assert zone(kind, quantity, 0.999 * edge) == below
        assert zone(kind, quantity, 1.001 * edge) == above
    assert ZONES.keys() == {"rigid", "flexible"}
