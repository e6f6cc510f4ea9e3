"""The load sheet of a foundation beside the observables of its orbit."""

import itertools

import numpy as np
import pytest
import xarray as xr

import jaxcrusher as jc
from jaxcrusher.orbits.load_sheet import SAMPLES, ZONES, joint_states, sheet, support_kind, zone


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
    mode = rows["undamped frequency of mode 1"]
    # Of three digits.
    times = mode.value / (31.0 / (2 * np.pi))
    assert mode.remark.startswith(f"{times:.3g} times the running frequency, most in ")
    # Supports carry all weight, the frame feels what moves alone.
    static = {row.name: row.remark for row in sheet(orbit, 1) if row.part == "static loads"}
    assert static["left force, vertically"] == ""
    assert static["ground moment"] == "of shaft, jaw and toggle alone"


def test_a_support_is_rigid_or_flexible_in_each_direction():
    """Soft springs horizontally, with vertical modes from 2.98 times the running frequency on."""
    block = {"foundation.mass": 6e3, "foundation.x": 0.3, "foundation.y": 0.2, "joint": "ideal"}
    block |= {"foundation.horizontal_stiffness": 1e6, "foundation.vertical_stiffness": 30e6}
    scene = jc.build_scene(block | {"foundation.horizontal_damping": 50e3})
    rows = {row.name: row for row in sheet(jc.periodic_orbit(scene), 1)}
    upright = rows["RMS displacement of G, vertically"], rows["RMS velocity of G, vertically"]
    # As measured by one who found both a zone too good.
    assert [row.value for row in upright] == pytest.approx([70.5, 2.12], rel=2e-3)
    assert [row.remark for row in upright] == ["zone C, rigid support", "zone B, rigid support"]
    for place in ("G", "the main bearing"):
        assert rows[f"RMS velocity of {place}, horizontally"].remark.endswith("flexible support")
    decays = [row for row in rows.values() if row.name.startswith("decay of free motion")]
    assert len(decays) == 3 and all("vibrates at" in row.remark for row in decays)


def test_a_mode_counts_where_it_moves_the_place():
    """Of a slow rocking mode G feels nothing, and a place above it moves horizontally alone."""
    shapes = xr.DataArray([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]], dims=("mode", "coordinate"))
    modes = xr.Dataset({"frequency": ("mode", [1.2, 3.0, 4.0]), "shape": shapes})
    kinds = [
        support_kind(modes, 1.0, np.array(arm), axis)
        for arm in ([0.0, 0.0], [0.0, 1.0], [0.3, 0.3])
        for axis in ("x", "y")
    ]
    # A rotation of 1 moves the last place by 0.3: 0.09 of 1.09 is less than a tenth.
    assert kinds == ["rigid", "rigid", "flexible", "rigid", "rigid", "rigid"]


def test_a_clamped_frame_has_a_shorter_sheet():
    rows = sheet(jc.periodic_orbit(jc.ideal_scene(30.0)), 1)
    assert {row.part for row in rows} == {"static loads", "harmonics", "peaks"}
    named = {row.name for row in rows}
    assert "ground force, vertically" in named and not any("support" in name for name in named)
    # The load and its reaction cancel, which rounding does not quite.
    assert next(row.value for row in rows if row.name == "ground force, horizontally") == 0.0
    static = {row.remark for row in rows if row.part == "static loads"}
    assert static == {"of shaft, jaw and toggle alone"}


def test_the_title_says_the_state_of_each_joint():
    ideal = joint_states(jc.ideal_scene(30.0))
    named = "main bearing A", "elbow B", "pivot C", "shaft bearing O"
    assert ideal == ", ".join(f"{name} is ideal" for name in named)
    worn = {"clearance": 6e-5, "elbow.clearance": 2e-5}
    assert joint_states(jc.build_scene(worn)).startswith(
        "main bearing A has a radial clearance of 0.06 mm, elbow B has a radial clearance of 0.02"
    )
    rolls = joint_states(jc.build_scene({"contact_law": "rollers"}))
    assert rolls.startswith("main bearing A has rollers and a radial clearance of ")


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


@pytest.mark.parametrize("value", [np.nan, -1.0, np.inf])
def test_what_is_no_rms_has_no_zone(value):
    with pytest.raises(ValueError, match="`value` must be an RMS, finite and >= 0, but is"):
        zone("rigid", "velocity", value)
    with pytest.raises(ValueError, match="`kind` must be one of 'rigid', 'flexible'"):
        zone("soft", "velocity", 1.0)
