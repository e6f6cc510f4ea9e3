"""The load sheet of a foundation beside the observables of its orbit."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import jaxcrusher as jc
from jaxcrusher.mechanism.reductions import SAMPLES
from jaxcrusher.mechanism.supports import soil_under
from jaxcrusher.motion.turns import Turns, run_turns
from jaxcrusher.scenes.reader import read_scene
from jaxcrusher.sheets.load_sheet import (
    Row,
    Site,
    _verdicts,
    beside,
    between,
    joint_states,
    knocks,
    loses_contact,
    moving_rms,
    orbit_turns,
    outputs_of,
    sheet,
    static_loads,
)
from jaxcrusher.sheets.natural_modes import (
    INSTANTS,
    mass_damping_stiffness,
    moment_of_weights,
    run_up,
)
from jaxcrusher.sheets.severity import ZONES, outside_scope, share, support_kind, zone
from tests.identification import by_hand

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def orbit():
    values = {"joint": "ideal", "foundation.mass": 6e3, "foundation.x": 0.3, "speed": 31.0}
    return jc.periodic_orbit(jc.build_scene(values))


def by_name(rows):
    """Rows by name and order."""
    return {(row.name, row.order): row for row in rows}


def test_the_frame_moves_as_a_rigid_body(orbit):
    """G's displacement and velocity are observables; bearing and corner turn about G."""
    site = Site(points={"the corner": (1.2, -0.5)})
    rows = by_name(sheet(orbit, 1, site))
    angles = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
    names = ("frame_displacement", "frame_velocity", "frame_rotation")
    place, velocity, turned = (np.asarray(orbit.motion(angles, names)[name]) for name in names)
    cos, sin = np.cos(turned), np.sin(turned)

    def turning(at):
        arm = np.array(at) - [0.3, float(orbit.scene.supports.point.y)]
        return place + np.stack([cos * arm[0] - sin * arm[1], sin * arm[0] + cos * arm[1]], axis=1)

    bearing, corner = (
        turning(orbit.scene.linkage.joints.at("shaft_bearing").bore.arm.vector().array()),
        turning((1.2, -0.5)),
    )
    # By an angle that the shaft turns evenly through.
    rate = 31.0 * np.gradient(np.vstack([corner] * 3), angles[1], axis=0)[SAMPLES : 2 * SAMPLES]
    expected = {
        ("displacement of G", "RMS"): 1e6 * place.std(axis=0),
        ("velocity of G", "RMS"): 1e3 * np.sqrt(np.mean(velocity**2, axis=0)),
        ("displacement of the main bearing", "RMS"): 1e6 * bearing.std(axis=0),
        ("velocity of the corner", "RMS"): 1e3 * rate.std(axis=0),
        ("velocity of the corner", "peak"): 1e3 * np.abs(rate).max(axis=0),
    }
    for (words, order), two in expected.items():
        found = [rows[f"{words}, {side}", order].value for side in ("horizontally", "vertically")]
        # Central differences of 1024 instants are right to 6e-6 of the first order.
        np.testing.assert_allclose(found, two, rtol=2e-5, err_msg=words)


def test_peaks_and_modes_are_the_orbit_s(orbit):
    rows = by_name(sheet(orbit, 1))
    moving = rows["force of both supports, horizontally", "RMS of what moves"].value
    upright = rows["force of both supports, vertically", "RMS of what moves"].value
    # kN; both have means that are sums, of 1024 instants and of quadrature.
    assert np.hypot(moving, upright) == pytest.approx(1e-3 * float(orbit["transmitted_rms"]), 1e-6)
    mode = rows["undamped frequency of mode 1", ""]
    # Of three digits.
    times = mode.value / (31.0 / (2 * np.pi))
    assert f"{times:.3g} times the running frequency, most in " in mode.remark
    # Supports carry all weight, the frame feels what moves alone.
    weights = [rows[f"force of {side} support, vertically", "static"].value for side in LEFT_RIGHT]
    assert sum(weights) == pytest.approx(-9.81e-3 * 6641, rel=1e-9)
    both = rows["force of both supports, vertically", "equivalent, - 3 times what moves"].value
    least = rows["force of both supports, vertically", "least"].value
    assert both == pytest.approx(sum(weights) + 3 * (least - sum(weights)), rel=1e-9)


LEFT_RIGHT = ("left", "right")


def test_moments_are_about_the_shaft_and_the_base(orbit):
    """The moment about O is that about G less the arm's cross product, instant by instant."""
    turns = orbit_turns(orbit)
    force, moment = turns.values["exciting_force"][0], turns.values["exciting_moment"][0]
    g = np.array([0.3, float(orbit.scene.supports.point.y)])
    rows = by_name(sheet(orbit, 1))
    levels = {
        "at the shaft's level, about O": np.asarray(
            orbit.scene.linkage.joints.at("shaft_bearing").bore.arm.vector().array()
        ),
        "at the base, in its middle": np.array([0.1, -0.6]),
    }
    for words, at in levels.items():
        x, y = g - at
        about = moment + x * force[:, 1] - y * force[:, 0]
        least = 1e-3 * (about.min() - about.mean())
        assert rows[f"exciting moment {words}", "least"].value == pytest.approx(least, rel=1e-9)


# A frame of 9 t, which rubber lets move by 15 mm, and springs by 0.2 mm.
NINE_TONS = {"mass": 9e3, "inertia": 4e3, "x": 0.3, "y": 0.2, "left": -0.7, "right": 0.9}
SPRINGS = {"base": -0.6, "horizontal_stiffness": 2e8, "vertical_stiffness": 3e8}
SPRINGS |= {"horizontal_damping": 2e5, "vertical_damping": 3e5}
RUBBER = {"base": -0.6, "horizontal_stiffness": 2e6, "vertical_stiffness": 4e6}
RUBBER |= {"horizontal_damping": 2e4, "vertical_damping": 2e4}


def of_designer(under, force):
    """What a designer's own linear model, by NumPy alone, makes of forces: a row an order.

    It has the machine's mass: bodies that stand where their circles have their means.
    """
    mass = np.diag([under["mass"], under["mass"], under["inertia"]])
    places, _ = by_hand.places({})
    for body, place in places.items():
        x, y = place.mean().real - under["x"], place.mean().imag - under["y"]
        at = np.array([[1, 0, -y], [0, 1, x]])
        mass += by_hand.LINKS[f"{body}.mass"] * at.T @ at
        mass[2, 2] += by_hand.LINKS[f"{body}.inertia"]
    found = []
    for order, push in enumerate(force, start=1):
        rate = 31.0 * order
        dynamic = -(rate**2) * mass.astype(complex)
        for side in ("left", "right"):
            x, y = under[side] - under["x"], under["base"] - under["y"]
            at = np.array([[1, 0, -y], [0, 1, x]])
            springs, dampers = (
                np.array([under[f"{axis}_{what}"] for axis in ("horizontal", "vertical")])
                for what in ("stiffness", "damping")
            )
            dynamic += at.T @ np.diag(springs + 1j * rate * dampers) @ at
        found.append(np.linalg.solve(dynamic, push))
    return np.array(found)


def spectrum(rows, *names):
    """Complex amplitudes of the orders 1 and 2 in kN, kN m, um: a row an order."""
    known = by_name(rows)
    two = [[known[name, order] for name in names] for order in (1.0, 2.0)]
    return np.array([[one.value * np.exp(1j * one.phase_rad) for one in own] for own in two])


PUSH = ("exciting force, horizontally", "exciting force, vertically", "exciting moment about G")
SHIFT = ("displacement of G, horizontally", "displacement of G, vertically")


def moved_by(under):
    """The sheet of the machine on its frame, and how far the designer's model is off, by order."""
    block = {f"foundation.{name}": value for name, value in under.items()}
    rows = sheet(jc.periodic_orbit(jc.build_scene({"speed": 31.0, "joint": "ideal"} | block)), 2)
    shift = spectrum(rows, *SHIFT)
    off = 1e3 * 1e6 * of_designer(under, spectrum(rows, *PUSH))[:, :2] - shift
    return rows, np.linalg.norm(off, axis=1) / np.linalg.norm(shift, axis=1)


def test_exciting_forces_make_a_designer_s_model_move_as_the_frame():
    """By hand they are those of the frame at rest, whatever it stands on."""
    still = by_hand.crusher({}, 31.0)
    x, y, moment = (still[n][1:3] for n in ("ground_force_x", "ground_force_y", "ground_moment"))
    expected = 1e-3 * np.array([x, y, moment - 0.3 * y + 0.2 * x]).T
    springs, rubber = NINE_TONS | SPRINGS, NINE_TONS | RUBBER
    (stiff, near), (soft, far) = moved_by(springs), moved_by(rubber)
    for rows in (stiff, soft):
        # To the rounding of order 2, which is a fiftieth of order 1.
        np.testing.assert_allclose(spectrum(rows, *PUSH), expected, rtol=1e-9)
    # Weight that leans is 1e-4 of what the springs do; the links' places change by a hundredth, and
    # so bring 1e-3 of order 1 into order 2. On rubber the frame moves by 3 mm, a third of the
    # throw: there the force on the moving frame is 0.8 of that on one at rest.
    assert near[0] < 1e-3 and near[1] < 0.03 and far[0] < 0.03


def test_harmonics_of_a_block_are_what_excites_it(orbit):
    rows, found = by_name(sheet(orbit, 2)), jc.harmonics(orbit, 2)
    assert list(found["quantity"].values) == [
        "exciting_force_x",
        "exciting_force_y",
        "exciting_moment",
    ]
    for name, amplitude in zip(PUSH, found.amplitude.sel(order=1).values, strict=True):
        assert rows[name, 1.0].value == pytest.approx(1e-3 * amplitude, rel=1e-9)


def test_exciting_forces_have_no_weight(orbit):
    rows = by_name(sheet(orbit, 1))
    most, least = (rows["exciting force, vertically", what].value for what in ("greatest", "least"))
    # The machine's 6.3 kN would be in both.
    assert least < 0 < most and abs(most + least) < 1.0


def test_a_support_is_rigid_or_flexible_in_each_direction():
    """Soft springs horizontally, with vertical modes from 2.98 times the running frequency on."""
    block = {"foundation.mass": 6e3, "foundation.x": 0.3, "foundation.y": 0.2, "joint": "ideal"}
    block |= {"foundation.horizontal_stiffness": 1e6, "foundation.vertical_stiffness": 30e6}
    scene = jc.build_scene(block | {"foundation.horizontal_damping": 50e3})
    found = sheet(jc.periodic_orbit(scene), 1)
    rows = by_name(found)
    upright = rows["displacement of G, vertically", "RMS"], rows["velocity of G, vertically", "RMS"]
    # As measured by one who found both a zone too good.
    assert [row.value for row in upright] == pytest.approx([70.5, 2.12], rel=2e-3)
    assert [row.remark for row in upright] == ["zone C, rigid support", "zone B, rigid support"]
    for place in ("G", "the main bearing"):
        assert rows[f"velocity of {place}, horizontally", "RMS"].remark.endswith("flexible support")
    decays = [row for row in found if row.name.startswith("decay of free motion")]
    assert len(decays) == 3 and all("vibrates at" in row.remark for row in decays)
    # The worst zone of all, and what has it.
    worst = max(row.remark[5] for row in found if row.remark.startswith("zone "))
    overall = found[0]
    assert overall.name == "overall zone" and overall.remark.startswith(f"zone {worst}, ")
    assert "motor_power is not given" in overall.remark


def of_modes(frequencies, ratios, push, band=(0.7, 1.3)):
    """The verdict, and remarks on modes in x and y alone, under a push (N) of order 1 at 5 Hz.

    The slowest mode, which turns, has no remark.
    """
    mass = 10e3
    stiffness, damping = (
        dict(zip(("horizontal", "vertical"), values, strict=True))
        for values in (
            [mass * (2 * np.pi * f) ** 2 / 2 for f in frequencies],
            [mass * 2 * np.pi * f * z for f, z in zip(frequencies, ratios, strict=True)],
        )
    )
    block = {
        "mass": mass,
        "inertia": 1e6,
        "x": 0.1,
        "y": 0.0,
        "base": 0.0,
        "left": -0.7,
        "right": 0.9,
    }
    block |= {f"{axis}_stiffness": value for axis, value in stiffness.items()}
    block |= {f"{axis}_damping": value for axis, value in damping.items()}
    scene = {"gravity": 0.0, "speed": 10 * np.pi} | {f"foundation.{n}": v for n, v in block.items()}
    angles = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
    force = np.cos(angles)[None, :, None] * np.array(push)
    still = np.zeros((1, SAMPLES))
    values = {name: np.zeros((1, SAMPLES, 2)) for name in ("left_force", "right_force")}
    values |= {f"frame_{name}": np.zeros((1, SAMPLES, 2)) for name in ("displacement", "velocity")}
    values |= {name: still for name in ("frame_rotation", "frame_spin", "exciting_moment")}
    turns = Turns(jc.build_scene(BARE | scene), 1, values | {"exciting_force": force})
    rows = sheet(turns, 2, Site(band=band))
    return rows[1], [row.remark for row in rows if row.name.startswith("undamped")][1:]


def test_resonance_is_judged_by_what_a_mode_does_to_an_order():
    """Modes of 5.5 Hz in x and of 4.8 Hz in y, of a machine that turns at 5 Hz."""
    push = (3e3, 4e3)
    # By hand, of either mode alone: 1 / |1 - r^2 + 2 i zeta r|, and what that makes of the push.
    ratios = np.array([5 / 5.5, 5 / 4.8])

    def by_itself(damping):
        larger = 1 / np.abs(1 - ratios**2 + 2j * np.array(damping) * ratios)
        moved = np.array(push) / np.array([5.5, 4.8]) ** 2 * larger
        return larger, 100 * moved / np.linalg.norm(moved)

    for damping, close in (((0.1, 0.05), 2), ((0.96, 0.68), 0), ((0.68, 0.05), 1)):
        verdict, remarks = of_modes((5.5, 4.8), damping, push)
        assert verdict.name == "resonances" and verdict.value == close
        assert close or verdict.remark == "none"
        larger, share = by_itself(damping)
        # The slower mode stands first, and the machine's kilograms are 1e-6 of the block.
        for remark, i in zip(remarks, (1, 0), strict=True):
            times, is_close = 1 / ratios[i], larger[i] >= 1.5
            words = f"{times:.2f} times order 1, amplified {larger[i]:.2f} times, {share[i]:.2g} %"
            assert ("; resonance: " if is_close else "; no resonance: ") + words in remark
            assert (words in verdict.remark) == is_close
    # What hardly moves is amplified in vain, and what lies outside of the band is not looked at.
    verdict, remarks = of_modes((5.5, 4.8), (0.05, 0.05), (0.0, 4e3))
    assert verdict.value == 1 and "no resonance: 1.10 times order 1" in remarks[1]
    verdict, remarks = of_modes((5.5, 4.8), (0.1, 0.05), push, band=(0.99, 1.3))
    assert verdict.value == 1 and "resonance" not in remarks[0]


@pytest.mark.parametrize(
    ("running", "power", "words"),
    [
        (1.9, None, "114 rpm is below its 120 rpm"),
        (1.99999, None, "119.999 rpm is below its 120 rpm"),
        (5.0, 11e3, "11 kW is below its 15 kW"),
        (5.0, 14999.9, "14.9999 kW is below its 15 kW"),
    ],
)
def test_below_its_scope_the_standard_says_nothing(orbit, running, power, words):
    assert words in outside_scope(running, power)
    assert outside_scope(2.1, 15e3) == outside_scope(2.1, None) == ""
    if power is not None:
        rows = sheet(orbit, 1, Site(power=power))
        assert words in rows[0].remark and not any("zone " in r.remark for r in rows)


def test_a_run_stands_beside_ideal_joints():
    """Harmonics are means of the turns' own, with their standard error; peaks are the turns'."""
    # Its orbit impacts and is stable: the largest multiplier is 0.64.
    numbers = {"speed": 34.23, "clearance": 0.0645e-3}
    scene = jc.build_scene({"load_law": "closing_stroke", "start": "contact", **numbers})
    turns = run_turns(scene, outputs_of(scene), settle=5, turns=10, rtol=1e-7)
    assert turns.settled == 5 and turns.pieces == 10 and not turns.failure
    force = 1e-3 * turns.values["ground_force"][..., 1]
    each = 2 / SAMPLES * force @ np.exp(-2j * np.pi * 3 / SAMPLES * np.arange(SAMPLES))
    ideal = sheet(jc.periodic_orbit(scene.ideal()), 3)
    rows = by_name(beside(sheet(turns, 3), ideal=ideal))
    third = rows["exciting force, vertically", 3.0]
    assert third.value == pytest.approx(abs(each.mean()), rel=1e-9)
    error = np.sqrt(np.var(each.real, ddof=1) + np.var(each.imag, ddof=1)) / np.sqrt(10)
    assert third.scatter == pytest.approx(error, rel=1e-9)
    assert third.ideal == by_name(ideal)["exciting force, vertically", 3.0].value
    peak = rows["exciting force, vertically", "greatest"]
    most = 1e-3 * turns.values["largest exciting force, vertically"]
    assert peak.value == pytest.approx(most.max() - force.mean(), rel=1e-12)
    assert peak.value > 1.2 * float(peak.ideal)
    assert peak.scatter == pytest.approx(np.std(most, ddof=1))
    # Between the instants that are seen impacts are larger by up to 1 % here. Elsewhere the lower
    # of two parabolas leaves 1.3e-4 of these steps, and 4e-5 of those at a tolerance of 1e-9.
    above = most / force.max(axis=1) - 1
    assert above.min() > -2e-4 and 1e-3 < above.max() < 0.02
    # Parseval: what the orders 1 to 3 of each turn leave of its power.
    slow = [2 * np.abs(np.fft.rfft(one)[1:4] / SAMPLES) ** 2 for one in force]
    powers = np.var(force, axis=1)
    fast = rows["exciting force, vertically", "power above order 3"]
    assert fast.value == pytest.approx(100 * (1 - np.sum(slow) / powers.sum()), rel=1e-9)
    assert fast.value > 100 * float(fast.ideal) and fast.unit == "%"
    above = rows["exciting force, vertically", "RMS above order 3"]
    left = powers - np.sum(slow, axis=1)
    assert above.value == pytest.approx(np.sqrt(left.mean()), rel=1e-9) and above.unit == "kN"
    assert above.scatter == pytest.approx(np.std(np.sqrt(left), ddof=1) / np.sqrt(10), rel=1e-9)
    each = 100 * (1 - np.sum(slow, axis=1) / powers)
    assert fast.scatter == pytest.approx(np.std(each, ddof=1) / np.sqrt(10), rel=1e-9)
    # The same turns in one go: the run is handed on from chunk to chunk.
    whole = jc.statistics(scene, 5, 10, rtol=1e-7).by_turn["shaking_rms"]
    moving = turns.values["ground_force"] + [0, 9.81 * 641]
    chunk = np.sqrt(np.mean(np.sum(moving**2, axis=-1), axis=1))
    # 1024 instants of a turn with impacts leave 2e-4.
    np.testing.assert_allclose(chunk, whole, rtol=1e-3)


def test_peaks_of_a_run_are_those_of_the_motion():
    """The first impacts of a slow crusher, which the instants of a turn miss by up to a quarter."""
    scene = jc.paper_scene(10.0, 0.06e-3)
    turns = run_turns(scene, outputs_of(scene), settle=0, turns=5)
    force = jc.simulate(scene, np.linspace(0, 0.03, 60_001), outputs=("ground_force",)).ground_force
    for i, side in enumerate(("horizontally", "vertically")):
        for which, end in (("largest", np.max), ("least", np.min)):
            found = turns.values[f"{which} exciting force, {side}"][0]
            # Parabolas through the ends of steps.
            assert found == pytest.approx(float(end(np.asarray(force)[:, i])), rel=1e-3)
    seen = turns.values["ground_force"][0, :, 0].max()
    assert turns.values["largest exciting force, horizontally"][0] > 1.2 * seen
    rows = by_name(sheet(turns, 3))
    moves = turns.values["largest exciting force, horizontally"].max() - np.mean(
        turns.values["ground_force"][..., 0]
    )
    greatest = rows["exciting force, horizontally", "greatest"].value
    assert greatest == pytest.approx(1e-3 * moves, rel=1e-12)


def shaken(scene, size):
    """Turns of a clamped frame: cos(theta) and half of cos(7 theta), of a size in N."""
    angles = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
    force = size * (np.cos(angles) + np.cos(7 * angles) / 2)
    values = {"ground_force": np.stack([0 * force, force - 100.0], axis=-1)[None]}
    return Turns(scene, 1, values | {"ground_moment": 0 * force[None]})


def test_power_above_an_order_is_told():
    turns = shaken(jc.ideal_scene(30.0), 1e3)
    rows, all_of_it = (by_name(sheet(turns, orders)) for orders in (4, 7))
    # A quarter of five quarters.
    name = "exciting force, vertically"
    assert rows[name, "power above order 4"].value == pytest.approx(20.0, rel=1e-12)
    assert all_of_it[name, "power above order 7"].value == pytest.approx(0.0, abs=1e-9)
    assert rows["exciting force, horizontally", "power above order 4"].value == 0.0


def test_a_support_pulls_where_what_moves_lifts_it(orbit):
    """By hand: dead load and greatest lift of the forces on the ground, which have y up."""
    angles = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
    loads = orbit.motion(angles, ("left_force", "right_force"))
    for factor, pulling in ((1.0, 0), (100.0, 2)):
        rows = by_name(sheet(orbit, 1, Site(factor=factor)))
        for side in ("left", "right"):
            force = 1e-3 * np.asarray(loads[f"{side}_force"])[:, 1]
            dead, lift = -force.mean(), force.max() - force.mean()
            told = {
                order: row.value for (name, order), row in rows.items() if name.startswith(side)
            }
            expected = dead, lift, dead - factor * lift, max(factor * lift - dead, 0.0)
            assert tuple(told.values()) == pytest.approx(expected, rel=1e-9)
            row = rows[f"{side} support", "anchor force"]
            assert row.remark.startswith("pulls" if pulling else "presses")
        verdict = rows["supports that pull", ""]
        assert verdict.value == pulling and ("left support by" in verdict.remark) == bool(pulling)


def test_a_clamped_frame_of_known_mass_may_be_lifted():
    turns = shaken(jc.ideal_scene(30.0), 1e3)
    assert not any(row.part == "uplift" for row in sheet(turns, 1))
    rows = by_name(sheet(turns, 1, Site(frame_mass=100.0, factor=3.0)))
    # As equivalent loads have it: 4.5 kN upwards, less the weights of 0.1 kN and of 100 kg.
    assert rows["frame", "anchor force"].value == pytest.approx(4.4 - 0.981, rel=1e-9)


def test_the_exciting_force_of_the_1060_by_700_machine_by_hand():
    """Places in NumPy, their second differences, and the first order of -sum m a.

    The same table stands in docs/foundation.md, where its last numbers are of small motions.
    """
    throw, jaw, toggle = 0.0386827451352663, 1.5, 0.5  # a stroke of 34 mm needs this throw
    bearing = 1.4 * np.exp(1j * np.radians(90 - 22.5))
    speed, step, count = 280 * np.pi / 30, 1e-3, 64

    def places(theta):
        turn = np.exp(1j * theta)
        pin = bearing + throw * turn
        reach = abs(pin)
        along = (reach**2 + toggle**2 - jaw**2) / (2 * reach)
        elbow = pin / reach * (along - 1j * np.sqrt(toggle**2 - along**2))
        centre = pin + 0.6 * np.exp(1j * np.radians(10)) * (elbow - pin) / jaw
        return np.array([bearing + 0.008 * turn, centre, elbow / 2])

    theta = 2 * np.pi * np.arange(count) / count
    bent = (places(theta + step) - 2 * places(theta) + places(theta - step)) * (speed / step) ** 2
    force = -np.array([2400.0, 2900.0, 120.0]) @ bent
    first = [2 / count * part @ np.exp(-1j * theta) for part in (force.real, force.imag)]
    scene = read_scene(EXAMPLES / "like_c106.toml").ideal()
    rows = by_name(sheet(jc.periodic_orbit(scene), 1))
    sides = zip(("horizontally", "vertically"), first, (77.58, 117.04), strict=True)
    for side, expected, small in sides:
        row = rows[f"exciting force, {side}", 1.0]
        # Second differences of places of 1 m at this step round to some 1e-7 of these forces.
        assert row.value == pytest.approx(1e-3 * abs(expected), rel=1e-6)
        assert row.phase_rad == pytest.approx(np.angle(expected), abs=1e-6)
        # Small motions leave out squares of the throw over the links, (39 / 500)^2 of some terms.
        assert row.value == pytest.approx(small, rel=3e-4)


def test_equivalent_loads_have_a_range_over_what_is_assumed():
    scene = jc.ideal_scene(30.0)
    rows = sheet(shaken(scene, 1e3), 1)
    others = [static_loads(shaken(scene, size), Site()) for size in (500.0, 3e3)]
    found = by_name(between(rows, others))
    # 3 times 1.5 times the size, up and down about the weight.
    up = found["force, vertically", "equivalent, + 3 times what moves"]
    assert (up.lowest, up.value, up.highest) == pytest.approx((2.15, 4.4, 13.4), rel=1e-9)
    still = found["force, vertically", "static"]
    assert still.lowest == "" and still.value == pytest.approx(-0.1)
    assert between(rows, []) == rows


def test_the_rms_of_turns_is_that_of_the_sheet():
    """Of a clamped machine the exciting force alone."""
    turns = shaken(jc.ideal_scene(30.0), 1e3)
    (rms,) = moving_rms(turns).values()
    np.testing.assert_allclose(rms, 1e3 * np.sqrt(1.25 / 2), rtol=1e-12)


def test_knocks_are_told_of_pins_that_leave_their_bores():
    turns = shaken(jc.ideal_scene(30.0), 1e3)
    assert not loses_contact(turns)
    for depth, lost in ((1e-3, False), (-1e-3, True)):
        depths = np.full((1, SAMPLES), 0.1)
        depths[0, 7] = depth
        values = {**turns.values, "elbow_penetration_ratio": depths}
        assert loses_contact(replace(turns, values=values)) == lost
    assert knocks(turns, sheet(turns, 1), 1).startswith("the frame is clamped, and what knocks")
    block = replace(turns, scene=jc.build_scene({"joint": "ideal", "foundation.mass": 6e3}))
    rms = {"exciting force": (1.5, 2.0), "force of both supports": (0.0, 5.0)}
    rows = [
        Row("harmonics", f"{name}, {side}", "RMS above order 4", size, "kN")
        for name, sizes in rms.items()
        for side, size in zip(("horizontally", "vertically"), sizes, strict=True)
    ]
    told = knocks(block, rows, 4)
    assert (
        "above order 4 the exciting force has an RMS of 2.5 kN, and the supports pass on 5 kN"
        in told
    )


def test_a_run_of_ideal_joints_is_their_orbit():
    """At the same angles: the first instant of a turn has the shaft at zero."""
    scene = jc.ideal_scene(30.0)
    run = run_turns(scene, outputs_of(scene), settle=0, turns=10)
    exact = orbit_turns(jc.periodic_orbit(scene)).values["ground_force"]
    for turn in run.values["ground_force"]:
        # Angles that are counted on through turns, with their rounding.
        np.testing.assert_allclose(turn, exact[0], rtol=1e-9, atol=1e-6)


def test_a_run_ends_with_its_time():
    scene = jc.paper_scene(30.0, 0.06e-3)
    turns = run_turns(scene, outputs_of(scene), settle=50, turns=100, seconds=1e-3)
    assert turns.settled < 50 and turns.pieces == 10


def test_a_run_up_ends_in_the_steady_state():
    """Slow enough, block and force are steady at its end, and a run-down begins there."""
    scene = jc.build_scene({"joint": "ideal", "foundation.mass": 6e3, "speed": 31.0})
    force = np.array([[3e3, 300.0], [-2e3j, 0], [-900.0, 100j]])
    mass, damping, stiffness = mass_damping_stiffness(scene)
    angles = 2 * np.pi * np.arange(INSTANTS) / INSTANTS

    # Weights swing sideways with what pushes there, 31 rad/s times an order: they do not fall.
    weights = np.zeros_like(force)
    weights[2] = -9.81 * force[0] / (31.0 * np.arange(1, 3)) ** 2

    def steady(share):
        """Peaks at a share of the speed, where forces of inertia are the square of it."""
        path = np.zeros((INSTANTS, 3))
        for order in (1, 2):
            rate = 31.0 * share * order
            dynamic = stiffness - rate**2 * mass + 1j * rate * damping
            pushed = share**2 * (force - weights) + weights
            moved = np.linalg.solve(dynamic, pushed[:, order - 1])
            path += np.real(np.exp(1j * order * angles)[:, None] * moved)
        return np.abs(path).max(axis=0)

    up, down = (np.abs(run_up(scene, force, 80.0, down=down)) for down in (False, True))
    middle = slice(len(up) // 2 - INSTANTS, len(up) // 2 + INSTANTS)
    # The speed changes by 0.25 % in a turn, and by 0.5 % in one at half of it.
    np.testing.assert_allclose(up[-INSTANTS:].max(axis=0), steady(1.0), rtol=0.01)
    np.testing.assert_allclose(down[:INSTANTS].max(axis=0), steady(1.0), rtol=0.01)
    np.testing.assert_allclose(up[middle].max(axis=0), steady(0.5), rtol=0.02)
    # A faster one through a natural frequency below the running one has its peak on the way.
    low = {"foundation.horizontal_stiffness": 5e5, "foundation.horizontal_damping": 2e3}
    soft = jc.build_scene({"joint": "ideal", "foundation.mass": 6e3, **low})
    fast, slow = (np.abs(run_up(soft, force, seconds)[:, 0]) for seconds in (2.0, 40.0))
    assert slow.max() > 1.2 * fast.max() > 1.2 * fast[-INSTANTS:].max()


def test_the_moment_of_weights_is_the_same_at_any_speed():
    """What is left of the moment about G falls with the square of the speed, here to a 25th."""
    angles, found = 2 * np.pi * np.arange(SAMPLES) / SAMPLES, []
    for speed in (30.0, 6.0):
        scene = jc.build_scene({"joint": "ideal", "speed": speed, "foundation.x": 0.3})
        seen = jc.periodic_orbit(scene).motion(angles, ("ground_force", "ground_moment"))
        sideways, moment = (
            2 * np.fft.rfft(one)[1:4] / SAMPLES
            for one in (seen["ground_force"][:, 0], seen["ground_moment"])
        )
        found.append((moment, moment_of_weights(scene, sideways)))
    (fast, weights), (slow, same) = found
    np.testing.assert_allclose(same, weights, rtol=1e-6)
    np.testing.assert_allclose((fast - weights) / 25 + weights, slow, rtol=1e-6)


def test_a_run_up_sees_high_orders():
    """Of 128 instants a turn the order 127 would look like the first, 900 times as wide."""
    scene = jc.build_scene({"joint": "ideal", "foundation.mass": 6e3, "speed": 31.0})
    mass, damping, stiffness = mass_damping_stiffness(scene)
    force, rate = np.zeros((3, 127), complex), 127 * 31.0
    force[0, -1] = 1e3
    dynamic = stiffness - rate**2 * mass + 1j * rate * damping
    steady = abs(np.linalg.solve(dynamic, force[:, -1])[0])
    path = run_up(scene, force, 4.0)[:, 0]
    assert np.abs(path[-32 * 127 :]).max() == pytest.approx(steady, rel=0.1)


def test_a_run_down_begins_in_the_running_motion():
    """Below the resonances of a block that weighs no more than the machine on it."""
    block = {"mass": 600.0, "inertia": 300.0, "x": 0.3, "y": 0.2}
    block |= {f"{axis}_stiffness": 3e6 for axis in ("horizontal", "vertical")}
    block |= {f"{axis}_damping": 2e4 for axis in ("horizontal", "vertical")}
    scene = jc.build_scene({"joint": "ideal"} | {f"foundation.{n}": v for n, v in block.items()})
    rows = by_name(sheet(jc.periodic_orbit(scene), 3))
    for axis in ("horizontally", "vertically"):
        running = rows[f"displacement of G, {axis}", "peak"].value
        down = rows[f"peak displacement of G on the way down, {axis}", ""].value
        assert down == pytest.approx(running, rel=0.03)


def test_a_run_down_counts_the_leaning_weight_once():
    """Just below a resonance in rocking on soft supports, where a moment of weights is felt."""
    block = {"mass": 600.0, "inertia": 300.0, "x": 0.3, "y": 0.2, "base": 0.0}
    block |= {"left": -0.1, "right": 0.7, "horizontal_stiffness": 3e5, "vertical_stiffness": 1e5}
    block |= {f"{axis}_damping": 600.0 for axis in ("horizontal", "vertical")}
    scene = {"joint": "ideal", "speed": 6.5} | {f"foundation.{n}": v for n, v in block.items()}
    rows = by_name(sheet(jc.periodic_orbit(jc.build_scene(scene)), 3))
    running = rows["displacement of G, horizontally", "peak"].value
    down = rows["peak displacement of G on the way down, horizontally", ""].value
    assert down == pytest.approx(running, rel=0.02)


# A machine that weighs nothing on its block.
BARE = {f"{body}.{n}": 1e-3 for body in ("shaft", "jaw", "toggle") for n in ("mass", "inertia")}
BARE |= {"joint": "ideal"}


def test_a_printed_block():
    """A textbook's block of 800 kN on 200 MN/m and 2.34 MN s/m: 7.882 Hz, ratio 0.2897."""
    mass = 800e3 / 9.81
    block = {"mass": mass, "inertia": mass, "left": -1.0, "right": 1.0}
    block |= {"vertical_stiffness": 100e6, "vertical_damping": 1.17e6}
    modes = jc.natural_modes(
        jc.build_scene(BARE | {f"foundation.{n}": v for n, v in block.items()})
    )
    upright = int(np.argmax(modes.share.sel(coordinate="y").values))
    found = modes.frequency[upright], modes.damping_ratio[upright]
    # Printed with four digits.
    assert [float(one) for one in found] == pytest.approx([7.882, 0.2897], rel=2e-4)


def test_rocking_is_given_without_supports(orbit):
    """G at the base: rocking alone has sqrt(K / J), with the damper's C / (2 sqrt(K J)).

    Springs and dampers are told of any motion: here of another scene's.
    """
    block = {"mass": 127.55e3, "inertia": 2e5, "base": 0.0, "x": 0.1}
    block |= {"rocking_stiffness": 8e8, "rocking_damping": 3e6, "vertical_damping": 1e6}
    scene = jc.build_scene(BARE | {f"foundation.{n}": v for n, v in block.items()})
    modes = jc.natural_modes(scene)
    turned = int(np.argmax(modes.share.sel(coordinate="rotation").values))
    found = float(modes.frequency[turned]), float(modes.damping_ratio[turned])
    expected = np.sqrt(8e8 / 2e5) / (2 * np.pi), 3e6 / (2 * np.sqrt(8e8 * 2e5))
    # The weight of the machine leans by 1e-6 of the springs.
    assert found == pytest.approx(expected, rel=1e-5)
    rows = by_name(sheet(replace(orbit_turns(orbit), scene=scene), 1))
    assert rows["stiffness in rocking", ""].value == pytest.approx(800)
    assert rows["damping in rocking", ""].value == pytest.approx(3)


@pytest.mark.parametrize("given", [{}, {"rocking_stiffness": 8e8}])
def test_the_damper_of_rocking_stands_for_that_of_the_supports(given):
    block = {"mass": 50e3, "inertia": 6e4, "vertical_damping": 1e6, "rocking_damping": 2e5}
    block |= {"left": -0.8, "right": 0.6, **given}
    under = jc.build_scene(BARE | {f"foundation.{n}": v for n, v in block.items()}).supports
    arm = (under.right - under.left) / 2
    total = 2 * under.vertical_damping * arm**2 + under.rocking_damping
    assert float(total) == pytest.approx(2e5, rel=1e-12)
    assert given or (float(under.left), float(under.right)) == (-0.8, 0.6)


def test_a_block_on_soil():
    """Its springs are those of the soil, and its modes those of two masses by hand."""
    soil = {"shear_modulus": 6e7, "density": 1800.0, "poisson": 0.35}
    soil |= {"length": 4.0, "width": 2.0, "embedment": 1.0}
    block = {"mass": 50e3, "inertia": 6e4, "x": 0.1, "y": 0.4, "base": -0.6}
    given = {f"foundation.{n}": v for n, v in block.items()}
    given |= {f"foundation.soil.{n}": v for n, v in soil.items()}
    modes = jc.natural_modes(jc.build_scene(BARE | given))
    under = soil_under(**soil, speed=30.0)
    # Springs at a third of the embedment above the base, 1 m below G.
    arm = 1.0 - 1 / 3
    k, rocking = float(under.horizontal_stiffness), float(under.rocking_stiffness)
    matrix = np.array([[k, k * arm], [k * arm, rocking + k * arm**2]])
    matrix[1, 1] -= 50e3 * 9.81 * arm  # the weight leans
    squares = np.linalg.eigvals(np.linalg.inv(np.diag([50e3, 6e4])) @ matrix)
    upright = float(under.vertical_stiffness) / 50e3
    expected = np.sort(np.sqrt([*squares, upright])) / (2 * np.pi)
    # The machine's kilograms, and a rotation of the sag.
    np.testing.assert_allclose(modes.frequency, expected, rtol=1e-4)
    speed = {"foundation.soil.shear_wave_speed": np.sqrt(6e7 / 1800)}
    del given["foundation.soil.shear_modulus"]
    other = jc.natural_modes(jc.build_scene(BARE | given | speed))
    np.testing.assert_allclose(other.frequency, modes.frequency, rtol=1e-12)


def test_a_mode_counts_where_it_moves_the_place():
    """Of a slow rocking mode G feels nothing, and a place above it moves horizontally alone."""
    shapes = xr.DataArray([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]], dims=("mode", "coordinate"))
    modes = xr.Dataset({"frequency": ("mode", [1.2, 3.0, 4.0]), "shape": shapes})
    kinds = [
        support_kind(modes, 1.0, np.array(arm), axis)
        for arm in ([0.0, 0.0], [0.0, 1.0], [0.3, 0.3])
        for axis in ("x", "y")
    ]
    # A rotation of 1 moves the last place by 0.3: 0.09 of 1.09 is less than a tenth.
    assert kinds == ["rigid", "rigid", "flexible", "rigid", "rigid", "rigid"]


def test_a_clamped_frame_has_a_shorter_sheet():
    orbit = jc.periodic_orbit(jc.ideal_scene(30.0))
    rows = sheet(orbit, 1)
    assert {row.part for row in rows} == {"static loads", "harmonics", "peaks"}
    named = by_name(rows)
    assert not any("support" in name for name, _ in named)
    # The load and its reaction cancel, which rounding does not quite.
    assert named["force, horizontally", "static"].value == 0.0
    still = named["force, vertically", "static"]
    assert still.remark == "without the frame" and still.value == pytest.approx(-9.81e-3 * 641)
    framed = by_name(sheet(orbit, 1, Site(frame_mass=1e3)))["force, vertically", "static"]
    with pytest.raises(ValueError, match="`orders` must be less than 512, but is 512"):
        sheet(orbit, 512)
    assert framed.remark == "with the frame of 1000 kg"
    assert framed.value == pytest.approx(-9.81e-3 * 1641)


@pytest.mark.parametrize(
    ("name", "about", "bearing"),
    [
        ("slider_crank", "the frame's origin", "K"),
        ("pe250x400", "C", "O"),
    ],
)
def test_moments_are_named_by_points_that_there_are(name, about, bearing, tmp_path):
    text = (EXAMPLES / f"{name}.toml").read_text()
    (tmp_path / "mine.toml").write_text(text.replace("joints.O", "joints.K"))
    scene = read_scene(tmp_path / "mine.toml")
    values = {"ground_force": np.ones((1, 8, 2)), "ground_moment": np.ones((1, 8))}
    names = {row.name for row in sheet(Turns(scene, 1, values), 1)}
    moments = {f"about {about}", f"at the shaft's level, about {bearing}"}
    assert {one for one in names if one.startswith("moment")} == {f"moment {n}" for n in moments}


def test_the_title_says_the_state_of_each_joint():
    ideal = joint_states(jc.ideal_scene(30.0))
    named = "main bearing A", "elbow B", "pivot C", "shaft bearing O"
    assert ideal == ", ".join(f"{name} is ideal" for name in named)
    worn = {"clearance": 6e-5, "elbow.clearance": 2e-5}
    assert joint_states(jc.build_scene(worn)).startswith(
        "main bearing A has a radial clearance of 0.06 mm, elbow B has a radial clearance of 0.02"
    )
    rolls = joint_states(jc.build_scene({"contact_law": "rollers"}))
    assert rolls.startswith("main bearing A has rollers and a radial clearance of ")


# ISO 10816-3:2009, tables A.1 and A.2, copied a second time.
@pytest.mark.parametrize(
    ("group", "kind", "quantity", "edges"),
    [
        (2, "rigid", "velocity", (1.4, 2.8, 4.5)),
        (2, "flexible", "velocity", (2.3, 4.5, 7.1)),
        (2, "rigid", "displacement", (22, 45, 71)),
        (2, "flexible", "displacement", (37, 71, 113)),
        (1, "rigid", "velocity", (2.3, 4.5, 7.1)),
        (1, "flexible", "velocity", (3.5, 7.1, 11)),
        (1, "rigid", "displacement", (29, 57, 90)),
        (1, "flexible", "displacement", (45, 90, 140)),
    ],
)
def test_zones_are_those_of_the_standard(group, kind, quantity, edges):
    """A zone ends where the next one begins, to a thousandth."""
    for edge, (below, above) in zip(edges, itertools.pairwise("ABCD"), strict=True):
        assert zone(kind, quantity, 0.999 * edge, group) == below
        assert zone(kind, quantity, 1.001 * edge, group) == above
    assert ZONES[group].keys() == {"rigid", "flexible"}


def test_what_decides_a_zone_is_nearest_to_its_end():
    """4.49 of 4.5 mm/s, and not 46 of 71 um, which is the larger number."""
    scene = jc.build_scene({"foundation.mass": 6e3, "joint": "ideal"})
    kind = "zone B, flexible support"
    rows = [
        Row("motion", "displacement of G, vertically", "RMS", 46.0, "um", remark=kind),
        Row("motion", "velocity of G, vertically", "RMS", 4.49, "mm/s", remark=kind),
    ]
    worst, *_ = _verdicts(scene, rows, [], Site())
    assert "decided by the RMS velocity of G, vertically" in worst.remark
    assert share("rigid", "velocity", 9.0) == 2.0 and share("rigid", "velocity", 0.7) == 0.5


@pytest.mark.parametrize("value", [np.nan, -1.0, np.inf])
def test_what_is_no_rms_has_no_zone(value):
    with pytest.raises(ValueError, match="`value` must be an RMS, finite and >= 0, but is"):
        zone("rigid", "velocity", value)
    with pytest.raises(ValueError, match="`kind` must be one of 'rigid', 'flexible'"):
        zone("soft", "velocity", 1.0)
