"""`python -m jaxcrusher identify`: from files to an answer, a picture and JSON."""

import json

import numpy as np
import pytest

from tests.identification import by_hand
from tests.whole.test_commands import run

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
    assert kept["degrees_of_freedom"] == 12 + 1 - 3 and kept["untold"] == []
    # In the units of the scene file.
    assert f"jaw.mass: {kept['values']['jaw.mass'] / 1e3:.6g} t ±" in text
    assert "chi-square" in text and "bits more" in text
    assert (tmp_path / "identify" / "identified.png").stat().st_size > 30_000


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (("--free", "jaw.mass"), "`measured` must name a file, but is missing"),
        (("--measured", "{none}"), "`free` must name numbers to be found, but is missing"),
        (("--measured", "{none}", "--free", "start"), "`start` must be a number's key"),
        (("--measured", "{none}", "--free", "jaw.mass"), "none.csv: cannot be read"),
    ],
)
def test_refused(line, words, tmp_path):
    line = [word.format(none=tmp_path / "none.csv") for word in line]
    with pytest.raises(ValueError, match=words):
        run("identify", "--out", tmp_path, *line)
