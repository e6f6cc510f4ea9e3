"""Numbers found from data of two programs by hand: how often they are as near as they say."""

import numpy as np
import pytest
from scipy.stats import chi2

import jaxcrusher as jc
from jaxcrusher.identification.identify import identify
from jaxcrusher.identification.measurements import Measurement
from tests.identification import by_hand

pytestmark = pytest.mark.filterwarnings("ignore::jaxcrusher.basics.setup.UnusualNumbers")
OF_BLOCK = ("frame_displacement_x", "frame_displacement_y", "frame_rotation")
SPEEDS = (20.0, 33.0, 60.0)
# The block moves by the first harmonic alone, and a crusher of ideal joints needs no nodes.
NODES = 16
STIFFNESS = "foundation.vertical_stiffness"
# To be found of the block, and where the search begins.
FREE = {STIFFNESS: 4e6, "foundation.horizontal_stiffness": 1.5e6, "foundation.mass": 6e3}
OF_CRUSHER = {"jaw.mass": 600.0, "jaw.inertia": 100.0, "shaft.mass_centre_radius": 0.01}


def noisy(exact, rng, noise=0.02, phases=True):
    """What is measured of harmonics (speed, quantity, order) -> A e^(i phi), in order."""
    found = []
    for (speed, quantity, order), value in exact.items():
        sigma = noise * abs(value)
        value = value + sigma * complex(*rng.standard_normal(2))
        phase = float(np.angle(value)) if phases else np.nan
        found.append(Measurement(speed, quantity, order, float(abs(value)), sigma, phase))
    return found


def of_block(values):
    return {
        (speed, quantity, 1): value
        for speed in SPEEDS
        for quantity, value in zip(OF_BLOCK, by_hand.block(values, speed), strict=True)
    }


def of_crusher(values):
    return {
        (speed, quantity, order): spectrum[order]
        for speed in (20.0, 30.0)
        for quantity, spectrum in by_hand.crusher(values, speed).items()
        for order in (1, 2)
    }


MACHINES = {
    "block": (by_hand.BLOCK, of_block(by_hand.BLOCK), FREE),
    "crusher": (by_hand.CRUSHER, of_crusher({}), OF_CRUSHER),
}


def truth(name, free):
    return np.array([(by_hand.LINKS | MACHINES[name][0])[number] for number in free])


@pytest.mark.slow  # 27 s of a slow processor
@pytest.mark.parametrize("name", MACHINES)
def test_exact_data_give_back_the_numbers(name):
    machine, exact, free = MACHINES[name]
    rows = noisy(exact, np.random.default_rng(0), 1e-9)
    found = identify(jc.paper_machine(**machine | free), rows, [*free], starts=1, nodes=NODES)
    # The block's model is linear to 1e-6 of its motion, and links of 1e-9 kg count 1e-7.
    np.testing.assert_allclose([*found.values.values()], truth(name, free), rtol=1e-5)
    assert not found.unidentifiable
    # The inverse of the normal equations' matrix, in deviations; rounding by its condition.
    sizes = np.array([*free.values()])
    _, slopes = found.problem.at(np.array([*found.values.values()]) / sizes)
    normal = slopes.T @ slopes / np.outer(sizes, sizes)
    deviations = np.sqrt(np.diag(found.covariance))
    scaled = np.outer(deviations, deviations)
    rounding = 1e-14 * np.linalg.cond(normal * scaled)
    np.testing.assert_allclose(
        found.covariance / scaled, np.linalg.inv(normal * scaled), atol=rounding, rtol=0
    )


def test_means_rms_values_and_statistics_tell_as_well():
    """Of a machine by a function, from none of its harmonics."""

    def machine(**numbers):
        return jc.build_scene(
            {"joint": "ideal", **{n.replace("_of_", "."): numbers[n] for n in numbers}}
        )

    rows = []
    for speed in (20.0, 30.0):
        spectra = by_hand.crusher({}, speed)
        rms = {name: np.linalg.norm(one[1:]) / np.sqrt(2) for name, one in spectra.items()}
        shaking = np.hypot(rms["ground_force_x"], rms["ground_force_y"])
        for quantity, order, value in (
            ("ground_moment", 0, spectra["ground_moment"][0].real / 2),
            ("ground_force_y", "rms", rms["ground_force_y"]),
            ("shaking_rms", "", shaking),
        ):
            rows.append(Measurement(speed, quantity, order, float(value), 1e-6 * abs(float(value))))
    found = identify(machine, rows, {"jaw_of_mass": 550.0, "shaft_of_mass": 90.0}, starts=1)
    # Both programs round to 1e-12, and 1024 instants are enough.
    np.testing.assert_allclose([*found.values.values()], [524.0, 95.0], rtol=1e-8)
    assert found.chi_square < 1e-6 and found.freedom == 4


def coverage(name, draws):
    """How many draws have the truth in their ellipse of 95 %, and in each of their intervals.

    They begin near the truth; that others come to the same is for exact data.
    """
    machine, exact, free = MACHINES[name]
    right, names = truth(name, free), [*free]
    free = dict(zip(names, 1.02 * right, strict=True))
    inside, within, sums = 0, np.zeros(len(free)), []
    for seed in range(draws):
        data = noisy(exact, np.random.default_rng(seed))
        found = identify(jc.paper_machine(**machine | free), data, names, starts=1, nodes=NODES)
        off = np.array([*found.values.values()]) - right
        inside += off @ np.linalg.solve(found.covariance, off) <= chi2.ppf(0.95, len(off))
        within += np.abs(off) <= 1.96 * np.sqrt(np.diag(found.covariance))
        sums.append(found.chi_square)
        # The sum of squares is least: at the start its slopes are some 1e4.
        residuals, slopes = found.problem.at(np.array([*found.values.values()]) / [*free.values()])
        assert np.abs(slopes.T @ residuals).max() < 5e-3
    return inside, within, np.mean(sums), found.freedom


@pytest.mark.parametrize("phases", [True, False])
def test_errors_that_are_not_linear_are_said(phases):
    """Amplitudes near a resonance bend: of 200 such draws 169 lie in their ellipse of 95 %."""
    rows = noisy(MACHINES["block"][1], np.random.default_rng(1), phases=phases)
    found = identify(jc.paper_machine(**by_hand.BLOCK | FREE), rows, [*FREE], starts=1, nodes=NODES)
    assert ("The errors are not linear: 2 standard" in str(found)) != phases


def test_few_draws_are_covered():
    inside, _, mean, freedom = coverage("crusher", 12)
    # Of 12 draws at 95 % fewer than 9 are inside in one case of 500.
    assert inside >= 9
    # Means of 12 chi-squares scatter by sqrt(2 n / 12): four times that.
    assert mean == pytest.approx(freedom, abs=4 * np.sqrt(2 * freedom / 12))


@pytest.mark.slow
def test_coverage_of_many_draws():
    inside, within, mean, freedom = coverage("crusher", 100)
    # 95 of 100, and three standard deviations of a count: sqrt(100 * 0.95 * 0.05) = 2.2.
    for count in (inside, *within):
        assert abs(count - 95) <= 6
    assert mean == pytest.approx(freedom, abs=4 * np.sqrt(2 * freedom / 100))
