"""Values come back in the units that they were given in."""

import numpy as np
import pytest

from jaxcrusher.scenes.reader import read_machine
from jaxcrusher.scenes.units import per, said, unit_of, units_of


def test_units_are_read_as_they_are_written(tmp_path):
    path = tmp_path / "crusher.toml"
    path.write_text(
        'speed = "300 rpm"\nfriction = 0.1\nstart = "contact"\n[jaw]\nlength = "0.72 m"\n'
    )
    assert read_machine(path).written == {"speed": "rpm", "jaw.length": "m"}
    # The last one counts, and what has no unit says nothing.
    given = units_of([("speed", "250rpm"), ("speed", "30 rad/s"), ("friction", "0.2")])
    assert given == {"speed": "rad/s"}
    assert read_machine(None).written == {}


def test_values_are_said_in_the_units_given():
    units = {"speed": "rpm", "clearance": "um", "jaw.length": "m"}
    speed = 300 * np.pi / 30
    assert said("speed", speed, units) == "300 rpm (31.42 rad/s)"
    assert said("clearance", 8e-5, units) == "80 um"
    assert said("jaw.length", 0.72, units) == "0.72 m"
    assert said("speed", 30.0, {"speed": "rad/s"}) == "30 rad/s (286.5 rpm)"
    # As drawings have them where nothing was given.
    assert said("speed", speed, {}) == "31.4159 rad/s (300 rpm)"
    assert said("jaw.length", 0.72, {}) == "720 mm"
    assert said("friction", 0.1, {}) == "0.1" and said("start", "contact", units) == "contact"


@pytest.mark.parametrize(
    ("name", "units", "unit", "one"),
    [
        ("speed", {"speed": "rpm"}, "rpm", np.pi / 30),
        ("speed", {}, "rad/s", 1.0),
        ("clearance", {}, "mm", 1e-3),
        ("young", {}, "GPa", 1e9),
        ("jaw.mass_centre_angle", {}, "deg", np.pi / 180),
        ("friction", {}, "", 1.0),
        ("counterweight.moment_along", {}, "kg m", 1.0),
        ("joints.B.clearance", {}, "", 1.0),
        ("joints.B.clearance", {"joints.B.clearance": "mm"}, "mm", 1e-3),
    ],
)
def test_unit_and_what_one_of_it_is(name, units, unit, one):
    found, factor = unit_of(name, units)
    # Rounding of a conversion.
    assert found == unit and factor == pytest.approx(one, rel=1e-15)


def test_units_of_slopes():
    assert [per("N", unit) for unit in ("mm", "rad/s", "kg m2", "")] == [
        *("N/mm", "N/(rad/s)", "N/(kg m2)", "N")
    ]
