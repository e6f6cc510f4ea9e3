"""What is drawn is what was given: the artists' data, never pixels."""

import runpy
from dataclasses import replace
from functools import cache
from pathlib import Path

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from matplotlib.animation import FFMpegWriter
from matplotlib.collections import QuadMesh
from matplotlib.colors import LogNorm
from matplotlib.patches import Arc, Polygon
from matplotlib.quiver import Quiver
from PIL import Image

import jaxcrusher as jc
from jaxcrusher.basics.integrate import RESULTS, Outcome
from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher.outline import FORCES
from jaxcrusher.crusher.template import OBSERVABLES
from jaxcrusher.mechanism.drives import GivenTorque
from jaxcrusher.mechanism.starts import Given
from jaxcrusher.motion.simulation import OUTPUTS, Trajectory
from jaxcrusher.pictures import plots
from jaxcrusher.pictures.mechanism import DRAWN, Drawing, animate, plot_mechanism
from jaxcrusher.scenes.build import build_linkage

ROOT = Path(__file__).parents[2]
ENDED = Outcome(RESULTS.promote(diffrax.RESULTS.successful), jnp.zeros(()), jnp.array(0))
TIMES = np.linspace(0, 0.2, 9)


def test_letters_stand_where_the_equations_put_them():
    """O, B and S3 to scale, A with the eccentricity magnified; |A - B| is the jaw's length."""
    program = runpy.run_path(str(ROOT / "docs" / "pictures" / "geometry.py"))
    fig = program["plot_geometry"](build_linkage({}))
    at = {
        text.get_text(): np.array(text.get_position())
        for text in fig.axes[0].texts
        if text.get_text() in ("O", "A", "B", "C")
    }
    points = np.array(
        [line.get_xydata()[0] for line in fig.axes[0].lines if line.get_marker() in ("o", "P")]
    )
    o, a, b, c, s2, s3 = points
    # Table 2's position of O, rounding of sums besides.
    np.testing.assert_allclose(o, 0.64 * np.array([np.sin(np.pi / 8), np.cos(np.pi / 8)]))
    assert c.tolist() == [0.0, 0.0] and np.linalg.norm(a - o) == pytest.approx(0.06)
    assert np.linalg.norm(a - b) == pytest.approx(0.695)
    assert np.linalg.norm(b) == pytest.approx(0.3) and b[1] < 0
    assert np.linalg.norm(s2 - a) == pytest.approx(0.3)
    np.testing.assert_allclose(s3, b / 2)
    # Each letter beside its point, a tenth of the jaw away at most.
    for name, point in zip("OABC", (o, a, b, c), strict=True):
        assert np.linalg.norm(at[name] - point) < 0.07, name
    # Arcs of circles from an axis to the link: y to O about C, x to A about O, y to A about B, and
    # x down to B about C.
    arcs = [p for p in fig.axes[0].patches if isinstance(p, Arc)]
    turned = ((90, o - c, c), (0, a - o, o), (90, a - b, b), (0, b - c, c))
    for arc, (axis, link, centre) in zip(arcs, turned, strict=True):
        ends = sorted((axis, np.degrees(np.arctan2(link[1], link[0]))))
        np.testing.assert_allclose((arc.theta1, arc.theta2), ends, atol=1e-12)
        assert arc.center == tuple(centre) and arc.width == arc.height


@cache
def drawn(name):
    """A scene and, without an integration, its motion: the ideal joint's, or the start's alone."""
    if name == "ideal":
        scene, times = jc.ideal_scene(30.0), jnp.asarray(TIMES)
    else:
        scene, times = jc.paper_scene(30.0, 0.06e-3), jnp.zeros(1)
        # In contact: |e| = 1.024 c.
        start = Given({"main": Vector(0.6, 0.83)}, {"main": Vector(0.1, -0.2)})
        scene = eqx.tree_at(lambda s: s.start, scene, start)

    @eqx.filter_jit
    def observe(scene, times):
        def at(time):
            s = scene.formulation.snapshot(time, scene.formulation.initial(scene), scene)
            names = (*DRAWN, "jaw_position", "jaw_mass_centre")
            return {name: OBSERVABLES[name](s, scene) for name in names}

        return jax.vmap(at)(times)

    return scene, Trajectory(times, ENDED, observe(scene, times))


both = pytest.mark.parametrize("name", ["ideal", "clearance"])


@both
def test_positions_are_those_of_the_linkage(name):
    """Links keep their lengths, S2 lies where (Table 2) the jaw's angle puts it."""
    scene, motion = drawn(name)
    pin, elbow = np.asarray(motion.pin_position), np.asarray(motion.jaw_position)
    bearing = np.asarray(scene.linkage.joints.at("shaft_bearing").bore.arm.vector().array())
    arm = pin - bearing
    angle = 30.0 * np.asarray(motion.time)
    # Sums of numbers of order one.
    np.testing.assert_allclose(arm, 0.01 * np.stack([np.cos(angle), np.sin(angle)], 1), atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(elbow, axis=1), 0.3, rtol=1e-14)
    jaw = pin - np.asarray(motion.eccentricity) - elbow
    np.testing.assert_allclose(np.linalg.norm(jaw, axis=1), 0.695, rtol=1e-14)
    tilt = np.arctan2(-jaw[:, 0], jaw[:, 1]) + np.radians(15)
    centre = elbow + jaw + 0.3 * np.stack([np.sin(tilt), -np.cos(tilt)], 1)
    np.testing.assert_allclose(motion.jaw_mass_centre, centre, atol=1e-14)
    np.testing.assert_allclose(motion.crushing_load, -8.8e3 * jaw / 0.695, rtol=1e-12)


def arrows(ax):
    """Force -> where its arrow ends at the mechanism, its direction, N a length."""
    found = [c for c in ax.collections if isinstance(c, Quiver)]
    assert len(found) == len(FORCES)
    return dict(zip(FORCES, found, strict=True))


@both
def test_mechanism_is_to_scale(name):
    scene, motion = drawn(name)
    instant = len(motion.time) // 2
    ax = plot_mechanism(scene, motion, instant)
    assert ax.get_aspect() == 1
    pin, elbow = (np.asarray(motion[point][instant]) for point in ("pin_position", "jaw_position"))
    forces, bearing = arrows(ax), 0.64 * np.array([np.sin(np.pi / 8), np.cos(np.pi / 8)])
    places = {
        "bearing_reaction": bearing,
        "toggle_reaction": [0, 0],
        "joint_force": pin,
        "crushing_load": motion.jaw_mass_centre[instant],
    }
    # Bodies are drawn without what clearances shift.
    close = {"rtol": 0, "atol": 1e-15 if name == "ideal" else 1.1 * 0.06e-3}
    assert len({arrow.scale for arrow in forces.values()}) == 1
    for force, arrow in forces.items():
        np.testing.assert_allclose(arrow.get_offsets()[0], places[force], **close)
        size = getattr(motion, force)[instant]
        np.testing.assert_array_equal([arrow.U[0], arrow.V[0]], size)
        # The longest arrow is shorter than the drawing, and longer than nothing.
        assert np.linalg.norm(size) / arrow.scale <= 0.4 * 0.695 * (1 + 1e-12)
    jaw, face, toggle, disc, mark = (
        p.get_xy() for p in ax.patches if isinstance(p, Polygon) and not p.get_hatch()
    )
    # The pin of the shaft is as wide as the bore, and its mark begins at O.
    radii = np.linalg.norm(disc - pin, axis=1)
    np.testing.assert_allclose(radii, 0.19 * 0.695 if name == "ideal" else 0.13, **close)
    np.testing.assert_allclose(mark[0], bearing, rtol=1e-14)
    # The toggle's rectangle runs from C to B.
    np.testing.assert_allclose(toggle[[0, 3]].mean(0), 0, **close)
    np.testing.assert_allclose(toggle[[1, 2]].mean(0), elbow, **close)
    # The face is a side of the jaw, parallel to A-B.
    np.testing.assert_array_equal(face, jaw[[3, 4]])
    along, axis = face[1] - face[0], np.asarray(pin - elbow)
    assert abs(along[0] * axis[1] - along[1] * axis[0]) < (1e-12 if name == "ideal" else 1e-4)
    # It ends a little below B, where the foot lies square to it.
    below = (jaw[[2, 3]] - elbow) @ axis / np.linalg.norm(axis)
    assert below[0] == pytest.approx(below[1], abs=1e-4) and -0.13 < below[0] < 0
    # The fixed jaw is clear of it, to the right.
    (block,) = (p.get_xy() for p in ax.patches if p.get_hatch() and len(p.get_xy()) == 5)
    assert block[:, 0].min() > face[:, 0].max() and block[1, 1] > block[0, 1]
    scale = {text.get_text() for key in ax.artists for text in [key.text]}
    assert len(scale) == 1 and scale.pop().endswith(" kN")


def test_clearance_is_magnified():
    scene, motion = drawn("clearance")
    ax = plot_mechanism(scene, motion)
    (inset,) = ax.child_axes
    bore, _, pin = inset.patches
    times = float(inset.get_title().split()[-1])
    assert times == 1000  # a gap of at most 0.5 of the radius by 1, 2 or 5 times a power of ten
    # Drawn with the bore's radius as the unit.
    magnified = times * np.asarray(motion.eccentricity[0]) / 0.13
    np.testing.assert_allclose(pin.center, magnified, rtol=1e-12)
    assert bore.radius - pin.radius == pytest.approx(times * 0.06e-3 / 0.13, rel=1e-12)
    (force,) = (c for c in inset.collections if isinstance(c, Quiver))
    np.testing.assert_array_equal([force.U[0], force.V[0]], motion.joint_force[0])
    assert not plot_mechanism(*drawn("ideal")).child_axes
    # A pin in the middle of its bore presses nowhere.
    centred = {**motion.values, "eccentricity": 0 * motion.eccentricity}
    (inset,) = plot_mechanism(scene, Trajectory(motion.time, ENDED, centred)).child_axes
    (force,) = (c for c in inset.collections if isinstance(c, Quiver))
    np.testing.assert_array_equal(force.get_offsets(), [[0, 0]])


def test_film_has_a_picture_for_every_time(tmp_path):
    scene, turn = drawn("ideal")
    few = [0, 2, 4]
    animate(scene, turn, tmp_path / "turn.gif", instants=few, dpi=30)
    with Image.open(tmp_path / "turn.gif") as film:
        assert film.n_frames == 3
        shown = []
        for i in range(3):
            film.seek(i)
            shown.append(np.asarray(film.convert("L"), dtype=float))
    assert np.abs(shown[1] - shown[0]).max() > 50 < np.abs(shown[2] - shown[1]).max()
    animate(scene, turn, tmp_path / "turn.html", instants=few, dpi=30)
    # Each picture of the player is a line.
    assert (tmp_path / "turn.html").read_text().count('\n    "') == 3
    assert sorted(path.name for path in tmp_path.iterdir()) == ["turn.gif", "turn.html"]
    assert not plt.get_fignums()


def test_film_without_ffmpeg_or_of_another_kind(tmp_path, monkeypatch):
    scene, turn = drawn("ideal")
    monkeypatch.setattr(FFMpegWriter, "isAvailable", lambda: False)
    with pytest.raises(ValueError, match=r"^Argument `path` must end in .*ffmpeg.*, but is .mp4.$"):
        animate(scene, turn, tmp_path / "turn.mp4")
    with pytest.raises(
        ValueError, match=r"^Argument `path` must be one of '.gif', '.html', '.mp4'"
    ):
        animate(scene, turn, tmp_path / "turn.avi")
    with pytest.raises(ValueError, match=r"^Argument `frames_per_second` must be a whole number"):
        animate(scene, turn, tmp_path / "turn.gif", frames_per_second=0)


def test_what_cannot_be_drawn():
    scene, turn = drawn("ideal")
    part = Trajectory(turn.time, ENDED, {"pin_position": turn.pin_position})
    for motion, instant, name in ((part, 0, "trajectory"), (turn, len(TIMES), "instant")):
        with pytest.raises(ValueError, match=f"^Argument `{name}` must") as error:
            plot_mechanism(scene, motion, instant)
        assert "\n" not in str(error.value)


def grid():
    """Two speeds, three clearances; a failed cell, a whirl, one outside the contact model."""
    dims = ("speed", "clearance")
    cells = {
        "foundation_rms": [[1e4, 2e4, np.nan], [3e4, 5e6, 4e4]],
        "success": [[1, 1, 0], [1, 1, 1]],
        "whirl": [[0, 0, 0], [0, 1, 0]],
        "inside_model": [[1, 1, 0], [1, 0, 0]],
    }
    data = xr.Dataset(
        {name: (dims, np.array(values)) for name, values in cells.items()},
        {"speed": [25.0, 30.0], "clearance": [3e-5, 6e-5, 9e-5]},
    )
    data.foundation_rms.attrs = {"units": "N", "long_name": "RMS of |R_O| + |R_C|"}
    return data


@pytest.mark.parametrize("logical", [bool, "int8"])
def test_map_says_what_its_cells_are(logical):
    data = grid()
    names = ["success", "whirl", "inside_model"]
    data = data.assign({name: data[name].astype(logical) for name in names})
    ax = plots.plot_sweep(data)
    mesh = next(c for c in ax.collections if isinstance(c, QuadMesh))
    expected = [[10, 30], [20, np.nan], [np.nan, 40]]
    np.testing.assert_array_equal(mesh.get_array().filled(np.nan), expected)
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    assert legend == ["failed", "friction whirl", "outside the contact model"]
    marked = {}
    for hatched in ax.collections:
        if hatched.get_label() in legend:
            cells = ~np.ma.getmaskarray(hatched.get_array()).reshape(3, 2)
            marked[hatched.get_label()] = [tuple(cell) for cell in np.argwhere(cells)]
            assert hatched.get_hatch()
    # (clearance, speed)
    assert marked == {
        "failed": [(2, 0)],
        "friction whirl": [(1, 1)],
        "outside the contact model": [(2, 1)],
    }
    assert ax.figure.axes[1].get_ylabel() == "RMS of $|R_O| + |R_C|$ (kN)"


def test_map_without_marks_has_no_legend():
    assert plots.plot_landscape(grid().foundation_rms).get_legend() is None
    with pytest.raises(ValueError, match=r"^Argument `marks` must be at most 6"):
        plots.plot_landscape(grid().foundation_rms, marks={str(i): grid().whirl for i in range(7)})


def test_map_without_a_number_says_so():
    values = grid().foundation_rms
    ax = plots.plot_landscape(np.nan * values)
    assert [text.get_text() for text in ax.texts] == ["no cell has a number"]
    assert len(ax.figure.axes) == 1 and not plots.plot_landscape(values).texts


def test_map_of_other_numbers_in_the_units_given():
    """A search over numbers of one's own: its own names on the axes, as they were given."""
    values = grid().foundation_rms.rename(speed="counterweight.mass", clearance="jaw.length")
    ax = plots.plot_landscape(values, units={"jaw.length": "cm"})
    names = values.dims  # in their order
    labels = {"counterweight.mass": "counterweight mass (kg)", "jaw.length": "jaw length (cm)"}
    assert [ax.get_xlabel(), ax.get_ylabel()] == [labels[str(name)] for name in names]
    of_length = ax.get_xlim() if names[0] == "jaw.length" else ax.get_ylim()
    lengths = 1e2 * values["jaw.length"].to_numpy()
    assert of_length[0] < lengths.min() < lengths.max() < of_length[1] < 2 * lengths.max()
    with pytest.raises(ValueError, match=r"^Argument `landscape` must have two dims"):
        plots.plot_landscape(values.isel({"jaw.length": 0}))


def test_map_of_pure_numbers_over_decades():
    """Without a unit in its label, by the scale that is asked."""
    turns = xr.DataArray(
        [[9.0, 90.0], [20.0, 30.0]],
        {"speed": [25.0, 30.0], "clearance": [4e-5, 6e-5]},
        attrs={"units": "1", "long_name": "turns to 1/e"},
    )
    ax = plots.plot_landscape(turns, norm="log")
    (mesh,) = (one for one in ax.collections if isinstance(one, QuadMesh))
    assert isinstance(mesh.norm, LogNorm)
    assert ax.figure.axes[1].get_ylabel() == "turns to 1/e"


def test_map_of_axes_in_any_order():
    data = grid()
    shuffled = data.isel(clearance=[1, 2, 0], speed=[1, 0])
    drawn = []
    for one in (data, shuffled):
        ax = plots.plot_sweep(one)
        of = [c for c in ax.collections if isinstance(c, QuadMesh) or c.get_hatch()]
        drawn.append([np.ma.getmaskarray(c.get_array()).reshape(3, 2) for c in of])
        mesh = of[0]
        drawn[-1] += [mesh.get_array().filled(np.nan), mesh.get_coordinates()]
    for one, other in zip(*drawn, strict=True):
        np.testing.assert_array_equal(one, other)


def test_map_wants_several_numbers_along_each_axis():
    values = grid().foundation_rms
    with pytest.raises(ValueError, match=r"two or more numbers along each dim, but is speed \[2"):
        plots.plot_landscape(values.isel(speed=[0]))
    with pytest.raises(ValueError, match=r"two or more numbers .* but is start \['a' 'b'\]\.$"):
        plots.plot_landscape(values.rename(speed="start").assign_coords(start=["a", "b"]))


def test_lines_hold_the_data():
    fig, (orbit, force, spectrum) = plt.subplots(1, 3)
    motion = Trajectory(
        jnp.arange(3.0),
        ENDED,
        {
            "eccentricity": jnp.array([[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]]),
            "foundation_force": jnp.array([1e3, 2e3, 3e3]),
        },
    )
    assert plots.plot_orbit(motion, 2.0, orbit) is orbit
    np.testing.assert_allclose(np.hypot(*orbit.lines[0].get_data()), 2e3, rtol=1e-12)
    np.testing.assert_array_equal(orbit.lines[1].get_xydata(), 1e3 * motion.eccentricity)
    assert plots.plot_force(motion, motion, force) is force
    for line in force.lines:
        np.testing.assert_array_equal(line.get_ydata(), [1, 2, 3])
    assert force.get_xlabel() == "time (s)" and force.get_ylabel() == "$|R_O| + |R_C|$ (kN)"
    # Not by colour alone.
    assert force.lines[0].get_linestyle() != force.lines[1].get_linestyle()
    plots.plot_spectrum(
        np.arange(3.0), np.array([9.0, 4.0, 1.0]), "N", spectrum, turn_frequency=1.5
    )
    np.testing.assert_array_equal(spectrum.lines[0].get_xydata(), [[1, 4], [2, 1]])
    fig.canvas.draw()


def test_all_that_is_drawn_can_be_simulated():
    assert set(DRAWN) <= set(OUTPUTS)


def test_a_linkage_is_drawn_where_its_joints_are(tmp_path):
    """The coupler of the four-bar has its lengths, and the arrow its force, at any instant."""
    scene = jc.read_scene(ROOT / "examples" / "four_bar.toml")
    motion = jc.simulate(scene, [0.0, 0.03, 0.11], outputs=("B_reaction",))
    fig, ax = plt.subplots()
    drawing = Drawing(scene, motion, ax, [0, 1, 2])
    for instant in (2, 1):
        drawing.show(instant)
        at = {name: dot.get_xydata()[0] for name, (dot, *_) in drawing.dots.items()}
        lengths = [np.linalg.norm(at[one] - at[two]) for one, two in ("OA", "AB", "BD")]
        np.testing.assert_allclose(lengths, [0.1, 0.3, 0.25], rtol=1e-12)
        angle = float(scene.drive.speed) * float(motion.time[instant])
        np.testing.assert_allclose(at["A"], 0.1 * np.array([np.cos(angle), np.sin(angle)]))
        arrow, *_ = drawing.arrows["B_reaction"]
        np.testing.assert_allclose([arrow.U[0], arrow.V[0]], motion.B_reaction[instant])
    assert at["B"][1] > 0  # to the left of A-D, as its side says
    fig.canvas.draw()
    animate(scene, motion, tmp_path / "turn.gif", instants=[0, 1])
    assert (tmp_path / "turn.gif").stat().st_size > 1000
    with pytest.raises(ValueError, match="have a crank of given speed"):
        free = replace(scene, drive=GivenTorque(10.0, 30.0))
        Drawing(free, motion, ax, [0])
