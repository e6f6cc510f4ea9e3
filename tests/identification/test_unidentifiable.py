"""What data cannot tell is said, and what would tell it is found."""

import numpy as np
import pytest

from jaxcrusher.commands.identify import draw
from jaxcrusher.identification.identify import identify
from jaxcrusher.identification.measurements import Measurement
from jaxcrusher.scenes.build import paper_machine
from tests.identification import by_hand

MACHINE = paper_machine(**by_hand.CRUSHER)
SHAKING = ("ground_force_x", "ground_force_y")
FREE = {"shaft.mass": 90.0, "shaft.mass_centre_radius": 0.0065, "jaw.inertia": 120.0}


@pytest.fixture(scope="module")
def found():
    """First and second harmonics of the force, which only the shaft's unbalance enters."""
    rng, rows = np.random.default_rng(4), []
    for speed in (20.0, 30.0):
        exact = by_hand.crusher({}, speed)
        for quantity in SHAKING:
            for order in (1, 2):
                value = exact[quantity][order] + 20 * complex(*rng.standard_normal(2))
                rows.append(
                    Measurement(speed, quantity, order, abs(value), 20.0, float(np.angle(value)))
                )
    return identify(MACHINE.replace(**FREE), rows, [*FREE], starts=2)


def test_directions_that_cannot_be_told_are_named(found):
    alone, together = sorted(found.unidentifiable, key=lambda one: len(one.changes))
    # No force depends on the inertia, or on the shares of a product.
    assert list(alone.changes) == ["jaw.inertia"] and alone.sigmas < 1e-6
    assert set(together.changes) == {"shaft.mass", "shaft.mass_centre_radius"}
    shares = [together.changes[name] / FREE[name] for name in together.changes]
    assert np.max(np.abs(shares)) == pytest.approx(0.1)
    # The product stands still, to first order in a tenth, at a start that is 2.6 % off.
    assert sum(shares) == pytest.approx(0, abs=0.005) and together.sigmas < 1e-6
    text = str(found)
    assert "Cannot be told: a change of jaw.inertia by 12 kg m2 moves no measured number by" in text
    assert "and shaft.mass_centre_radius by" in text and "(its start: unknown)" in text


def test_what_cannot_be_told_stays_near_its_start(found):
    assert found.values["jaw.inertia"] == pytest.approx(FREE["jaw.inertia"], rel=1e-6)
    # 20 N of 95 kg * 6 mm * (30 rad/s)^2 = 513 N, eight times in four parts.
    product = found.values["shaft.mass"] * found.values["shaft.mass_centre_radius"]
    assert product == pytest.approx(95.0 * 0.006, rel=0.1)
    assert found.standard_deviations["jaw.inertia"] > 1e3


def test_a_picture_of_what_cannot_be_told_is_drawn(found, tmp_path):
    """Without the numbers that have no standard deviation."""
    draw(found, FREE, {}, tmp_path / "identified.png")
    assert (tmp_path / "identified.png").exists()


def test_the_further_measurement_that_tells_most(found):
    best, *others = found.optimal_experiments(
        noise={"ground_moment": 5.0, "ground_force": 20.0}, orders=2
    )
    assert best.quantity == "ground_moment" and best.order == 1 and best.speed == 30.0
    # Its share of the weight tells the shaft's mass, and by the product its radius.
    (weight,) = others
    assert weight.quantity == "ground_force_y" and weight.order == 0 and best.gain > weight.gain
    spread = weight.standard_deviations
    assert spread["shaft.mass"] == pytest.approx(20 / 9.81, rel=0.01)
    assert spread["shaft.mass_centre_radius"] < 0.05 * 0.006
    # Of 5 N m in 128 kg m2 times the swing: by hand, from a change of 1 kg m2.
    swing = [by_hand.crusher({"jaw.inertia": i}, 30.0)["ground_moment"][1] for i in (128.0, 129.0)]
    alone = 5.0 / abs(swing[1] - swing[0])
    # The moment has two parts and two numbers that it does not know: these cost precision.
    assert alone < best.standard_deviations["jaw.inertia"] < 2 * alone


def test_what_tells_most_can_be_measured(found):
    """Of a clamped machine: its motor, the cap of the main bearing, the force on the ground."""
    caps = ("main_cap_velocity", "main_cap_acceleration")
    sensors = {"drive_torque", "drive_power", *caps, "ground_force", "ground_moment"}
    offered = [
        found.problem.quantities.observable(one.quantity)
        for one in found.optimal_experiments(orders=2)
    ]
    assert sorted(offered) == sorted(sensors)
    with pytest.raises(ValueError, match="`noise` must be a known name, but is 'ground_momen'"):
        found.optimal_experiments(noise={"ground_momen": 1.0})


@pytest.mark.parametrize("noise", [-0.01, np.nan, 0.0, {"ground_moment": -5.0}])
def test_a_further_measurement_scatters(found, noise):
    with pytest.raises(ValueError, match=r"^Argument `noise` must be finite and > 0"):
        found.optimal_experiments(noise=noise)


def test_numbers_that_cannot_be_told_take_no_degree_of_freedom(found):
    """Sixteen parts and one product of numbers: chi-squares of draws are 15 in the mean."""
    assert found.freedom == 16 - 1


def test_a_prior_tells_what_the_data_do_not(found):
    priors = {"jaw.inertia": (130.0, 5.0), "shaft.mass": (95.0, 1.0)}
    known = identify(MACHINE.replace(**FREE), found.measured, [*FREE], starts=1, priors=priors)
    assert known.values["jaw.inertia"] == pytest.approx(130.0)
    assert known.standard_deviations["jaw.inertia"] == pytest.approx(5.0)
    assert known.standard_deviations["shaft.mass"] == pytest.approx(1.0, rel=0.01)
    assert known.freedom == 16 + 2 - 3
    # The data alone still do not.
    assert len(known.unidentifiable) == 2


def test_a_wrong_model_is_seen(found):
    rows = [
        Measurement(one.speed, one.quantity, one.order, 1.3 * one.amplitude, one.sigma, one.phase)
        for one in found.measured
    ]
    wrong = identify(MACHINE.replace(**FREE), rows, [*FREE], starts=2)
    assert wrong.chance < 1e-3 and "The data scatter more than their sigmas say" in str(wrong)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"free": "jaw.mass"}, "`free` must name numbers but the speed, each once"),
        ({"free": ["speed"]}, "`free` must name numbers but the speed, each once"),
        (
            {"free": ["jaw.mas"]},
            r"`jaw.mas` must be a known name, but is not \(is 'jaw.mass' meant",
        ),
        ({"free": {"jaw.mass": -1.0}}, "`jaw.mass` must be finite and > 0 kg"),
        (
            {"free": {"fluctuation_order": 2.0}},
            "`free` must name numbers that may vary continuously",
        ),
        ({"measured": []}, "`measured` must hold a measurement"),
        ({"priors": {"jaw.mass": (1.0, 0.0)}}, r"`priors\['jaw.mass'\]` must be finite and > 0"),
        ({"priors": {"shaft.mass": (1.0, 1.0)}}, "`priors` must name free numbers, jaw.mass"),
        ({"starts": 0}, "`starts` must be a whole number >= 1"),
        ({"quantity": "ground_forc_x"}, "`quantity` must be a known name, but is 'ground_forc_x'"),
        ({"quantity": "?"}, "`quantity` must be one of 'drive_torque', .*'ground_moment', but is"),
        ({"quantity": "ground_force"}, "`quantity` must have a direction, as ground_force_x, gr"),
        ({"order": "", "phase": np.nan}, '`order` must suit ground_force: "" of a statistic'),
        ({"order": 1.5}, "`order` must be a whole number from 0 to 100"),
        ({"sigma": 0.0}, "`sigma` must be finite and > 0"),
        ({"order": 0}, "`phase` must belong to a harmonic"),
        ({"phase": np.inf}, "`phase` must be finite, or NaN, but is inf"),
        ({"amplitude": -1.0, "phase": np.nan}, "`amplitude` must be >= 0 of an RMS or without"),
        ({"amplitude": -1.0, "phase": np.nan, "order": "rms"}, "`amplitude` must be >= 0 of an R"),
        (
            {"priors": {"jaw.mass": (np.nan, 1.0)}},
            r"`priors\['jaw.mass'\]` must have a finite mean",
        ),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_refused(change, words):
    row = {"speed": 30.0, "quantity": "ground_force_x", "order": 1, "amplitude": 1.0}
    row |= {"sigma": 1.0, "phase": 0.0}
    asked = {"free": ["jaw.mass"]}
    for name, value in change.items():
        (row if name in row else asked)[name] = value
    with pytest.raises(ValueError, match=words):
        measured = asked.pop("measured", None)
        measured = [Measurement(**row)] if measured is None else measured
        identify(MACHINE, measured, **asked)


def test_a_number_at_its_limit_has_no_error_and_the_others_hold_with_it_there():
    """Its unbalance lies on the other side, which a radius cannot say: the best is none."""
    opposite = {"shaft.mass_centre_radius": 0.002, "shaft.mass_centre_angle": np.radians(210.0)}
    rows = []
    for name in SHAKING:
        value = by_hand.crusher(opposite, 30.0)[name][1]
        rows.append(Measurement(30.0, name, 1, abs(value), 20.0, float(np.angle(value))))
    begin = {"shaft.mass_centre_radius": 0.006, "jaw.mass": 520.0}
    both = identify(MACHINE, rows, begin, starts=1)
    held = MACHINE.replace(**{"shaft.mass_centre_radius": 0.0})
    alone = identify(held, rows, {"jaw.mass": 520.0}, starts=1)
    assert np.isnan(both.standard_deviations["shaft.mass_centre_radius"])
    # Fits end where their sums change by 1e-10.
    for found in ("values", "standard_deviations"):
        pair = (getattr(one, found)["jaw.mass"] for one in (both, alone))
        np.testing.assert_allclose(*pair, rtol=1e-4)
    assert both.freedom == alone.freedom == 3
    text = str(both)
    assert "mm (at its limit)" in text and "correlation" not in text and "not linear" not in text


def test_errors_that_reach_past_a_limit_are_rough():
    """An angle that its prior alone tells is beyond a turn, two deviations away."""
    rows = [Measurement(30.0, "ground_force_x", 1, 1e4, 1e9)]
    priors = {"shaft.mass_centre_angle": (6.0, 0.3)}
    begin = {"shaft.mass_centre_angle": 6.0}
    found = identify(MACHINE, rows, begin, priors=priors, starts=1)
    assert found.remarks == [
        "2 standard deviations away there is no such machine, or none with a periodic orbit. "
        "Standard deviations are rough."
    ]
