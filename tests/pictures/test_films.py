"""A film shows the instants that it is given: the artists' data and the files, never pixels."""

import io
import re

import jax.numpy as jnp
import matplotlib

matplotlib.use("Agg")
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter
from PIL import Image

import jaxcrusher as jc
from jaxcrusher.motion.section import fine
from jaxcrusher.motion.simulation import Trajectory
from jaxcrusher.pictures.film import Film
from jaxcrusher.pictures.frames import pictures_of, write_film
from jaxcrusher.pictures.mechanism import Drawing, drawn_of

EXAMPLES = Path(__file__).parents[2] / "examples"
CLEARANCE, SPEED, COUNT = 0.06e-3, 30.0, 9
# Angles of the shaft at the instants; the first is that of a run after two turns.
ANGLES = 4 * np.pi + np.linspace(0, 2 * np.pi, COUNT)


def invented(scene, **values):
    """Return a motion of numbers made up, as a film needs them, and no integration."""
    rng = np.random.default_rng(0)
    names = (*drawn_of(scene), "foundation_force")
    scales = {name: 0.1 if name.endswith("position") else 1e4 for name in names}
    made = {name: scale * rng.uniform(-1, 1, (COUNT, 2)) for name, scale in scales.items()}
    made |= {"foundation_force": np.linspace(1e3, 9e3, COUNT), **values}
    times = jnp.asarray(ANGLES / float(scene.drive.speed))
    return Trajectory(times, fine(), {name: jnp.asarray(of) for name, of in made.items()})


def test_a_film_stands_at_the_instant_that_is_shown():
    scene = jc.paper_scene(SPEED, CLEARANCE)
    # From the middle outwards, a quarter turn each: contact from |e| > c on.
    far = CLEARANCE * np.linspace(0, 1.6, COUNT)
    turned = np.pi / 2 * np.arange(COUNT)
    path = (far * np.array([np.cos(turned), np.sin(turned)])).T
    ideal = np.full(COUNT, 2e3)
    motion = invented(scene, eccentricity=path)
    film = Film(scene, motion, "foundation_force", range(COUNT), title="a title", ideal=ideal)
    mechanism, bore, force = film.figure.axes
    assert film.figure.get_suptitle() == "a title"
    times = float(bore.get_title().split()[-1])
    pin = film.drawing.clearances["main"]
    for instant in (7, 2):
        film.show(instant)
        angle = 45.0 * instant  # degrees, eight steps a turn
        np.testing.assert_allclose(film.cursor.get_xdata(), [angle, angle], rtol=1e-12)
        assert mechanism.get_title() == f"shaft at {angle:.0f}°"
        # kN of 1000 N a step.
        np.testing.assert_allclose(film.dot.get_xydata(), [[angle, 1 + instant]], rtol=1e-12)
        # In radii of the bore, 130 mm: where it is, and where it has been.
        magnified = times * path / 0.13
        np.testing.assert_allclose(pin.pin.center, magnified[instant], rtol=1e-12)
        np.testing.assert_allclose(pin.path.get_xydata(), magnified[: instant + 1], rtol=1e-12)
        assert pin.contact.get_visible() == (far[instant] > CLEARANCE)
        at = path[instant] / far[instant]
        np.testing.assert_allclose(pin.contact.get_xydata(), [at], atol=1e-12)
    loose, still, *_ = force.lines
    np.testing.assert_allclose(loose.get_ydata(), 1 + np.arange(COUNT))
    np.testing.assert_array_equal(still.get_ydata(), 2.0)
    assert loose.get_linestyle() != still.get_linestyle()
    # Without the room of insets, 0.66 m, but for the longest arrow: 0.28 m from C or the load.
    assert -0.45 < mechanism.get_xlim()[0]
    for arrow, _, end, places, forces in film.drawing.arrows.values():
        ends = places + (-1 if end == "tip" else 1) * forces / arrow.scale
        (left, right), (low, high) = mechanism.get_xlim(), mechanism.get_ylim()
        assert (left < ends[:, 0]).all() and (ends[:, 0] < right).all()
        assert (low < ends[:, 1]).all() and (ends[:, 1] < high).all()


def test_a_film_of_ideal_joints_has_no_empty_place():
    scene = jc.ideal_scene(SPEED)
    film = Film(scene, invented(scene), "foundation_force", [0], title="")
    assert len(film.figure.axes) == 2 and film.figure.axes[1].get_legend() is None
    with pytest.raises(ValueError, match="`motion` must hold 'shaking_force', but is without it"):
        Film(scene, invented(scene), "shaking_force", [0], title="")


@pytest.mark.parametrize(
    ("play", "touching"),
    [
        ((0.0, 0.9), []),
        ((1.1, 0.0), [(1, 1), (-1, 1)]),
        ((-1.1, 0.0), [(-1, -1), (1, -1)]),
        ((0.0, 1.1), [(1, 1), (-1, -1)]),  # tilted counterclockwise
        ((0.6, -0.6), [(-1, 1)]),
    ],
)
def test_a_slider_shows_which_corners_touch(play, touching):
    """Off to the left and tilted, in clearances, as `jaxcrusher.joint.guide` counts them."""
    scene = jc.read_scene(EXAMPLES / "loose_guide.toml")
    _, (ax, beside) = plt.subplots(1, 2)
    values = {"guide_eccentricity": jnp.array([play]) * 0.5e-3}
    motion = Trajectory(jnp.zeros(1), fine(), values)
    drawing = Drawing(scene, motion, ax, [0], {"guide": beside})
    drawing.show(0)
    slider = drawing.clearances["guide"]
    assert np.sign(slider.contact.get_xydata()).astype(int).tolist() == [list(c) for c in touching]
    # 0.5 mm of half a length of 25 mm, 20 times.
    offsets = slider.block.get_xy()[:4, 1] - slider.corners[:, 1]
    expected = 20 / 25 * 0.5 * (play[0] + play[1] * slider.corners[:, 0])
    np.testing.assert_allclose(offsets, expected, atol=1e-12)


@pytest.fixture(scope="module")
def pictures():
    fig, ax = plt.subplots(figsize=(1, 1))
    (line,) = ax.plot([0, 1])
    return [*pictures_of(fig, lambda i: line.set_ydata([0, i]), [0, 1, 2], dpi=41)]


def test_a_page_plays_without_a_network(pictures, tmp_path):
    write_film(tmp_path / "a.html", pictures, 20, "<a title>", "A caption.")
    text = (tmp_path / "a.html").read_text()
    code, count = re.subn(r'"(data:image/png;base64,)?[A-Za-z0-9+/=]{100,}"', '""', text)
    assert count == 4  # one of them is shown before the player begins
    assert re.search(r"//|@import|url\(|<link|<script ", code) is None
    assert (
        "<title>&lt;a title&gt;</title>" in code
        and "A caption." in code
        and "step(1), 50.0" in code
    )


def test_ffmpeg_is_handed_the_pictures_in_their_order(pictures, tmp_path, monkeypatch):
    program = tmp_path / "ffmpeg"
    program.write_text('#!/bin/sh\nfor last; do true; done\ncat > "$last"\n')
    program.chmod(0o755)
    monkeypatch.setattr(FFMpegWriter, "isAvailable", lambda: True)
    monkeypatch.setattr(FFMpegWriter, "bin_path", lambda: str(program))
    write_film(tmp_path / "a.mp4", pictures, 20, "")
    assert (tmp_path / "a.mp4").read_bytes() == b"".join(pictures)
    assert Image.open(io.BytesIO(pictures[0])).size == (41, 41)
    (tmp_path / "a.mp4").unlink()
    program.write_text('#!/bin/sh\necho "no encoder" >&2\nexit 1\n')
    with pytest.raises(RuntimeError, match="ffmpeg failed: no encoder"):
        write_film(tmp_path / "a.mp4", pictures, 20, "")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ffmpeg"]
