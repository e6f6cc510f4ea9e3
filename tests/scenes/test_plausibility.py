"""Slips of units and magnitudes are told; the paper's box is not."""

import itertools
import re
import warnings
from pathlib import Path

import jax
import pint
import pytest

import jaxcrusher as jc
from jaxcrusher.basics import setup
from jaxcrusher.basics.setup import UnusualNumbers
from jaxcrusher.commands import options
from jaxcrusher.commands.machines import read_machine
from jaxcrusher.scenes.machine import Machine, tell_about
from jaxcrusher.scenes.parameters import CHAMBER, NUMBERS, PE250X400, openers, readable
from jaxcrusher.scenes.plausibility import RATIOS, remarks


def test_the_paper_s_box_is_plausible():
    for speed, clearance in itertools.product((25.0, 40.0), (0.03e-3, 0.12e-3)):
        assert remarks({"speed": speed, "clearance": clearance}) == []
    # A machine twice as large, slower by the root of two, has the same ratios.
    powers = {"m": 1, "kg": 3, "kg m2": 5, "N": 2}
    numbers = {
        n: p.default * 2 ** powers.get(p.unit, 0)
        for n, p in NUMBERS.items()
        if n in PE250X400 or n in CHAMBER
    }
    numbers["speed"] = 30 / 2**0.5
    assert remarks(numbers) == []
    # And they are the same to rounding, but for those of loads and speeds, which have a scale.
    for one in RATIOS:
        if set(one.of) <= numbers.keys() and not {"load", "speed"} & set(one.of):
            drawn = one.ratio(*(NUMBERS[name].default for name in one.of))
            assert one.ratio(*(numbers[name] for name in one.of)) == pytest.approx(drawn, rel=1e-12)


BLOCK = {"foundation.mass": 124e3, "foundation.inertia": 2.5e5, "foundation.y": -0.9}
BLOCK |= {"foundation.base": -2.0, "foundation.left": -1.5, "foundation.right": 2.1}
BLOCK |= {"foundation.soil.length": 6.0, "foundation.soil.width": 4.0}
SOIL = BLOCK | {"foundation.soil.shear_modulus": 45e6}


def test_what_a_description_does_not_use_is_not_judged():
    """A load of none, or of a law that has its own; and a usual block on soil."""
    small = {"load": 1.0, "motor_power": 15e3}
    assert len(remarks(small)) == 2
    for unused in ({"load": 0.0}, {"load_law": "none"}, {"load_law": "chamber"}):
        assert remarks(small | unused) == []
    assert remarks(SOIL) == []


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"clearance": 5e-3}, "clearance / bore_radius is 0.0385, usually 0.0001 to 0.005"),
        ({"clearance": 6.5001e-4}, "bore_radius is 0.0050001, usually 0.0001 to 0.005"),
        ({"clearance": 5e-3}, "clearance 5 mm, bore_radius 130 mm meant?"),
        ({"speed": 250.0}, "speed 250 rad/s (2387 rpm), shaft.eccentricity 10 mm meant?"),
        ({"jaw.mass": 52.4}, "mass of the jaw over its cubed length is 156 kg/m3, usually 300 kg"),
        ({"young": 20.7e9}, "young is 20.7 GPa, usually 40 GPa to 700 GPa"),
        ({"gravity": 1.62}, "gravity is 1.62 m/s2"),
        ({"jaw.mass_centre_distance": 0.6}, "jaw.length is 0.863, usually 0.2 to 0.7"),
        ({"chamber.nip_angle": 0.6}, "chamber.nip_angle is 34.4 deg"),
        ({"contact_law": "rollers", "rollers.length": 0.016}, "of their size is 1.9, usually 0.7"),
        ({"contact_law": "rollers", "rollers.dynamic_rating": 98e6}, "static_rating is 87.5, usu"),
        ({"foundation.mass": 1e5}, "distance of its supports is 0.0988, usually 0.2 to 1.2"),
        # A throw, a diameter and a radius in the place of the other.
        ({"shaft.eccentricity": 0.02}, "width of the mouth is 0.163, usually 0.03 to 0.15"),
        ({"bore_radius": 0.26}, "bore_radius / shaft.eccentricity is 26, usually 5 to 18"),
        (
            {"contact_law": "rollers", "bore_radius": 0.26},
            "rollers.pitch_diameter is 1.37, usually",
        ),
        ({"contact_law": "rollers", "bore_radius": 0.065}, "is 0.342, usually 0.55 to 0.8"),
        ({"contact_law": "rollers", "rollers.bore": 0.06}, "rollers.bore is 3.17, usually 1.15"),
        # Millinewtons, and a lump's force beside a large motor.
        ({"load": 8.8e-3}, "of the chamber is 3.67e-08 MPa, usually 0.01 MPa to 3 MPa"),
        ({"load": 600.0, "motor_power": 110e3}, "motor_power is 0.000521, usually 0.02 to 5"),
        (SOIL | {"foundation.soil.shear_modulus": 45e9}, "shear_modulus is 45000 MPa, usually 5"),
        ({**BLOCK, "foundation.soil.shear_wave_speed": 3e3}, "wave_speed is 3000 m/s, usually 50"),
        (SOIL | {"foundation.soil.density": 500.0}, "density is 500 kg/m3, usually 1200 kg/m3 to"),
        (
            SOIL | {"foundation.soil.length": 0.6, "foundation.soil.width": 0.6},
            "weight of the block over its base is 3380 kPa, usually 3 kPa to 400 kPa",
        ),
        (
            SOIL | {"foundation.base": 0.5},
            "above its base over the distance of its supports is -0.",
        ),
    ],
)
def test_what_is_unusual_is_told(values, words):
    found = remarks(values)
    assert any(words in line for line in found), found
    assert all("\n" not in line and "usually" in line for line in found)


@pytest.mark.parametrize(
    ("values", "name"),
    [
        ({"clearance": 0.10}, "clearance"),
        ({"jaw.mass": 0.524}, "jaw.mass"),
        ({"jaw.mass": 524e3}, "jaw.mass"),
        ({"bore_radius": 130.0}, "bore_radius"),
        ({"young": 207.0}, "young"),
        ({"speed": 3000.0}, "speed"),
        ({"clearance": 0.02, "bore_radius": 1.0, "jaw.length": 7.0}, "clearance"),
        ({"load": 8.8e9}, "load"),
        ({"contact_law": "rollers", "rollers.length": 32.0}, "rollers.static_rating"),
        ({"contact_law": "rollers", "rollers.dynamic_rating": 980.0}, "rollers.dynamic_rating"),
        (SOIL | {"foundation.soil.shear_modulus": 45e3}, "foundation.soil.shear_modulus"),
        (SOIL | {"foundation.soil.density": 1.8}, "foundation.soil.density"),
        # Without a scene that refuses it first.
        ({"contact_law": "rollers", "rollers.diameter": 0.19}, "rollers.static_rating"),
        ({"jaw.mass_centre_distance": 0.8}, "jaw.mass_centre_distance"),
    ],
)
def test_what_cannot_be_is_refused(values, name):
    with pytest.raises(ValueError, match=f"^Argument `{name}` must be possible") as error:
        remarks(values)
    assert "usually" in str(error.value) and "\n" not in str(error.value)


def test_a_command_tells_what_an_example_on_rollers_leaves(capsys):
    path = Path(__file__).parents[2] / "examples" / "pe900x1200.toml"
    values = read_machine(options.Crusher(scene=path)).values
    assert values["contact_law"] == "rollers"
    assert "pe900x1200.toml leaves 2 numbers to the PE250x400" in capsys.readouterr().err


def left_open(values):
    # No crusher may have such numbers together, so that none is made.
    machine = Machine(jc.paper_machine().structure, values)
    return machine.structure.left_open(machine)


def test_numbers_that_a_scene_file_leaves_to_the_paper_are_told(capsys):
    tell_about(jc.paper_machine(**{"toggle.mass": 20.0}), None)
    assert capsys.readouterr().err == ""
    always = [name for name in NUMBERS if not openers(name)]
    whole = {name: 1.0 for name in always if name not in ("jaw.mass", "load", "friction")}
    told, without = left_open(whole)
    assert told == "leaves 2 numbers to the PE250x400: load 8800 N, jaw.mass 524 kg."
    assert without.startswith("has no load_law: the load is the paper's, constant along")
    # A measured curve has its own force.
    whole |= {"load_law": "by_angle", "jaw.mass": 500.0}
    assert left_open(whole) == []
    # Parts that a crusher need not have, where it has them.
    for part, count, words in (
        ({"foundation.mass": 1e5}, 10, "foundation.inertia 2500 kg m2"),
        ({"foundation.mass": 1e5, "foundation.soil.shear_modulus": 6e7}, 11, "soil.width 2000 mm"),
        ({"contact_law": "rollers"}, 10, "rollers.static_rating 1.12e+06 N"),
        ({"elbow.clearance": 1e-4}, 1, "elbow.bore_radius 40 mm"),
        ({"shaft_bearing.clearance": 1e-4}, 1, "shaft_bearing.bore_radius 70 mm"),
        ({"rod.stiffness": 1e5, "load_scatter": 0.1}, 6, "rod.jaw_along 650 mm"),
    ):
        (told,) = left_open(whole | part)
        assert f" {count} numbers to the PE250x400: " in told and words in told


def test_python_warns_once_of_each_value_that_commands_tell(monkeypatch):
    """Whoever mends one slip, and makes another of the same number, is told again."""
    monkeypatch.setattr(setup, "_told", set())
    with pytest.warns(UnusualNumbers) as told:
        jc.paper_scene(286.0, 0.06e-3)
    assert ["speed 286 rad/s (2731 rpm)" in str(one.message) for one in told] == [True] * 2
    with warnings.catch_warnings(record=True) as again:
        warnings.simplefilter("always")
        jc.paper_scene(286.0, 0.06e-3)
        jc.paper_scene(30.0, 0.06e-3)
        # What a traced program alone will know.
        jax.jit(lambda clearance: jc.paper_scene(30.0, clearance).joints.at("main").clearance)(0.02)
        assert again == []
        jc.paper_scene(287.0, 0.06e-3)
    assert ["speed 287 rad/s (2741 rpm)" in str(one.message) for one in again] == [True] * 2


def test_an_ideal_joint_has_no_clearance_to_look_at():
    assert remarks({"clearance": 0.1, "joint": "ideal"}) == []


def test_ranges_lie_in_each_other():
    for one in RATIOS:
        least, low, high, most = one.limits
        assert least <= low < high <= most, one.of
        assert all(name in NUMBERS for name in one.of)


def test_a_number_of_its_own_is_told_in_the_unit_that_it_names():
    """Pint converts a second time."""
    registry = pint.UnitRegistry()
    single = [one for one in RATIOS if len(one.of) == 1]
    assert {one.unit for one in single} == {"GPa", "MPa", "m/s2", "m/s", "kg/m3", "deg"}
    for one in single:
        number = NUMBERS[one.of[0]]
        units = (re.sub(r"([sm])(\d)", r"\1**\2", text) for text in (number.unit, one.unit))
        given, wanted = map(registry.Unit, units)
        expected = registry.Quantity(number.default, given).to(wanted).magnitude
        assert one.ratio(number.default) == pytest.approx(expected, rel=1e-14), one.of


def test_readable_units():
    assert readable("clearance", 6e-5) == "0.06 mm" and readable("young", 207e9) == "207 GPa"
    assert readable("speed", 30.0) == "30 rad/s (286.5 rpm)"
    assert readable("friction", 0.1) == "0.1" and readable("start", "contact") == "contact"
    assert readable("jaw.mass_centre_angle", jc.PE250X400["jaw.mass_centre_angle"]) == "15 deg"
