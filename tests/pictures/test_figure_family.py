"""Figures of orbits, kinds of motion and fits: artists hold the data given, which are by hand."""

from types import SimpleNamespace

import matplotlib

matplotlib.use("Agg")
import diffrax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_rgb

from jaxcrusher.basics.integrate import RESULTS, Outcome
from jaxcrusher.motion.simulation import Trajectory
from jaxcrusher.orbits.orbit_branch import OrbitBranch
from jaxcrusher.pictures import plots
from jaxcrusher.pictures.motions import coincide
from jaxcrusher.pictures.style import BLACK, COLOURS, WHITE

ENDED = Outcome(RESULTS.promote(diffrax.RESULTS.successful), jnp.zeros(()), jnp.array(0))
RPM = 30 / np.pi


def luminance(colour):
    """Relative luminance of sRGB, WCAG 2.1."""
    part = np.array(to_rgb(colour))
    linear = np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)
    return linear @ [0.2126, 0.7152, 0.0722]


def contrast(one, other):
    """Contrast of two colours, WCAG 2.1."""
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_colours_stand_out_on_white_and_on_a_dark_page():
    for colour in COLOURS:
        # 1.4.11 asks 3 to 1 of figures, and 1.4.3 asks 4.5 to 1 of letters.
        assert min(contrast(colour, "w"), contrast(colour, BLACK)) > 3
    assert contrast(WHITE, BLACK) > 4.5
    with plt.rc_context(plots.style(dark=True)):
        figure, ax = plt.subplots()
        line = ax.plot([0, 1])[0]
    assert to_rgb(figure.get_facecolor()) == to_rgb(ax.get_facecolor()) == to_rgb(BLACK)
    assert ax.xaxis.label.get_color() == WHITE and line.get_color() == COLOURS[0]


def labelled(ax):
    """Lines by their labels."""
    return {line.get_label(): line for line in ax.lines}


def rpm_of(ax):
    """The ends of the axis above, drawn."""
    ax.figure.draw_without_rendering()
    (above,) = ax.child_axes
    assert above.get_xlabel() == "rpm"
    return above.get_xlim()


def branch(kinds="ssu?"):
    """Four orbits of two turns, at 30 to 33 rad/s, and their events."""
    kind = np.array(list(kinds))
    rms = {"units": "N", "long_name": "RMS of |R_O| + |R_C|"}
    table = xr.Dataset(
        {
            "parameter": ("point", [30.0, 31.0, 33.0, 32.0]),
            "foundation_rms": ("point", [1e4, 2e4, 3e4, 4e4], rms),
            "stable": ("point", kind == "s"),
            "undecided": ("point", kind == "?"),
        }
    )
    orbits = [
        SimpleNamespace(period=2, eccentricity=np.array([[i, 10], [0, 0], [-i, 20], [0, 0]]))
        for i in range(4)
    ]
    at = SimpleNamespace(foundation_rms=2.5e4)
    events = [
        SimpleNamespace(kind="fold", parameter=33.0, point=1, orbit=lambda: at),
        SimpleNamespace(kind="contact lost at the elbow", parameter=np.nan, point=None),
        SimpleNamespace(kind="fold", parameter=32.5, point=1, orbit=lambda: at),
    ]
    # Its orbits have what is drawn of them alone, which its own maker would refuse.
    found = object.__new__(OrbitBranch)
    found.__dict__.update(table=table, orbits=orbits, events=events)
    return found


def test_a_branch_is_dashed_where_it_is_unstable():
    ax = plots.plot_branch(branch(), "speed")
    lines = labelled(ax)
    # Each part goes on to the first point of the next one.
    parts = {"stable": ("-", [0, 1, 2]), "unstable": ("--", [2, 3]), "undecided": (":", [3])}
    for name, (style, points) in parts.items():
        assert lines[name].get_linestyle() == style
        np.testing.assert_array_equal(lines[name].get_xdata(), np.array([30, 31, 33, 32])[points])
        np.testing.assert_array_equal(lines[name].get_ydata(), np.array([10, 20, 30, 40])[points])
    np.testing.assert_array_equal(lines["fold"].get_xydata(), [[33.0, 25.0]])
    unlocated = "contact lost at the elbow, only seen"
    assert len(lines[unlocated].get_xdata()) == 0
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    # Two folds have one name.
    assert legend == ["stable", "unstable", "undecided", "fold", unlocated]
    assert lines["fold"].get_marker() != lines[unlocated].get_marker()
    assert ax.get_xlim() == (30, 33) and ax.get_ylabel() == "RMS of $|R_O| + |R_C|$ (kN)"
    np.testing.assert_allclose(rpm_of(ax), [30 * RPM, 33 * RPM], rtol=1e-12)
    with pytest.raises(ValueError, match=r"^Argument `statistic` must be one of"):
        plots.plot_branch(branch(), "speed", statistic="foundation_rmss")


def test_a_bifurcation_diagram_has_the_orbits_of_each_turn_over_it():
    points = np.array([[1.0, -1.0, 1.0], [2.0, -2.0, np.nan]])
    diagram = xr.Dataset(
        {"e_x": (("value", "turn"), points)},
        {"value": ("value", [30.0, 34.0], {"long_name": "speed"})},
    )
    ax = plots.plot_bifurcation(diagram, branches=[branch("ssss")], units={"speed": "rpm"})
    cloud, *turns = ax.lines
    np.testing.assert_allclose(cloud.get_xdata(), RPM * np.repeat([30, 34], 3), rtol=1e-12)
    np.testing.assert_array_equal(cloud.get_ydata(), points.ravel())
    assert [list(line.get_ydata()) for line in turns] == [[0, 1, 2, 3], [0, -1, -2, -3]]
    np.testing.assert_allclose(ax.get_xlim(), [30 * RPM, 34 * RPM], rtol=1e-12)
    assert ax.get_ylabel() == "$e_x / c$" and ax.child_axes[0].get_xlabel() == "rad/s"
    with pytest.raises(ValueError, match=r"^Argument `variable` must be one of"):
        plots.plot_bifurcation(diagram, variable="rate_x")


def test_multipliers_are_told_by_the_circle():
    ax = plots.plot_multipliers(np.array([0.6 + 0.8j, 0.5, -1.2, 0.6 - 0.8j]), error=1e-9)
    lines = labelled(ax)
    np.testing.assert_allclose(np.hypot(*ax.lines[0].get_data()), 1, rtol=1e-14)
    expected = {
        "dies out": [[0.5, 0]],
        "grows": [[-1.2, 0]],
        "undecided": [[0.6, 0.8], [0.6, -0.8]],
    }
    for name, points in expected.items():
        np.testing.assert_array_equal(lines[name].get_xydata(), points)
    assert len({lines[name].get_marker() for name in expected}) == 3
    assert ax.get_aspect() == 1


def spectrum(speed, amplitudes):
    """Harmonics of a force and a moment, of the orders 0, 1/2, 1, 3/2 and 2."""
    return xr.Dataset(
        {"amplitude": (("quantity", "order"), np.array([amplitudes, amplitudes]))},
        {
            "quantity": ["ground_force_x", "ground_moment"],
            "order": np.arange(5) / 2,
            "unit": ("quantity", ["N", "N m"]),
        },
        {"speed": speed},
    )


def test_bars_stand_on_their_orders():
    ax = plots.plot_orders(spectrum(30.0, [-9e9, 1e3, 2e3, 0.0, 4e3]))
    middles = [bar.get_x() + bar.get_width() / 2 for bar in ax.patches]
    np.testing.assert_allclose(middles, [0.5, 1, 1.5, 2], rtol=1e-14)
    assert [bar.get_height() for bar in ax.patches] == [1, 2, 0, 4]
    assert ax.get_ylabel() == "amplitude (kN)"
    ax.figure.draw_without_rendering()
    hertz = np.array(ax.get_xlim()) * 30 / (2 * np.pi)
    np.testing.assert_allclose(ax.child_axes[0].get_xlim(), hertz, rtol=1e-12)
    with pytest.raises(ValueError, match=r"^Argument `quantities` must have one unit"):
        plots.plot_orders(spectrum(30.0, [0.0] * 5), quantities=["ground_force_x", "ground_moment"])
    with pytest.raises(ValueError, match=r"^Argument `quantities` must be one of"):
        plots.plot_orders(spectrum(30.0, [0.0] * 5), quantities=["ground"])


def test_a_campbell_diagram_has_discs_on_the_lines_of_orders():
    sizes = {20.0: [5e9, 1e3, 2e3, 1.0, 4e3], 40.0: [5e9, 3e3, 1.0, 1.0, 8e3]}
    spectra = [spectrum(speed, of) for speed, of in sizes.items()]
    ax = plots.plot_campbell(spectra, "ground_force_x", natural=[3.0, 7.0])
    (discs,) = ax.collections
    # Those above a hundredth of 8 kN: order times the turns a second.
    places = [(20, 0.5, 1), (20, 1, 2), (20, 2, 4), (40, 0.5, 3), (40, 2, 8)]
    expected = [(speed, order * speed / (2 * np.pi)) for speed, order, _ in places]
    np.testing.assert_allclose(discs.get_offsets(), expected, rtol=1e-14)
    kilo = [size for *_, size in places]
    np.testing.assert_allclose(discs.get_array(), kilo, rtol=1e-14)
    np.testing.assert_allclose(discs.get_sizes() / discs.get_sizes()[-1], np.array(kilo) / 8)
    # Whole orders have lines; each natural frequency has one across.
    np.testing.assert_allclose(ax.lines[1].get_ydata(), np.array([2, 4]) * 10 / np.pi, rtol=1e-14)
    assert [line.get_ydata()[0] for line in ax.lines[2:]] == [3, 7]
    assert ax.get_xlim() == (20, 40)
    np.testing.assert_allclose(rpm_of(ax), [20 * RPM, 40 * RPM], rtol=1e-12)
    with pytest.raises(ValueError, match=r"^Argument `spectra` must be of two or more speeds"):
        plots.plot_campbell(spectra[:1], "ground_force_x")


def test_kinds_of_motion_have_their_cells():
    rows = [["periodic", "chaotic"], ["whirl", ""], ["chaotic", "periodic"]]
    axes = {"speed": [40.0, 30.0, 35.0], "clearance": [3e-5, 6e-5]}
    kinds = xr.DataArray(rows, axes, list(axes))
    ax = plots.plot_regimes(kinds)
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    assert legend == ["periodic", "chaotic", "whirl"]
    cells = {}
    for drawn in ax.collections:
        known = ~np.ma.getmaskarray(drawn.get_array()).reshape(2, 3)
        cells[drawn.get_label()] = [tuple(cell) for cell in np.argwhere(known)]
    # (clearance, speed), in rising order
    expected = {"periodic": [(0, 2), (1, 1)], "chaotic": [(0, 1), (1, 2)], "whirl": [(0, 0)]}
    assert cells == expected
    # Not by colour alone.
    assert len({drawn.get_hatch() for drawn in ax.collections}) == 3
    np.testing.assert_allclose(rpm_of(ax), np.array(ax.get_xlim()) * RPM, rtol=1e-12)
    assert ax.get_ylabel() == "radial clearance (mm)"
    with pytest.raises(ValueError, match=r"^Argument `kinds` must be one of"):
        plots.plot_regimes(kinds.where(kinds != "whirl", "whirling"))
    with pytest.raises(ValueError, match=r"^Argument `kinds` must have two or more numbers"):
        plots.plot_regimes(kinds.isel(clearance=[0]))


def test_shadows_of_an_ellipse_are_the_standard_deviations():
    values = {"jaw.mass": 500.0, "foundation.vertical_stiffness": 1.5e8}
    spread, tie = np.array([5.0, 3e6]), np.array([[1.0, 0.8], [0.8, 1.0]])
    covariance = tie * np.outer(spread, spread)
    axes = plots.plot_corner(values, covariance, start={"jaw.mass": 510.0})
    (mass, above), (pair, stiffness) = axes
    assert above.figure is None and pair.get_xlabel() == "jaw mass\n(kg)"
    one, two, centre, _ = pair.lines
    # In kg and 1e6 N/m, about the estimate, by 360 / 180 degrees: off by (pi / 180)^2 / 2 at most.
    for line, times in ((one, 1), (two, 2)):
        reach = np.ptp(line.get_xydata(), axis=0) / 2
        np.testing.assert_allclose(reach, times * np.array([5.0, 3.0]), rtol=2e-4)
    np.testing.assert_allclose(centre.get_xydata(), [[500, 150]], rtol=1e-12)
    # It leans as the numbers are tied: of a sum of both, 1 + 0.8 of the variance.
    sums = (one.get_xdata() - 500) / 5 + (one.get_ydata() - 150) / 3
    assert np.max(sums) == pytest.approx(np.sqrt(3.6), rel=2e-4)
    np.testing.assert_allclose(pair.get_ylim(), [141, 159], rtol=1e-12)
    np.testing.assert_allclose(mass.get_xlim(), [485, 515], rtol=1e-12)
    assert mass.get_title() == "500 ± 5\nstart 510" and mass.lines[1].get_xdata()[0] == 510
    assert stiffness.get_title() == "150 ± 3"
    for bad in (covariance[:1, :1], -covariance, np.nan * covariance):
        with pytest.raises(ValueError, match=r"^Argument `covariance` must be finite, of shape"):
            plots.plot_corner(values, bad)


def force(values):
    return Trajectory(jnp.linspace(0, 1, len(values)), ENDED, {"shaking_force": jnp.array(values)})


def test_curves_that_coincide_have_their_difference_beneath():
    ramp = np.linspace(1e4, 2e4, 11)
    ax = plots.plot_force(force(ramp), force(ramp + 10.0))
    assert ax.get_xlim() == (0, 1) and coincide(ax)
    below = plots.plot_difference(ax)
    # To a rounding of 20 kN, in N.
    np.testing.assert_allclose(below.lines[0].get_ydata(), -10, atol=1e-8)
    assert below.get_xlim() == ax.get_xlim() and below.get_xlabel() == "time (s)"
    ax.figure.draw_without_rendering()
    assert below.get_position().y1 < ax.get_position().y0
    # A tenth of the axis is some 30 points apart.
    assert not coincide(plots.plot_force(force(ramp), force(ramp + 1e3)))
    with pytest.raises(ValueError, match=r"^Argument `curves` must have two lines"):
        plots.plot_difference(plots.plot_force(force(ramp)))
    with pytest.raises(ValueError, match=r"^Argument `angles` must stand for a time"):
        plots.plot_force({"shaking_force": ramp})


def test_a_phase_portrait_of_a_circle():
    time, c = jnp.linspace(0, 0.2, 2001), 5e-5
    path = c * jnp.stack([jnp.sin(30 * time), jnp.cos(30 * time)], axis=1)
    motion = Trajectory(time, ENDED, {"elbow_eccentricity": path})
    ax = plots.plot_phase(motion, c, prefix="elbow_", side="y", section=np.array([[1.0, 2e-3]]))
    curve, section = ax.lines
    np.testing.assert_allclose(curve.get_xdata(), np.cos(30 * time), rtol=1e-12)
    # Second order: (30 * 1e-4)^2 / 3 at the ends, of 1.5 mm/s.
    np.testing.assert_allclose(curve.get_ydata(), -1.5 * np.sin(30 * time), atol=1.5 * 4e-6)
    np.testing.assert_array_equal(section.get_xydata(), [[1.0, 2.0]])
    assert ax.get_xlabel() == "$e_y / c$"
    with pytest.raises(ValueError, match=r"^Argument `side` must be one of"):
        plots.plot_phase(motion, c, side="z")
