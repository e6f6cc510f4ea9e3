"""Curves of a load from files and arrays, and what is refused of them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.periodic_spline import PeriodicSeries
from jaxcrusher.scenes.load_curve import load_curve
from jaxcrusher.scenes.reader import read_scene_file

POINTS = np.array([[0.0, 1.0], [90.0, 8.5], [200.0, 3.0], [300.0, 2.0]])  # deg and kN


def written(path, points=POINTS, header="angle_deg, force_kN"):
    lines = [header, *(", ".join(map(str, row)) for row in points)]
    path.write_text("\n".join(lines) + "\n")
    return path


def in_si(points):
    return points * [np.pi / 180, 1e3]


def test_a_file_is_its_array(tmp_path):
    """Values at the points, also where the curve is written from 0 to 360 or in disorder."""
    closed = np.vstack([POINTS, [360.0, 1.0]])
    given = [str(written(tmp_path / "one.csv")), str(written(tmp_path / "two.csv", closed))]
    for curve in (*given, in_si(POINTS), in_si(POINTS[::-1])):
        found = jax.vmap(load_curve(curve))(jnp.radians(POINTS[:, 0]))
        np.testing.assert_allclose(found, 1e3 * POINTS[:, 1], rtol=1e-13)


def test_many_points_of_a_smooth_curve_are_a_series():
    angles = np.arange(0.0, 360.0)
    smooth = np.stack([angles, 9 + 4 * np.cos(np.radians(angles))], axis=1)
    curve = load_curve(in_si(smooth))
    assert isinstance(curve, PeriodicSeries)
    # The spline's own 1e-9 of the cosine.
    found = jax.vmap(curve)(jnp.radians(angles + 0.5))
    expected = 1e3 * (9 + 4 * np.cos(np.radians(angles + 0.5)))
    np.testing.assert_allclose(found, expected, rtol=1e-8)


def test_a_steep_curve_is_met_exactly_by_however_many_points():
    angles = np.arange(0.0, 360.0)
    steep = np.stack([angles, np.where(angles < 180, 9.0, 1.0)], axis=1)
    found = jax.vmap(load_curve(in_si(steep)))(jnp.radians(angles))
    np.testing.assert_allclose(found, 1e3 * steep[:, 1], rtol=1e-9)


def test_a_scene_file_names_its_curve_from_where_it_is(tmp_path):
    folder = tmp_path / "machines"
    folder.mkdir()
    written(folder / "measured.csv")
    file = folder / "scene.toml"
    file.write_text(
        'load_law = "by_angle"\nload_curve = "measured.csv"\nload_factor = 2\n'
        'load_point = "350 mm"\njoint = "ideal"\n'
    )
    values = read_scene_file(file)
    assert values["load_curve"] == str(folder / "measured.csv")
    motion = jc.simulate(jc.build_scene(values), [0.0], outputs=("crushing_load",))
    assert np.linalg.norm(motion.crushing_load[0]) == pytest.approx(2000.0, rel=1e-12)


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (np.vstack([POINTS, [360.0, 2.0]]), "close at 360 deg"),
        (POINTS[:2], "have 3 points or more, but is of 2"),
        (np.vstack([POINTS, [45.0, np.nan]]), "be finite"),
        (np.vstack([POINTS, [361.0, 2.0]]), "angles from 0 to 360 deg, but is at 361"),
        (np.vstack([POINTS, [-10.0, 2.0]]), "angles from 0 to 360 deg, but is at -10"),
        (np.vstack([POINTS, [90.0, 2.0]]), "every angle once, but is twice at"),
    ],
)
def test_refusals_of_points(points, words, tmp_path):
    for given in (str(written(tmp_path / "bad.csv", points)), in_si(points)):
        with pytest.raises(ValueError, match=words) as error:
            jc.build_scene({"load_law": "by_angle", "load_curve": given})
        assert str(error.value).startswith("Argument `load_curve` must")
        assert "\n" not in str(error.value)


def test_refusals(tmp_path):
    """Of files, of names of files, and of arrays."""
    for mark, name in ((";", "e.csv"), ("\t", "f.csv")):
        (tmp_path / name).write_text(f"angle_deg{mark}force_kN\n0{mark}2,1\n90{mark}4,8\n")
    decimals = written(tmp_path / "d.csv", [["0,2", "1"]])
    for given, words in (
        (written(tmp_path / "a.csv", header="angle, force"), "does not begin with"),
        (written(tmp_path / "b.csv", [[0, "many"]]), "angle and force in line 2"),
        (written(tmp_path / "c.csv", [["1_0", 5]]), "angle and force in line 2"),
        (decimals, "angle and force in line 2: they have decimal points"),
        (tmp_path / "none.csv", "cannot be read: No such file"),
        (tmp_path / "e.csv", "'.*e.csv' has semicolons between its cells: write com"),
        (tmp_path / "f.csv", r"has tabs .*, and decimal points in numbers, as 2\.1\.$"),
        ("a\0.csv", r"but 'a\\x00\.csv' is no name of a file"),
        ("\ud800.csv", r"but '\\ud800\.csv' is no name of a file"),
        (np.zeros(4), "have shape"),
        ([["a", 1.0]], r"^Argument `load_curve` must be pairs \[rad, N\], but is"),
    ):
        with pytest.raises(ValueError, match=words):
            load_curve(given)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"load_law": "by_angle"}, "`load_curve` must be given with `load_law=by_angle`"),
        ({"load_curve": in_si(POINTS)}, "`load_curve` must come with `load_law=by_angle`"),
        ({"load_factor": 2.0}, "`load_factor` must come with `load_law=by_angle`"),
        ({"load_point": 0.7}, "`load_point` must lie on the jaw, from 0 to its length 0.695 m"),
        ({"load_point": -0.1}, "`load_point` must lie in"),
    ],
)
def test_refusals_of_a_load(values, words):
    with pytest.raises(ValueError, match=words):
        jc.build_scene(values)
