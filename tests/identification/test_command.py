"""`python -m jaxcrusher identify`: from files to an answer, a picture and JSON."""

import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from jaxcrusher.commands.identify import amplitudes
from jaxcrusher.identification.measurements import Measurement
from jaxcrusher.scenes.reader import read_machine
from tests.commands import run
from tests.identification import by_hand

EXAMPLES = Path(__file__).parents[2] / "examples"
SCENE = 'joint = "ideal"\n[jaw]\nmass = "0.6 t"\n[shaft]\nmass_centre_radius = "8 mm"\n'


def test_identify(tmp_path):
    rng, lines = np.random.default_rng(5), ["speed_rpm,quantity,order,amplitude,sigma,unit"]
    for rpm in (200, 286):
        for quantity, spectrum in by_hand.crusher({}, rpm * np.pi / 30).items():
            unit = "N m" if quantity == "ground_moment" else "kN"
            for order in (1, 2):
                size = 1e-3 * abs(spectrum[order]) if unit == "kN" else abs(spectrum[order])
                noisy = size * (1 + 0.01 * rng.standard_normal())
                lines.append(f"{rpm},{quantity},{order},{noisy},{0.01 * size},{unit}")
    (tmp_path / "measured.csv").write_text("\n".join(lines))
    (tmp_path / "mine.toml").write_text(SCENE)
    status, text = run(
        *("identify", "--scene", tmp_path / "mine.toml", "--measured", tmp_path / "measured.csv"),
        *("--free", "jaw.mass", "shaft.mass_centre_radius", "jaw.inertia"),
        *("--prior", "jaw.inertia", "128 kg m2", "30 kg m2", "--out", tmp_path),
    )
    assert status == 0
    kept = json.loads((tmp_path / "identify" / "identified.json").read_text())
    for name, exact in (("jaw.mass", 524.0), ("shaft.mass_centre_radius", 0.006)):
        off = kept["values"][name] - exact
        # Four standard deviations of a single draw.
        assert abs(off) < 4 * kept["standard_deviations"][name] < 0.25 * exact
    assert len(kept["fitted_amplitude"]) == len(kept["measured"]) == 12
    assert kept["degrees_of_freedom"] == 12 + 1 - 3 and kept["unidentifiable"] == []
    # In the units of the scene file.
    assert f"jaw.mass: {kept['values']['jaw.mass'] / 1e3:.6g} t ±" in text
    assert "chi-square" in text and "bits more" in text
    assert (tmp_path / "identify" / "identified.png").stat().st_size > 30_000


SLIDER_CRANK = """
kind = "linkage"
crank = "crank"
gravity = "0 m/s2"
bodies.crank = {mass = "4 kg", inertia = "0.01 kg m2", mass_centre = ["20 mm", "0 mm"]}
bodies.rod = {mass = "1e-9 kg", inertia = "1e-9 kg m2"}
bodies.slider = {mass = "3 kg", inertia = "0.01 kg m2"}
joints.O = {bore = ["frame", "0 mm", "0 mm"], pin = ["crank", "0 mm", "0 mm"]}
joints.A = {bore = ["rod", "0 mm", "0 mm"], pin = ["crank", "50 mm", "0 mm"]}
joints.B = {bore = ["rod", "200 mm", "0 mm"], pin = ["slider", "0 mm", "0 mm"]}
slides.guide = {body = "slider", along = [1, 0]}
assembly.rod = 1
"""


def test_identify_a_linkage(tmp_path):
    """Masses of a slider-crank of 2 and 5 kg, from the force that they need by hand."""
    angle = 2 * np.pi * np.arange(64) / 64
    place = 0.05 * np.cos(angle) + np.sqrt(0.2**2 - (0.05 * np.sin(angle)) ** 2)
    slider = 2 * np.abs(np.fft.rfft(place)) / 64
    lines = ["speed_rpm,quantity,order,amplitude,sigma,unit"]
    for rpm in (200, 300):
        square = (rpm * np.pi / 30) ** 2
        for quantity, order, size in (
            ("ground_force_x", 1, square * (2 * 0.02 + 5 * slider[1])),
            ("ground_force_x", 2, 4 * square * 5 * slider[2]),
            ("ground_force_y", 1, square * 2 * 0.02),
        ):
            lines.append(f"{rpm},{quantity},{order},{size},{1e-4 * size},N")
    (tmp_path / "measured.csv").write_text("\n".join(lines))
    (tmp_path / "mine.toml").write_text(f'speed = "250 rpm"\n{SLIDER_CRANK}')
    status, text = run(
        *("identify", "--scene", tmp_path / "mine.toml", "--measured", tmp_path / "measured.csv"),
        *("--free", "bodies.crank.mass", "bodies.slider.mass", "--noise", "0", "--starts", "1"),
        *("--out", tmp_path),
    )
    assert status == 0 and "bodies.slider.mass: 5 kg ±" in text
    values = json.loads((tmp_path / "identify" / "identified.json").read_text())["values"]
    # The rod weighs 1e-9 kg.
    assert values["bodies.crank.mass"] == pytest.approx(2, rel=1e-7)
    assert values["bodies.slider.mass"] == pytest.approx(5, rel=1e-7)


RIGHT = {
    "foundation.mass": 6400.0,
    "foundation.vertical_stiffness": 20e6,
    "foundation.horizontal_stiffness": 12e6,
    "jaw.mass": 524.0,
}


@pytest.mark.slow
def test_the_example_to_copy_finds_the_numbers_that_it_was_made_of(tmp_path):
    """From sensors alone: two on the block, one of them oblique, and one on the bearing's cap."""
    status, text = run(
        *("identify", "--scene", EXAMPLES / "on_mounts.toml", "--out", tmp_path),
        *("--measured", EXAMPLES / "measured.csv", "--free", *RIGHT),
    )
    assert status == 0
    kept = json.loads((tmp_path / "identify" / "identified.json").read_text())
    for name, exact in RIGHT.items():
        # Three standard deviations of a single draw, which are 3 % at most.
        off, sigma = kept["values"][name] - exact, kept["standard_deviations"][name]
        assert abs(off) < 3 * sigma < 0.1 * exact, name
    assert kept["unidentifiable"] == [] and kept["degrees_of_freedom"] == 27 - 4
    # What is printed is in the words of a plant, with the name that the CSV takes.
    told = [line for line in text.splitlines() if line.startswith("Tells ")]
    assert len(told) == 3 and all(
        re.search(r": .* \(\w+\), (mean|order \d), at", one) for one in told
    )
    shown = read_machine(EXAMPLES / "on_mounts.toml").scene().measurable
    for one in kept["optimal_experiments"]:
        assert one["quantity"].removesuffix("_x").removesuffix("_y") in shown


def test_a_mean_and_a_statistic_keep_their_sign():
    orders = (0, 1, "rms", "")
    measured = [Measurement(30.0, "ground_force_y", order, 1.0, 1.0) for order in orders]
    found = SimpleNamespace(measured=measured, fitted=[-2 + 0j, 3 - 4j, 5 + 0j, -6 + 0j])
    assert amplitudes(found) == [-2.0, 5.0, 5.0, -6.0]


KNOWN = ("--measured", "{none}", "--free", "jaw.mass")
PRIOR = ("--prior", "jaw.mass", "1 t", "1 t")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (("--free", "jaw.mass"), "`measured` must name a file, but is missing"),
        (("--measured", "{none}"), "`free` must name numbers to be found, but is missing"),
        (("--measured", "{none}", "--free", "start"), "`start` must be a number's key"),
        (("--measured", "{none}", "--free", "jaw.mass"), "none.csv: cannot be read"),
        ((*KNOWN, *2 * PRIOR), "`prior` must name each number once"),
        ((*KNOWN, "--noise", "-0.01"), "`noise` must be finite and >= 0, but is -0.01"),
    ],
)
def test_refused(line, words, tmp_path):
    line = [word.format(none=tmp_path / "none.csv") for word in line]
    with pytest.raises(ValueError, match=words):
        run("identify", "--out", tmp_path, *line)
