"""Scene files and command lines with random slips: one clear line, or a machine as it is written.

A command is stopped where it begins to compute, behind all of its checks. The suite tries the same
sixty of each every time; `FUZZED=1000 pytest -n 0 --hypothesis-seed=1` with this file tries a
thousand of each by another seed.
"""

import contextlib
import io
import os
import re
import shlex
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import jaxcrusher as jc
from jaxcrusher import __main__
from jaxcrusher.commands.machines import read_machine
from jaxcrusher.commands.options import Crusher
from jaxcrusher.files.program import parse
from jaxcrusher.scenes.machine import Machine
from jaxcrusher.scenes.parameters import CHOICES, FILES, NUMBERS, key_of
from optimize.run import search

EXAMPLES = Path(__file__).parents[2] / "examples"
PAPER, TEMPLATE, *MACHINES = (
    (EXAMPLES / f"{name}.toml").read_text()
    for name in ("pe250x400", "template", "slider_crank", "four_bar", "double_toggle", "six_bar")
)
# With every key of the template but those that shut each other out.
FULL = re.sub(r"^# ([\w.]+ = )", r"\1", TEMPLATE.partition("\n[film]")[0], flags=re.MULTILINE)
SHUT_OUT = r"load_(point|curve|factor|direction|edge)|joint|soil\.\w+"
FULL = re.sub(rf"^({SHUT_OUT}) = .*\n", "", FULL, flags=re.MULTILINE)
FULL = re.sub(r"^film_law = .*\n", "", FULL, count=1, flags=re.MULTILINE)
FULL = FULL.replace('"closing_stroke"', '"chamber"').replace(
    '\ncontact_law = "lankarani_nikravesh"', '\ncontact_law = "rollers"', 1
)
CURVE = 'load_law = "by_angle"\nload_curve = "measured.csv"\nload_factor = 1.1\nspeed = "30 rad/s"'
SCENES = [re.sub(r" *#.*", "", text) for text in (PAPER, FULL, CURVE)]
PARTS = """
[forces.gas]
body = "slider"
at = ["1 mm", "0 mm"]
force = ["-300 N", "0 N"]

[foundation]
mass = "60 kg"
inertia = "2 kg m2"
left = "-0.2 m"
right = "0.3 m"
base = "-0.1 m"
horizontal_stiffness = "2 MN/m"
vertical_stiffness = "3 MN/m"
horizontal_damping = "2 kN s/m"
vertical_damping = "3 kN s/m"
"""
LINKAGES = [re.sub(r" *#.*", "", text) for text in (*MACHINES, MACHINES[0] + PARTS)]
VALUES = (
    *('"286 rpm"', '"0.06 mm"', '"-5 kg"', '"5 Hz"', '"1e400 m"', '"1e-400 m"', '"nan mm"'),
    *('"0 m"', '"3 m^-2"', '"1 m^99"', '"7 dB"', '"1e99999999999999999999 kg"', '"1/0 m"', '""'),
    *("0", "-1", "1e400", "nan", "inf", "-0.0", "true", "[]", "{}", "1979-05-27", "9" * 400),
    *('"chamber"', '"by_angle"', '"rollers"', '"ideal"', '"contact"', '"no:Law"', '":"', '"..x:y"'),
    *('"json:JSONDecoder"', '"\\u0000"', '"a\\nb"', '"\\U0001F600 kg"', '"10 °C"', "'''"),
)  # fmt: skip
NAMES = (*NUMBERS, *CHOICES, *FILES, "diametral_clearance", "jaw", "speed.x", '"jaw.mass"', "sped")
PLACES = (
    *('["frame", "1 mm", "0 mm"]', '["crank", "50 mm", 0]', '["rod", 0]', '["rod", 1, 0]', "[2]"),
    *('["nan mm", "0 mm"]', '["1e9 m", "0 m"]', '[["0 m"], "1 m"]', "[[0, 1], [1, 2], [2, 1]]"),
    *('["slider", "1 mm", "0 mm"]', '"rod"', '"frame"', '"slider"', '"measured.csv"', "[1]"),
    *('"5 kg m2"', '"3 kN"', '"1e300 m"', '"1e-300 m"', "-1", "1.5", '{ x = 1 }', '"tracked"'),
)  # fmt: skip
ITEMS = (
    *("mass", "inertia", "mass_centre", "bore", "pin", "clearance", "bore_radius", "slip"),
    *("young", "friction", "static_speed", "impact_law", "contact_law", "body", "along", "at"),
    *("through", "force", "curve", "begin", "end", "stiffness", "length", "rod", "coupler", "jaw"),
    *("kind", "crank", "speed", "start", "gravity", "formulation", "fluctuation_order", '"a.b"'),
)  # fmt: skip
HEADS = (
    *("[bodies.crank]", "[bodies.frame]", "[joints.B]", "[joints.guide]", "[bodies]", "[joints]"),
    *("[slides.B]", "[forces.crank]", "[springs.x]", "[points]", "[points.tip]", "[assembly]"),
    *("[foundation]", "[assembly.rod]", "[jaw]", "[[joints.B]]", '[bodies.""]', '[bodies."é ß"]'),
    *("[foundation.soil]", "[bodies.crank.mass]", "[slides]", "[linkage]", "[joints.shaking]"),
)  # fmt: skip
SIGNS = st.sampled_from("\"=[]{}#.,-+\n\r\t\0\\ '0123456789eEmkg/^*°µ·²\u201c\u00a0\ud800\x1b")
# What the message may be about; a bare word of Python's or of a library's is not clear.
CLEAR = re.compile(r"must|cannot be read|is not TOML|tells all|needs")
# Independent of pint: the units of the examples.
SIZES = {
    **{"m": 1.0, "mm": 1e-3, "kg": 1.0, "t": 1e3, "kg m2": 1.0, "N": 1.0, "kN": 1e3, "rad": 1.0},
    **{"rpm": np.pi / 30, "deg": np.pi / 180, "rad/s": 1.0, "GPa": 1e9, "MPa": 1e6, "m/s": 1.0},
    **{"m/s2": 1.0, "kN/m": 1e3, "MN/m": 1e6, "kN s/m": 1e3},
}  # fmt: skip
WORDS = (
    *("--set", "--scene", "--over", "--turns", "--settle", "--chunk", "--rtol", "--by", "--name"),
    *("--period", "--orders", "--points", "--speeds", "--samples", "--seconds", "--pairs"),
    *("--seed", "--radius", "--design", "--csv", "--scheduler", "--sed", "--", "-", "", "--set=x"),
    *("speed", "clearance", "jaw.mass", "start", "contact", "foundation_rms", "any", "friction"),
    *("25", "40rad/s", "286 rpm", "0.1", "1e400", "nan", "inf", "-inf", "-1", "0", "1.5", "2", "7"),
    *("None", "True", "..", "a/b", "x\ny", "0x10", "1_000", "٣", "speed=3 rad/s", "=", "é"),
    *("jaw.length", "3 m", "load_law", "chamber", "none", "joint", "ideal", "rollers", "by_angle"),
    *("contact_law", "load_curve", "foundation.mass", "6 t", "rod.preload", "10 kN", "tcp://x"),
    *("joints.B.clearance", "joints.B.slip", "bodies.rod.mass", "joints.A.pin.x", "60 mm", "kind"),
    *("--free", "--prior", "--measured", "--starts", "--noise", "--effort", "--engine", "peak"),
)  # fmt: skip
LINES = (
    "simulate --turns 2 --settle 1 --set start contact --set speed '300 rpm'",
    "sweep --over speed 25 40rad/s 3 --over clearance 0.03 '0.12 mm' 2 --settle 1 --turns 2",
    "sweep --over start centred contact --chunk 2 --rtol 1e-8 --set friction 0.05",
    "regimes --design 'speed=25 rad/s, clearance=0.03 mm' --settle 20 --turns 100",
    "gradient foundation_rms --by speed jaw.mass --pairs 4 --seed 1 --radius 0.01",
    "orbit --period 1 --set speed 27rad/s",
    "foundation --orders 4 --speeds 100 400rpm --points 9 --set foundation.mass '6 t'",
    "bearing --over speed 200 220rpm 2 --over clearance 0.2 '0.35 mm' 2 --settle 1 --turns 5",
    "identify --measured ../measured.csv --free jaw.mass --prior jaw.inertia '1 kg m2' '3 kg m2'",
    f"simulate --scene {EXAMPLES}/four_bar.toml --turns 2 --settle 1 --set joints.B.friction 0.1",
    f"sweep --scene {EXAMPLES}/slider_crank.toml --over joints.B.clearance 0.1 0.5mm 2 --turns 2",
    f"orbit --scene {EXAMPLES}/double_toggle.toml --set bodies.jaw.mass '3 t' --period 1",
    f"regimes --scene {EXAMPLES}/four_bar.toml --over speed 200 300rpm 2 --settle 1 --turns 20",
    f"gradient --scene {EXAMPLES}/four_bar.toml --by speed joints.B.clearance --pairs 4",
    f"foundation --scene {EXAMPLES}/double_toggle.toml --orders 2 --points 3",
)
MEASURED = "speed_rpm,quantity,order,amplitude,sigma,unit\n286,frame_velocity_y,1,1.3,0.1,mm/s\n"
SEARCHES = (
    "--speed 25 40rad/s --clearance 0.03 0.12mm --objective shaking_rms --cells 5 3 --grid 4 3",
    "--design jaw.mass '400 kg' '600 kg' --design speed 25 40rad/s --limit shaking_rms '3 kN'",
    "--capacity-floor 5 --bulk-density '1.6 t/m3' --slip surface --friction 0.1 --seed 3",
    "--set load_law chamber --set speed '300 rpm' --samples 64 --runs 3 --impact-velocity tracked",
)
# What computes, behind every check of a command: there a fuzzed command is stopped.
WORK = (
    ("jaxcrusher.motion.simulation", "_simulate"),
    ("jaxcrusher.motion.section", "_section"),
    ("jaxcrusher.batch.sweep.Ensemble", "compute"),
    ("jaxcrusher.dynamics.slopes", "orbit_slopes"),
    ("jaxcrusher.orbits.periodic_orbit", "searched"),
    ("jaxcrusher.orbits.periodic_orbit", "kinematic"),
    ("jaxcrusher.commands.bearing", "run_turns"),
    ("jaxcrusher.commands.identify", "identify"),
    ("optimize.search.landscape", "points"),
)
FUZZED = os.environ.get("FUZZED")
CHEAP = settings(
    max_examples=int(FUZZED or 60),
    deadline=None,
    derandomize=FUZZED is None,
    database=None,
    suppress_health_check=[*HealthCheck],
)


class Reached(BaseException):
    """A command has begun to compute."""


@st.composite
def slips(draw, texts=SCENES, names=NAMES, values=VALUES, heads=()) -> str:
    """A text with one to three slips of the keyboard, of numbers, of names or of lines."""
    lines = draw(st.sampled_from(texts)).split("\n")
    for _ in range(draw(st.integers(1, 3))):
        kind = draw(st.integers(0, 9 if heads else 8))
        full = [i for i, line in enumerate(lines) if "=" in line and not line.startswith("#")]
        i = (
            draw(st.sampled_from(full))
            if full and kind in (0, 1, 2, 3, 8)
            else draw(st.integers(0, len(lines) - 1))
        )
        name, equals, value = lines[i].partition("=")
        if kind == 0:
            lines[i] = f"{name}= {draw(st.sampled_from(values))}"
        elif kind == 1:
            lines[i] = f"{draw(st.sampled_from(names))} ={value}"
        elif kind == 2:
            number = draw(st.floats() | st.integers(-10, 10**6))
            lines[i] = (
                name + equals + re.sub(r"-?\d[\d.]*", lambda _, n=number: repr(n), value, count=1)
            )
        elif kind == 3:
            unit = draw(st.sampled_from([*SIZES, "", "Hz", "in", "lbf", "1/min", "degC", "m**-1"]))
            lines[i] = name + equals + re.sub(r'\d[^"#]*"', lambda _, u=unit: f'3 {u}"', value)
        elif kind == 4:
            del lines[i]
            lines = lines or [""]
        elif kind == 5:
            lines.insert(i, draw(st.sampled_from(lines)))
        elif kind == 6:
            at = draw(st.integers(0, len(lines[i])))
            lines[i] = lines[i][:at] + draw(SIGNS) + lines[i][at + draw(st.integers(0, 2)) :]
        elif kind == 7:
            lines[i] = f"{draw(st.sampled_from(names))} = {draw(st.sampled_from(values))}"
        elif kind == 8:
            alike = [line for line in lines if line.startswith(f"{name}=")]
            lines[i] = draw(st.sampled_from(alike or lines))
        else:
            lines[i] = draw(st.sampled_from(heads))
    return "\n".join(lines)


@st.composite
def command_lines(draw, lines=LINES) -> list[str]:
    """The words of a command line, of which one to three are changed, doubled, lost or put in."""
    words = shlex.split(draw(st.sampled_from(lines)))
    for _ in range(draw(st.integers(1, 3))):
        at, word = draw(st.integers(0, len(words))), draw(st.sampled_from(WORDS))
        cut = draw(st.integers(0, 1)) if at < len(words) else 0
        new = draw(st.sampled_from([[word], [], words[at : at + 1] * 2]))
        words[at : at + cut] = new
    return words


def one_clear_line(error: BaseException) -> None:
    """Whether a program tells an error in one line that says what must be."""
    line = " ".join(str(error).split())  # as `jaxcrusher.files.results.tell` prints it
    assert type(error) in (ValueError,), repr(error)
    assert CLEAR.search(line) and "Traceback" not in line, line
    assert not re.search(r"\x1b|\0", line), repr(line)


TIES = "kind", "crank", "assembly."


def as_written(text: str, machine: Machine) -> None:
    """What a file says by a reading of its own, beside what was made of it."""
    values = machine.values

    def leaves(table: dict, prefix: str = ""):
        for name, value in table.items():
            if isinstance(value, dict):
                yield from leaves(value, f"{prefix}{name}.")
            elif isinstance(value, list):  # a point of a body, a vector, or a rough pose
                pose = prefix == "assembly."
                axes, given = ("x", "y", "angle")[: 2 + pose], value[-2 - pose :]
                yield from (
                    (f"{prefix}{name}.{axis}", one) for axis, one in zip(axes, given, strict=True)
                )
            else:
                yield prefix + name, value

    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    for name, value in leaves(tomllib.loads(text)):
        key, factor = key_of(name), 1.0 if key_of(name) == name else 0.5
        if key not in machine.numbers:
            told = key.startswith(TIES) or key in FILES or key.endswith((".body", ".curve"))
            assert told or values[key] == value, name
            continue
        number, unit = value, ""
        if isinstance(value, str):
            digits, unit = re.fullmatch(r"\s*([-+.\deE]+)\s*(.*?)\s*", value).groups()
            number = float(digits)
        size = 0.01 if unit == "%" else SIZES.get(unit, 1.0 if unit == "" else None)
        # Zeros of a point are left out.
        kept = values.get(key, 0.0) if key.endswith((".x", ".y")) else values[key]
        if size is not None:  # another unit of pint's, such as inches
            assert kept == pytest.approx(factor * number * size, rel=1e-14), name
        low, high = machine.numbers[key].limits or (0.0, np.inf)
        assert np.isfinite(kept) and low <= kept <= high, name


@pytest.mark.parametrize("text", [*SCENES, *LINKAGES], ids=lambda text: str(len(text)))
def test_without_slips_each_is_a_machine(text, tmp_path):
    """Else a number that a slip changes is never looked at."""
    file = tmp_path / "mine.toml"
    file.write_text(text)
    for name in ("measured.csv", "double_toggle_load.csv"):
        (tmp_path / name).write_text((EXAMPLES / "double_toggle_load.csv").read_text())
    as_written(text, jc.read_machine(file))


@CHEAP
@given(text=slips())
def test_scene_files_with_slips(text, tmp_path, capsys):
    file = tmp_path / "mine.toml"
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    (tmp_path / "measured.csv").write_text("angle_deg, force_kN\n0, 2\n90, 8\n180, 3\n")
    try:
        found = read_machine(Crusher(scene=file))
    except BaseException as error:  # of every kind: a traceback is what is looked for
        one_clear_line(error)
    else:
        as_written(text, found)
    assert "\x1b" not in capsys.readouterr().err


@CHEAP
@given(text=slips(LINKAGES, ITEMS, (*VALUES, *PLACES), HEADS))
def test_linkage_files_with_slips(text, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    (tmp_path / "measured.csv").write_text("angle_deg, force_kN\n0, 2\n90, 8\n180, 3\n")
    (tmp_path / "double_toggle_load.csv").write_text(
        (EXAMPLES / "double_toggle_load.csv").read_text()
    )
    try:
        found = jc.read_machine(file)
    except BaseException as error:
        one_clear_line(error)
    else:
        as_written(text, found)


@pytest.mark.slow
@CHEAP
@given(words=command_lines())
def test_command_lines_with_slips(words, tmp_path_factory):
    # A sweep asks for its scheduler when its folder is there.
    refused_or_begun(__main__.run, words, tmp_path_factory, empty=words[:1] != ["sweep"])


@pytest.mark.slow
@CHEAP
@given(words=command_lines(SEARCHES))
def test_searches_with_slips(words, tmp_path_factory):
    refused_or_begun(search, words, tmp_path_factory, empty=True)


def refused_or_begun(main, words, tmp_path_factory, *, empty):
    """Run a program's words up to where it computes, in a folder that a refusal leaves empty."""

    def reached(*_, **__):
        raise Reached

    folder, said = tmp_path_factory.mktemp("run"), io.StringIO()
    (folder.parent / "measured.csv").write_text(MEASURED)
    with contextlib.ExitStack() as stack:
        patch = stack.enter_context(pytest.MonkeyPatch.context())
        for place, name in WORK:
            patch.setattr(f"{place}.{name}", reached)
        patch.chdir(folder)
        stack.enter_context(contextlib.redirect_stdout(said))
        stack.enter_context(contextlib.redirect_stderr(said))
        try:
            parse(main, words)()
        except Reached:
            pass
        except SystemExit as stop:
            assert stop.code == 0 and {"--help", "-h"} & {*words}
        except BaseException as error:
            one_clear_line(error)
            # Nothing of an earlier run is moved for a command that is refused.
            assert not empty or not any(folder.iterdir())
        else:
            raise AssertionError("It came to its end and computed nothing.")
