"""Scene files: every key comes through, units are converted, and mistakes are named."""

import re
from pathlib import Path

import jax
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.crusher import capacity
from jaxcrusher.scenes.build import build_linkage
from jaxcrusher.scenes.parameters import CHAMBER, CHOICES, FILES, MOMENTS, NUMBERS
from jaxcrusher.scenes.plausibility import borrowed, remarks
from jaxcrusher.scenes.reader import read_scene_file, read_text, read_value
from jaxcrusher.scenes.units import point_of

EXAMPLES = Path(__file__).parents[2] / "examples"
# A unit that is not the SI unit, and its size.
OTHER = {
    "rad/s": ("rpm", np.pi / 30),
    "rad": ("deg", np.pi / 180),
    "m": ("mm", 1e-3),
    "kg": ("g", 1e-3),
    "m/s": ("mm/s", 1e-3),
    "m/s2": ("cm s-2", 1e-2),
    "kg m2": ("kg*cm^2", 1e-4),
    "N": ("kN", 1e3),
    "N/m": ("kN/mm", 1e6),
    "N s/m": ("kN·s/m", 1e3),
    "Pa": ("GPa", 1e9),
    "Pa s": ("mPa s", 1e-3),
    "W": ("kW", 1e3),
    "N m/rad": ("kN m/rad", 1e3),
    "N m s/rad": ("kN m s/rad", 1e3),
    "kg/m3": ("t/m3", 1e3),
    "1": ("%", 1e-2),
}


def write(folder: Path, values: dict) -> Path:
    """A scene file with tables, from dotted names."""
    lines = [f"{name} = {value}" for name, value in values.items() if "." not in name]
    for table in dict.fromkeys(name.split(".")[0] for name in values if "." in name):
        lines.append(f"[{table}]")
        lines += [
            f"{name.partition('.')[2]} = {value}"
            for name, value in values.items()
            if name.startswith(f"{table}.")
        ]
    file = folder / "scene.toml"
    file.write_text("\n".join(lines) + "\n")
    return file


def test_every_key_comes_back(tmp_path):
    """Numbers and quantities; each key with a value of its own, so that none takes another's."""
    values: dict[str, float | str] = {
        name: float((1.01 + 1e-4 * i) * parameter.default)
        for i, (name, parameter) in enumerate(NUMBERS.items())
        # A stroke becomes the eccentricity, and moments are a search's.
        if name not in ("stroke", *MOMENTS)
    }
    values |= {"counterweight.mass": 12.5, "counterweight.angle": -1.25}
    values |= {"fluctuation_order": 3.0, "load_seed": 7.0}  # whole numbers
    values |= {name: offered[-1] for name, offered in CHOICES.items()}
    # As TOML writes them: a choice in quotes, a quantity with its unit, a number without one plain.
    written = {}
    for name, value in values.items():
        unit = "1" if isinstance(value, str) else NUMBERS[name].unit
        plain = isinstance(value, float) and unit == "1"
        written[name] = repr(value) if plain else f'"{value} {unit}"'.replace(' 1"', '"')
    file = write(tmp_path, written)
    assert read_scene_file(file) == values
    # As other systems save it.
    text = file.read_text()
    for content in (text.replace("\n", "\r\n").encode(), b"\xef\xbb\xbf" + text.encode()):
        file.write_bytes(content)
        assert read_scene_file(file) == values
    for name, parameter in NUMBERS.items():
        if name not in values:
            continue
        value = float(values[name])
        if parameter.unit != "1":
            assert read_value(name, f"{value!r} {parameter.unit}") == value, name
        unit, size = OTHER[parameter.unit]
        # Two roundings: of the quotient here, of the product there.
        assert read_value(name, f"{float(value / size)!r} {unit}") == pytest.approx(value, 4e-16), (
            name
        )
    for name, offered in CHOICES.items():
        assert [read_value(name, choice) for choice in offered] == [*offered]


def test_example_is_the_paper_s_crusher():
    """To the last bit, key by key: a result's settings are compared as they are written."""
    chamber = {name: parameter.default for name, parameter in CHAMBER.items()}
    assert read_scene_file(EXAMPLES / "pe250x400.toml") == jc.PE250X400 | chamber


# What is deducted from the open side setting: Metso's handbook of wear parts of the C Series, mm.
C_SERIES = {"C80": 24, "C96": 32, "C100": 32, "C106": 34, "C116": 37, "C3054": 32, "C110": 36}
C_SERIES |= {"C120": 37, "C125": 41, "C130": 41}


def test_a_stroke_becomes_an_eccentricity(tmp_path):
    """That of any C Series, by which the links then move so far."""
    links = {"jaw.length": '"1.5 m"', "toggle.length": '"0.5 m"', "bearing.distance": '"1.4 m"'}
    for name, stroke in C_SERIES.items():
        values = read_scene_file(write(tmp_path, {"stroke": f'"{stroke} mm"'} | links))
        assert "stroke" not in values
        travel = float(jax.jit(capacity.stroke)(build_linkage(values)))
        assert travel == pytest.approx(1e-3 * stroke, rel=1e-9), name
    # On a command line it takes the place of the file's.
    mine = write(tmp_path, {"shaft.eccentricity": '"20 mm"'})
    given = read_scene_file(mine, (("stroke", "7.4491617 mm"),))
    assert given == {"shaft.eccentricity": pytest.approx(0.01, rel=1e-7)}
    # The file's holds by whatever links, and gives way to an eccentricity.
    mine = write(tmp_path, {"stroke": '"10 mm"'})
    given = read_scene_file(mine, (("toggle.length", "250 mm"),))
    assert float(capacity.stroke(build_linkage(given))) == pytest.approx(0.01, rel=1e-9)
    throw = {"shaft.eccentricity": 0.012}
    assert read_scene_file(mine, (("shaft.eccentricity", "12 mm"),)) == pytest.approx(throw)


def test_the_stroke_s_ratio_is_that_of_places():
    machine = build_linkage({})
    seen = jc.simulate(
        jc.ideal_scene(30.0), np.linspace(0, 2 * np.pi / 30, 2001), outputs=("jaw_position",)
    ).jaw_position
    across, along = np.ptp(np.asarray(seen), axis=0)
    # By 720 and 2001 angles.
    assert float(capacity.stroke_ratio(machine)) == pytest.approx(along / across, rel=1e-4)
    assert float(capacity.stroke(machine)) == pytest.approx(across, rel=1e-5)


@pytest.mark.parametrize("name", ["pe600x900", "pe900x1200", "like_c106"])
def test_examples_are_machines(name):
    """Whole and usual, with a drive that the motor has the power for."""
    values = read_scene_file(EXAMPLES / f"{name}.toml")
    assert set(borrowed(values)) == {"rollers.friction", "chamber.loosening"}
    assert remarks(values) == []
    orbit = jc.periodic_orbit(jc.build_scene(values).ideal())
    assert 0.5 < float(orbit.drive_power) / float(values["motor_power"]) < 0.9


def test_points_of_the_frame(tmp_path):
    """Their names are free; a place is two quantities, kept as they are written."""
    values = {"foundation.mass": '"6 t"', "foundation.points.corner": '"1.2 m, -400 mm"'}
    read = read_scene_file(write(tmp_path, values))
    assert read == {"foundation.mass": 6e3, "foundation.points.corner": "1.2 m, -400 mm"}
    assert point_of("foundation.points.corner", "1.2 m, -400 mm") == (1.2, -0.4)
    jc.build_scene(read)


def test_template_offers_every_number(tmp_path):
    template = (EXAMPLES / "template.toml").read_text()
    assert set(read_scene_file(EXAMPLES / "template.toml")) == {
        *("speed", "clearance"),
        *("load_law", "load_edge"),
    }
    file = tmp_path / "all.toml"
    file.write_text(re.sub(r"^# ([\w.]+ = )", r"\1", template, flags=re.MULTILINE))
    assert set(read_scene_file(file)) == {*NUMBERS, *CHOICES, *FILES} - {"stroke", *MOMENTS}


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("speed", "286 rpm", 286 * np.pi / 30),
        ("speed", "5 rev/s", 10 * np.pi),
        ("speed", "286 1/min", 286 * np.pi / 30),
        ("speed", "286 U / min", 286 * np.pi / 30),
        ("speed", "286 r/min", 286 * np.pi / 30),
        ("speed", "286 tr/min", 286 * np.pi / 30),
        ("speed", "286 RPM", 286 * np.pi / 30),
        ("load", "900 kp", 900 * 9.80665),
        ("motor_power", "15 PS", 15 * 75 * 9.80665),
        ("jaw.mass", "0.5 tonne", 500.0),
        ("young", "21 kp/um2", 21 * 9.80665e12),
        ("diametral_clearance", "0.12 mm", 0.06e-3),
        ("elbow.bore_diameter", "80 mm", 0.04),
        ("clearance", "0.06 mm", 0.06e-3),
        ("clearance", "60µm", 60e-6),
        ("young", "207e3 N/mm^2", 207e9),
        ("jaw.inertia", "128.48 kg·m²", 128.48),
        ("gravity", "9.81 m s-2", 9.81),
        ("counterweight.angle", "-90 deg", -np.pi / 2),
        ("friction", "10 %", 0.1),
        ("speed", "30rad/s", 30.0),
        ("friction", "0.1", 0.1),
        ("counterweight.mass", "0", 0.0),
        ("start", "contact", "contact"),
    ],
)
def test_values_of_a_command_line(name, text, value):
    # The last digit of a conversion by pi.
    assert read_text(name, text) == (
        value if isinstance(value, str) else pytest.approx(value, 4e-16)
    )


def test_decimal_units_leave_the_very_float():
    """0.07 mm is the float 0.07e-3, which 0.07 * 0.001 is not."""
    for hundredths in range(1, 31):
        text = f"{hundredths / 100:.2f}"
        assert read_text("clearance", f"{text} mm") == float(f"{text}e-3")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("sped = 30", "`sped` must be a known key, but is not; did you mean speed?"),
        ("[jaw]\nlenght = 0.7", "`jaw.lenght` must be a known key, but is not; did you mean jaw"),
        ("[jaw]\nweight = 5", "there are jaw.mass, jaw.inertia"),
        ("[jwa]\nmass = 5", "`jwa.mass` must be a known key, but is not; did you mean [jaw]?"),
        ("jwa = 5", "did you mean jaw?"),
        ('[chamber]\ndischarge = "2 MPa"', "`chamber.discharge` must have a unit of the kind m"),
        ("[motor]\nmass = 5", "there are speed, clearance"),
        ("mass = 5", "did you mean shaft.mass or jaw.mass"),
        ("shaft = 5", "`shaft` must be a table [shaft]"),
        # Tables inside of tables.
        ("[elbow]\nfilm = 5", "`elbow.film` must be a table [elbow.film], but is 5."),
        (
            "[[foundation.soil]]\npoisson = 0.3",
            "`foundation.soil` must be a table [foundation.soil]",
        ),
        ("foundation.points = 5", "`foundation.points` must be a table [foundation.points], but"),
        ("[speed]\nx = 5", '`speed` must be a quoted quantity such as "286 rpm", but is a table'),
        ("speed = true", '`speed` must be a quoted quantity such as "286 rpm", but is a bool'),
        (
            'speed = "30"',
            "`speed` must be a quoted quantity such as \"286 rpm\", but '30' has no unit",
        ),
        ('friction = "0.1"', "`friction` must be a number or a quoted quantity such as"),
        ('friction = "0.1"', "but '0.1' needs no quotes."),
        # What somebody meant in mm, t, GPa, rpm.
        ("clearance = 0.10", '`clearance` must have a unit, as in "0.06 mm", but is 0.1 (write "0'),
        ("[jaw]\nmass = 0.524", '`jaw.mass` must have a unit, as in "1.5 kg", but is 0.524'),
        ("bore_radius = 130", '(write "130 m" if that is meant)'),
        ("young = 207", "`young` must have a unit"),
        ("speed = 250", '`speed` must have a unit, as in "286 rpm", but is 250'),
        ('speed = "3 rpm"\nspeed = "4 rpm"', "is not TOML: a key is given twice."),
        ('load = "3 N"\nload = "4 N"\n', "is not TOML: line 2 gives a key a second time."),
        (
            'clearance = "0.1 mm"\ndiametral_clearance = "0.2 mm"',
            "`diametral_clearance` must not stand beside `clearance`, but is given.",
        ),
        ('diametral_clearance = "0,2 mm"', "`diametral_clearance` must be a quoted quantity such"),
        ('stroke = "34 mm"\n[shaft]\neccentricity = "20 mm"', "`stroke` must not stand beside"),
        # Only a speed is a number of turns.
        ('gravity = "5 1/min"', "`gravity` must have a unit of the kind m/s2, but has '1/min'."),
        ("clearance = 0,06", "is not TOML: line 1 has a decimal comma: write 0.06."),
        ('clearance = "0,06 mm"', "'0,06 mm' has a decimal comma: write '0.06 mm'"),
        (
            "speed = \u201c286 rpm\u201d",
            "is not TOML: line 1 has typographic quotes: write straight",
        ),
        ('speed = "\u201e286 rpm\u201c"', "`speed` must have no typographic quotes"),
        ("friction = 0.1\nspeed = 30 rpm", 'line 2 has a quantity without quotes: write "30 rpm".'),
        ('speed = "5 Hz"', "has 'Hz' (turns or radians? Write rpm or rad/s)"),
        ('speed = "5 1/s"', "has '1/s' (turns or radians? Write rpm or rad/s)"),
        ('clearance = "0.06 kg"', "`clearance` must have a unit of the kind m, but has 'kg'"),
        ('clearance = "0.06 mn"', "`clearance` must have a unit of the kind m, but 'mn' is unk"),
        # Units of other countries, and slips that stand on data sheets.
        ('[jaw]\nmass = "6 ton"', "`jaw.mass` must have a clear unit, but 'ton' may be 907, 1000"),
        ('[jaw]\nmass = "6 Tons"', "'Tons' may be 907, 1000 or 1016 kg: write t or tonne of 1000"),
        (
            '[foundation]\nsoil.density = "2 kton/m3"',
            "'kton/m3' may be 907, 1000 or 1016 kg: write",
        ),
        ('[jaw]\nmass = "6 gr"', "'gr' may be grams or grains: write g."),
        ('[jaw]\nmass_centre_angle = "15 grad"', "'grad' may be degrees or gon: write deg or gon."),
        ('[jaw]\nmass_centre_angle = "15 Grad"', "'Grad' may be degrees or gon: write deg or gon."),
        ('gravity = "1 g0"', "must have a unit of the kind m/s2, but 'g0' is unknown."),
        ('load = "9 KN"', "must have a unit of the kind N, but 'KN' is unknown; did you mean kN?"),
        ('load = "9 mn"', "'mn' is unknown; did you mean MN?"),
        ('motor_power = "15 kw"', "'kw' is unknown; did you mean kW?"),
        ('[jaw]\ninertia = "15 kgm²"', "'kgm²' is unknown; did you mean kg m2?"),
        ('speed = "5 kn"', "but has 'kn'; usual are rpm, rad/s."),
        ('friction = "5 deg"', "`friction` must have a unit of the kind 1, but has 'deg'"),
        ('friction = "3 dB"', "'dB' is unknown"),
        ('[shaft]\nmass_centre_angle = "5 %"', "must have a unit of the kind rad, but has '%'"),
        ('gravity = "9 m^9^9^9"', "'m^9^9^9' is unknown"),
        ('speed = "-3 rpm"', "`speed` must be finite and > 0 rad/s, but is -0.3"),
        ("friction = nan", "`friction` must lie in"),
        ("friction = 1" + 400 * "0", "`friction` must lie in"),
        ("speed = 1" + 400 * "0", "`speed` must be finite, but is inf."),
        ("speed = nan", "`speed` must be finite, but is nan."),
        # Python writes no whole number of more than 4300 digits.
        ("speed = 0x" + 5000 * "f", "`speed` must have fewer digits, but has more than 4300."),
        ("load_curve = [[1, 0o" + 5000 * "7" + "]]", "`load_curve` must have fewer digits, but"),
        ("speed = 1" + 5000 * "0", "is not TOML: a whole number has more than 4300 digits."),
        ('speed = "1e9999999999999999999 rpm"', "rpm' has an exponent of too many digits"),
        ('[counterweight]\nmass = "-5 kg"', "`counterweight.mass` must lie in [0, 100000] kg"),
        ('start = "middle"', "`start` must be one of 'centred', 'contact', but is 'middle'"),
        ("start = 3", "`start` must be one of"),
        ('"jaw.mass" = "5 kg"\n[jaw]\nmass = "6 kg"', "`jaw.mass` must be given once"),
        ("speed 30", "is not TOML: Expected '=' after a key in a key/value"),
        ("speed = 30\nclearance =\n", "(at line 2, column 12)"),
        ("a = " + 3000 * "[", "is not TOML"),
        (b"speed = 30 # \xff", "must be UTF-8 text, but byte 13 is not"),
        ("friction = 0.1".encode("utf-16"), "but is UTF-16 or UTF-32: save it as UTF-8"),
        ("friction = 0.1".encode("utf-16-le"), "but is UTF-16 or UTF-32: save it as UTF-8"),
        ("friction = 0.1".encode("utf-32"), "but is UTF-16 or UTF-32: save it as UTF-8"),
    ],
)
def test_refusals(text, words, tmp_path):
    """By file and key, in one line."""
    file = tmp_path / "mine.toml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError) as error:
        read_scene_file(file)
    line = str(error.value)
    assert line.startswith(f"{file}: ") and words in line and "\n" not in line, line


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda _: read_text("speed", "-3 rad/s"),
            "`speed` must be finite and > 0 rad/s, but is -3",
        ),
        (lambda _: read_value("friction", 11), "`friction` must lie in"),
        (lambda _: read_value("foundation.points.corner", "1 m"), "must be a place from C"),
        (lambda _: read_value("foundation.points.corner", "1 m, 2"), "has no unit"),
        (lambda path: read_scene_file(path / "no.toml"), r"no\.toml: cannot be read: No such file"),
        (lambda path: read_scene_file(path), "cannot be read: Is a directory"),
    ],
)
def test_refusals_of_single_values_and_of_what_is_no_file(call, words, tmp_path):
    with pytest.raises(ValueError, match=words):
        call(tmp_path)


def test_an_empty_table_inside_of_a_table_is_none(tmp_path):
    """As where all keys of a template's are commented out."""
    file = tmp_path / "mine.toml"
    file.write_text("[elbow.film]\n[foundation.soil]\n[foundation.points]\n[rod]\n")
    assert read_scene_file(file) == {}


@pytest.mark.parametrize(
    "text", ["elbow.slip = 'surface'", "film_law = 'short'", "fluctuation_order = 2"]
)
def test_a_part_that_is_not_there_has_no_number_of_the_paper_s(text, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(text)
    with pytest.raises(ValueError, match=r"must come with `[\w.]+`, but is alone\.$"):
        jc.read_machine(file)


def test_a_refusal_names_what_the_file_leaves_out(tmp_path):
    """A jaw that is too long beside the toggle of the PE250x400, and beside one of the file."""
    file, length = tmp_path / "mine.toml", '[jaw]\nlength = "2 m"\n'
    for text, left in (
        (length, " The file leaves toggle.length and bearing.distance to the PE250x400."),
        (length + '[toggle]\nlength = "0.3 m"\n[bearing]\ndistance = "0.64 m"\n', ""),
    ):
        file.write_text(text)
        with pytest.raises(ValueError, match=r"mine\.toml: `jaw\.length`") as error:
            jc.read_scene(file)
        line = str(error.value)
        assert line.endswith(left) and ("leaves" in line) == bool(left), line
