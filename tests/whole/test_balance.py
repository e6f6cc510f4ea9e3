"""`python -m jaxcrusher balance`: the counterweight in words, numbers and a picture."""

import io
import json
import re

import pytest
from rich.console import Console

import jaxcrusher as jc
from jaxcrusher.commands.balance import run
from jaxcrusher.commands.options import Balance, Crusher, Results
from jaxcrusher.orbits.result import RESULTS, missing
from jaxcrusher.scenes.reader import read_machine


def balanced(folder, *overrides, **options):
    """Return the exit status, the screen's text, and what is kept."""
    written = io.StringIO()
    told = Balance(Crusher(None, overrides), results=Results("here", folder), **options)
    status = run(told, Console(file=written, width=80, soft_wrap=True))
    return status, written.getvalue(), json.loads((folder / "here" / "balance.json").read_text())


def test_the_lines_for_a_scene_file_make_the_first_order_least(tmp_path):
    heavy = ("counterweight.mass", "10 kg")
    status, text, kept = balanced(tmp_path, ("joint", "ideal"), heavy, radius="0.35 m")
    assert status == 0
    least, across, up = kept["counterweight"]
    assert least["horizontal"] == pytest.approx(least["vertical"], rel=1e-9)  # rounding
    assert across["vertical"] == pytest.approx(up["horizontal"], rel=1e-9)
    file = tmp_path / "mine.toml"
    lines = re.search(r"\[counterweight\]\nmass.*\nradius.*\nangle.*\n", text)
    assert lines, text
    file.write_text(f'joint = "ideal"\n{lines[0]}')
    orbit = jc.periodic_orbit(read_machine(file).scene())
    rms = kept["forces"]["RMS of the shaking force, orbit"]
    # The file has six digits of the mass and of the angle.
    assert float(orbit.shaking_rms) == pytest.approx(rms["balanced"], rel=1e-4)
    assert rms["balanced"] < 0.5 * rms["as it is"]
    assert "stands in place of the one of 2 kg m" in text
    assert max(map(len, text[text.index("Amplitudes") :].splitlines()[:-2])) <= 80
    assert (tmp_path / "here" / "balance.png").stat().st_size > 10_000


def test_without_an_orbit_ideal_joints_alone_are_compared(tmp_path, monkeypatch):
    solve = jc.periodic_orbit

    def none(scene, **how):
        """Return no orbit of loose joints, which takes long to find out."""
        return solve(scene) if scene.is_ideal else missing(scene, 1, RESULTS.chaotic)

    monkeypatch.setattr(jc, "periodic_orbit", none)
    status, text, kept = balanced(tmp_path)
    assert status == 1 and "no periodic orbit, as it is: " in text
    assert [name for name in kept["forces"] if "ideal joints" not in name] == []


def test_a_radius_has_a_length(tmp_path):
    with pytest.raises(ValueError, match="`radius` must be finite and > 0 m, but is 0"):
        balanced(tmp_path, radius="0 mm")
