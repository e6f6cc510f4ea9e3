"""Files of measurements, and harmonics of time series with their scatter."""

import jax
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.identification.measurements import Measurement, of_series, read_measured, taken
from jaxcrusher.identification.model import quantities_of

BLOCK = {"joint": "ideal", "foundation.mass": 6000.0, "foundation.x": 0.3, "foundation.y": 0.2}
unit_of = quantities_of(jc.build_scene(BLOCK)).unit_of
FIVE_TURNS = "\n".join(f"{k / 30}, {30 * k}, 1" for k in range(70))
TABLE = """speed_rpm, quantity, order, amplitude, phase_deg, sigma, unit
286, frame_velocity_y, 1, 1.31, 84, 0.02, mm/s

300, frame_velocity_y, rms, 0.95, , 0.02, mm/s
286, foundation_rms, , 19.1, , 0.1, kN
286, frame_rotation, 2, 3e-6, 10, 1e-7,
"""


def test_a_table(tmp_path):
    (tmp_path / "measured.csv").write_text(TABLE)
    one, rms, whole, bare = read_measured(tmp_path / "measured.csv", unit_of)
    assert one.quantity == "frame_velocity_y" and one.order == 1
    for found, exact in (
        (one.speed, 286 * np.pi / 30),
        (one.amplitude, 1.31e-3),
        (one.sigma, 2e-5),
        (one.phase, np.radians(84)),
        (rms.amplitude, 0.95e-3),
        (whole.amplitude, 19.1e3),
        (bare.amplitude, 3e-6),
    ):
        assert found == pytest.approx(exact, rel=1e-14)
    assert rms.order == "rms" and whole.order == "" and not rms.has_phase and bare.order == 2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "must have the columns amplitude, order, quantity, sigma, speed, or time and angle"),
        ("speed, quantity\n", "must have the columns"),
        (TABLE.replace("unit", "units"), "have no columns but amplitude, .*, each once, but is"),
        (TABLE.replace("phase_deg", "phase_rad"), "each once, but is with speed_rpm, .*phase_rad"),
        (TABLE.replace("unit", "speed"), "must have no columns but amplitude"),
        ("time, angle, angle_deg\n", "quantities, each once, but is with time, angle, ang"),
        (TABLE.replace(",", ";"), "measured.csv: has semicolons between its cells: write commas"),
        (TABLE.replace("mm/s", "mm"), "line 2: column `unit` must have a unit of the kind m/s"),
        (
            TABLE.replace("1.31", "fast"),
            r"measured\.csv, line 2: column `amplitude` must be a finite number, but is 'fast'\.$",
        ),
        (
            TABLE.replace("1.31", "1_31"),
            "line 2: column `amplitude` must be a fin.*, but is '1_31'",
        ),
        (
            TABLE.replace("300", "-300"),
            "line 4: column `speed_rpm` must be finite and > 0.* -300.0",
        ),
        (
            TABLE.replace("84", "east"),
            "line 2: column `phase_deg` must be a finite .* but is 'east'",
        ),
        (
            TABLE.replace("y, 1", "y, 1.5"),
            "line 2: column `order` must be a whole .*, but is '1.5'",
        ),
        (
            TABLE.replace("19.1", ""),
            "line 5: column `amplitude` must be a finite number, but is ''",
        ),
        (TABLE.replace("y, rms", "y, "), 'line 4: column `order` must suit frame_velocity: "" of'),
        (TABLE.replace("_y, 1", ", 1"), "line 2: column `quantity` must have a direction, as fra"),
        ("time, angle\n0, 1\n1, 2_0\n", "line 3: column `angle` must be a fin.*, but is '2_0'"),
        (
            "time, angle_deg, frame_velocity_y (kN)\n" + FIVE_TURNS,
            r"csv: Argument `frame_velocity_y \(kN\)` must have a unit of the kind m/s, but",
        ),
        (
            TABLE.replace("84, ", ""),
            "line 2` must have 7 cells, one of each column, but is with 6",
        ),
        (
            TABLE.replace("frame_velocity_y", "velocity"),
            "line 2: column `quantity` must be a known name, but is 'velocity' .is 'jaw_vel",
        ),
        ("time, angle\n0, 1\n1, 2\n", "measured.csv: .*`angle` must go through 5 whole turns, but"),
        ("time, angle\n0, 1\nnan, 2\n", "line 3: column `time` must be a finite number"),
        (None, r"measured\.csv: cannot be read: No such file or directory\.$"),
    ],
)
def test_files_that_are_refused(text, words, tmp_path):
    path = tmp_path / "measured.csv"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ValueError, match=words):
        read_measured(path, unit_of)


def test_a_series_has_harmonics_with_their_scatter():
    """White noise of deviation s in n instants scatters a harmonic's parts by s sqrt(2 / n)."""
    rng, speed, noise = np.random.default_rng(1), 31.0, 0.3
    time = np.sort(rng.uniform(0, 40.2 * 2 * np.pi / speed, 40_000))
    angle = speed * time + 0.5
    exact = np.array([2 * np.exp(0.7j), 0.5 * np.exp(-2j)])
    values = 5 + sum((a * np.exp(1j * k * angle)).real for k, a in enumerate(exact, 1))
    values = values + noise * rng.standard_normal(time.size)
    columns = {"time": time, "angle": angle % (2 * np.pi), "frame_velocity_y (mm/s)": values}
    found = of_series(columns, unit_of, 2)
    assert [one.order for one in found] == [1, 2]
    assert found[0].speed == pytest.approx(speed, rel=1e-9)
    off = 1e3 * np.array([one.amplitude * np.exp(1j * one.phase) for one in found]) - exact
    sigma = noise * np.sqrt(2 / 39_800)
    # A deviation of two parts of 40 turns scatters by 8 % of itself: four times that.
    assert [1e3 * one.sigma for one in found] == pytest.approx([sigma, sigma], rel=0.32)
    assert np.abs([off.real, off.imag]).max() < 4 * sigma


def test_harmonics_of_five_turns_are_as_far_off_as_they_say():
    """The mean square in sigmas is 1: that of Student's 8 degrees of freedom alone is 8 / 6."""
    rng, angle = np.random.default_rng(2), np.arange(501) * 2 * np.pi / 100
    columns = {"time": angle / 30, "angle": angle}
    columns |= {f"v{i}": rng.standard_normal(angle.size) for i in range(200)}
    found = of_series(columns, lambda *_: "1", 4)
    off = [one.amplitude * np.exp(1j * one.phase) / one.sigma for one in found]
    # Of two parts it scatters by sqrt(2) of itself, and there are 800 pairs: four times that.
    assert np.mean(np.square([np.real(off), np.imag(off)])) == pytest.approx(1, abs=0.2)


@pytest.mark.parametrize("start", [0.0, 1.3, 1.8, 2.3])
def test_five_turns_are_five_from_whatever_angle(start):
    angle = np.radians((np.degrees(start) + np.linspace(0, 5 * 360, 401)) % 360)
    columns = {
        "time": np.linspace(0, np.pi / 3, 401),
        "angle": angle,
        "frame_velocity_y": np.cos(angle),
    }
    assert of_series(columns, unit_of, 1)[0].amplitude == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("begin", [0.0, 0.3])
def test_a_series_of_an_uneven_shaft_has_the_harmonics_of_its_orbit(begin):
    """Those of the phase, omega t, which the shaft's angle is at whole turns alone."""
    uneven = {"speed_fluctuation": 0.1, "fluctuation_phase": 0.8}
    scene = jc.build_scene(BLOCK | uneven | {"speed": 10.0})
    time = np.linspace(begin, begin + 0.2 * np.pi * 6.4, 6401)
    angle = np.asarray(jax.vmap(scene.drive.motion)(time)[0])
    values = np.cos(10 * time + 0.3) + 0.2 * np.cos(20 * time - 1)
    columns = {"time": time, "angle": angle % (2 * np.pi), "frame_rotation": values}
    first, second = of_series(columns, unit_of, 2, quantities_of(scene).phase)
    # Between 1024 angles of a turn straight lines are off by 5e-7 of it.
    for one, size, phase in ((first, 1, 0.3), (second, 0.2, -1)):
        assert one.amplitude == pytest.approx(size, rel=1e-5)
        assert one.phase == pytest.approx(phase, abs=1e-5)
    assert first.speed == pytest.approx(10.0, rel=1e-7)


@pytest.mark.parametrize("missing", [0.6, 0.98, 3.2])
def test_a_gap_over_which_turns_cannot_be_counted_is_refused(missing):
    """It made the speed 30 - 4.8 rad/s; a gap of less than half a turn leaves all as it is."""
    time = np.linspace(0, 20 * 2 * np.pi / 30, 4001)

    def seen(gap, order=slice(None)):
        kept = (30 * time < 20) | (30 * time > 20 + 2 * np.pi * gap)
        at = time[kept][order]
        angle = 30 * at
        columns = {"time": at, "angle": angle % (2 * np.pi), "frame_velocity_y": np.cos(angle)}
        return of_series(columns, unit_of, 1)[0]

    assert seen(0.45).speed == pytest.approx(30, rel=1e-12)
    with pytest.raises(ValueError, match=r"`angle` must go on .* with a gap after 0.666"):
        seen(missing)
    with pytest.raises(ValueError, match="`time` must not fall from row to row"):
        seen(0.0, [*range(2000), *range(1000, 4000)])


def test_a_series_in_a_file(tmp_path):
    angle = np.linspace(0, 6.5 * 2 * np.pi, 400)
    rows = zip(angle / 30, np.degrees(angle), np.cos(angle + 1), strict=True)
    text = "\n".join(", ".join(map(repr, map(float, row))) for row in rows)
    path = tmp_path / "series.csv"
    path.write_text("time, angle_deg, ground_force_x (kN)\n" + text)
    # A pure cosine does not scatter. A turn has at least 61 instants, of which order 60 folds.
    (one,) = read_measured(path, unit_of, 1)
    assert one.quantity == "ground_force_x" and one.speed == pytest.approx(30.0)
    assert one.amplitude == pytest.approx(1e3) and one.phase == pytest.approx(1.0)
    # The half turn at the end moves the mean by 0.05.
    assert one.sigma == pytest.approx(1e3 / 60**2, rel=0.05**2)
    with pytest.raises(ValueError, match=r"`orders` must be .* lower ones, but is 15 of 61 insta"):
        read_measured(path, unit_of, 15)


def test_orders_that_fold_are_told_or_refused():
    """Of 8 instants a turn cos(7 theta) is cos(theta), and no turn scatters by it."""

    def seen(instants, orders):
        angle = np.arange(10 * instants + 1) * 2 * np.pi / instants
        columns = {"time": angle / 30, "angle": angle}
        columns["v"] = np.cos(angle) + 0.5 * np.cos(7 * angle)
        return of_series(columns, lambda *_: "1", orders)

    with pytest.raises(ValueError, match=r"`orders` must be less than a quarter of a turn's inst"):
        seen(8, 3)
    # It folds onto 1 of every second instant, and of all it does not: 0.5, in two parts.
    first, second, _ = seen(16, 3)
    assert first.amplitude == pytest.approx(1.0, rel=1e-12)
    assert first.sigma == pytest.approx(0.5 / np.sqrt(2), rel=1e-12)
    # Orders 14 and 15, if they were as a square falls from the whole.
    assert second.sigma == pytest.approx(np.hypot(1, 0.5) / 14**2, rel=1e-2)


def test_a_mean_has_no_phase():
    with pytest.raises(ValueError, match="`phase` must belong to a harmonic"):
        Measurement(30.0, "ground_force_y", 0, 1.0, 1.0, 0.3)


def test_an_order_may_be_a_whole_number_of_numpy(unchecked):
    one = Measurement(30.0, "ground_force_y", np.int64(1), 1.0, 1.0)
    assert one.is_harmonic and type(one.order) is int
    with pytest.raises(ValueError, match="`order` must be a whole number from 0 to 100"):
        Measurement(30.0, "ground_force_y", np.int64(-1), 1.0, 1.0)


@pytest.mark.parametrize("orders", [0, -1])
def test_orders_are_refused_before_files_are_read(orders):
    with pytest.raises(ValueError, match="`orders` must be a whole number >= 1, but is"):
        taken("none.csv", unit_of, orders)
