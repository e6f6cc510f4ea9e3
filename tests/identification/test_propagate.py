"""Tolerances against differences by hand, and where linear is not enough."""

import math
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.identification import model
from jaxcrusher.identification.model import What, _predicted
from jaxcrusher.motion.turns import Turns
from jaxcrusher.orbits.result import RESULTS, missing
from tests.differences import differences
from tests.identification import by_hand

MACHINE = jc.paper_machine(**by_hand.CRUSHER)
SIGMAS = {"jaw.mass": 10.0, "shaft.mass_centre_angle": 0.05, "jaw.inertia": 3.0}


@pytest.mark.usefixtures("unchecked")  # a curve in place of an orbit
def test_harmonics_are_over_all_turns_of_a_period(monkeypatch):
    """Of cos(theta / 2) + 3 cos(theta + 0.4) over two turns; one turn would mix them."""
    angles = 2 * np.pi * jnp.arange(2048.0) / 1024
    curve = jnp.cos(angles / 2) + 3 * jnp.cos(angles + 0.4)
    scene = SimpleNamespace(observables={"force": SimpleNamespace(unit="N")})
    turns = Turns(scene, 2, {"force": curve[None]})
    monkeypatch.setattr(model, "turns_of", lambda orbit, entries: turns)
    orbit = SimpleNamespace(scene=scene, stable=True)
    mean, first, second, rms = _predicted(orbit, What(("force",), 2, ())).spectra["force"]
    np.testing.assert_allclose([mean, first, second], [0, 3 * np.exp(0.4j), 0], atol=1e-13)
    assert float(abs(rms)) == pytest.approx(np.sqrt((1 + 9) / 2), rel=1e-13)


@pytest.fixture(scope="module")
def orbit():
    return jc.periodic_orbit(MACHINE.scene())


@pytest.fixture(scope="module")
def found(orbit):
    outputs, observables = ("shaking_rms",), ("ground_force", "ground_moment")
    return jc.propagate(MACHINE, orbit, SIGMAS, outputs=outputs, observables=observables)


def test_deviations_and_shares_are_those_of_differences(found):
    def seen(name, change):
        spectra = by_hand.crusher({name: by_hand.LINKS[name] + change}, 30.0)
        return {
            f"{quantity}, order {k}": abs(spectrum[k])
            for quantity, spectrum in spectra.items()
            for k in (1, 2)
        }

    middle = seen("jaw.mass", 0.0)
    assert set(found["quantity"].values) == {"shaking_rms", *middle}
    parts = {}
    for name, sigma in SIGMAS.items():
        ahead, behind = seen(name, 1e-3 * sigma), seen(name, -1e-3 * sigma)
        parts[name] = {q: (ahead[q] - behind[q]) / 2e-3 for q in middle}
    for quantity, value in middle.items():
        one = found.sel(quantity=quantity)
        changes = np.array([parts[name][quantity] for name in SIGMAS])
        # Differences of 1e-3 sigma have errors of 1e-6 of what is not linear, and of rounding.
        assert float(one.value) == pytest.approx(value, rel=1e-9)
        assert float(one.standard_deviation) == pytest.approx(np.linalg.norm(changes), rel=1e-5)
        shares = changes**2 / np.sum(changes**2)
        np.testing.assert_allclose(one.share, shares, atol=1e-5)


def test_drawn_machines_scatter_as_said(found):
    rng, drawn = np.random.default_rng(0), {}
    for _ in range(400):
        values = {n: by_hand.LINKS[n] + s * rng.standard_normal() for n, s in SIGMAS.items()}
        for quantity, spectrum in by_hand.crusher(values, 30.0).items():
            for order in (1, 2):
                drawn.setdefault(f"{quantity}, order {order}", []).append(abs(spectrum[order]))
    scatter = [np.std(values, ddof=1) for values in drawn.values()]
    # A deviation of 400 draws scatters by 3.5 % of itself: four times that.
    np.testing.assert_allclose(found.second_order.sel(quantity=[*drawn]), scatter, rtol=0.14)
    assert bool(found.linear.sel(quantity="ground_force_y, order 1"))


def test_what_is_not_linear_is_said():
    """An angle of the mass centre at which the force is least has no slope, but a bend."""

    def function(shift):
        # The length of a force is quadratic in a part at right angles to it.
        return jc.build_scene({"joint": "ideal", "shaft.mass_centre_angle": shift})

    angles = np.linspace(-3, 3, 601)
    sizes = [
        by_hand.crusher({"shaft.mass_centre_angle": a}, 30.0)["ground_force_x"][1] for a in angles
    ]
    least = float(angles[np.argmin(np.abs(sizes))])
    orbit, only = jc.periodic_orbit(function(least)), {"outputs": (), "orders": 1}
    found = jc.propagate(
        function, orbit, {"shift": (least, 0.3)}, observables=("ground_force",), **only
    ).sel(quantity="ground_force_x, order 1")
    assert not bool(found.linear)

    def size(a):
        return abs(by_hand.crusher({"shaft.mass_centre_angle": a}, 30.0)["ground_force_x"][1])

    step = np.sqrt(3) * 0.3
    bend = ((size(least + step) + size(least - step)) / 2 - size(least)) / 3
    assert float(found["shift"]) == pytest.approx(bend, rel=1e-9) and bend > 0
    # The mean slope is not that at the least force, but of third order.
    deviation = np.hypot(float(found.standard_deviation), np.sqrt(2) * bend)
    assert float(found.second_order) == pytest.approx(deviation, rel=2e-2)


def of_load(factor, names, middle, sigma):
    """The scatter of a force that is all but proportional to a load, by a factor of it."""

    def function(**numbers):
        values = {"joint": "ideal", "gravity": 0.0, "speed": 0.5}
        return jc.build_scene(values | {"load": 8800 * factor(numbers.values())})

    orbit = jc.periodic_orbit(function(**dict.fromkeys(names, middle)))
    sigmas = dict.fromkeys(names, (middle, sigma))
    only = {"outputs": ("foundation_mean",), "observables": ()}
    return jc.propagate(function, orbit, sigmas, **only).isel(quantity=0)


def test_products_of_numbers_count():
    """Six factors whose deviation is a share r of them: that of their product is known."""
    for share, linear in ((0.05, True), (0.2, False)):
        found = of_load(math.prod, "abcdef", 1.0, share)
        exact = float(found.value) * np.sqrt((1 + share**2) ** 6 - 1)
        # Products of three and more add 20 share^6 to a variance of 6 share^2; inertia 1e-5.
        assert float(found.second_order) == pytest.approx(exact, rel=10 / 6 * share**4 + 1e-4)
        assert bool(found.linear) == linear


def test_a_move_of_all_numbers_tells_what_products_of_three_do():
    """About zero such a product has neither slopes nor second derivatives."""
    found = of_load(lambda numbers: 1 + 0.1 * math.prod(numbers), "abc", 0.0, 1.0)
    assert float(found.second_order) < 1e-9 * float(found.value) and not bool(found.linear)


def test_on_a_natural_frequency_deviations_come_near_to_the_true_ones():
    """By detuning in half-widths of the peak; of so many deviations is one of them."""
    for width, excess in ((5.0, 1.06), (2.0, 1.22), (0.5, 1.40)):

        def amplitude(detuning, width=width):
            return 1 / (1 + (detuning / width) ** 2) ** 0.5

        found = of_load(lambda numbers, of=amplitude: of(*numbers), "a", 0.0, 1.0)
        points, weights = np.polynomial.hermite_e.hermegauss(200)
        sizes, weights = amplitude(points), weights / weights.sum()
        exact = float(found.value) * np.sqrt(weights @ sizes**2 - (weights @ sizes) ** 2)
        # A parabola through three points, of which docs/identification.md tells; the peak's height
        # is met by inertia to 1e-5, and the table is rounded. The bend within one deviation alone
        # would be 58 % too much for a half-width of two.
        assert float(found.second_order) == pytest.approx(excess * exact, rel=0.02)
        assert not bool(found.linear)


@pytest.mark.slow
@pytest.mark.optimised
def test_an_orbit_that_loses_contact_scatters_as_its_neighbours_say():
    """It is shot for, and so are its neighbours."""
    machine = jc.paper_machine(speed=34.23, clearance=0.0645e-3, load_law="closing_stroke")
    orbit = jc.periodic_orbit(machine.scene(), method="shooting")
    assert orbit.least_penetration < 0
    sigma, of_rms = 1e-9, {"outputs": ("foundation_rms",), "observables": ()}
    found = jc.propagate(machine, orbit, {"clearance": sigma}, **of_rms)

    def rms(clearance):
        return jc.periodic_orbit(machine.scene(clearance=clearance), **orbit.alike).foundation_rms

    expected = sigma * float(abs(differences(rms, 0.0645e-3, sigma)))
    # The distance bends by a share of the shift in clearances, 1.6e-5, and what impacts multiply.
    assert float(found.standard_deviation[0]) == pytest.approx(expected, rel=1e-3)
    # Two shots with steps right to 1e-9, which impacts multiply.
    assert float(found.value[0]) == pytest.approx(float(orbit.foundation_rms), rel=1e-7)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"sigmas": {}}, "`sigmas` must name a number, but is empty"),
        ({"sigmas": {"jaw.mass": 0.0}}, r"`sigmas\['jaw.mass'\]` must be finite and > 0"),
        ({"sigmas": {"load_seed": 1.0}}, "`sigmas` must name numbers that may vary continuo"),
        ({"machine": jc.paper_scene}, r"`speed` must have a value, as {name: value}"),
        ({"machine": MACHINE.replace(speed=31.0)}, "`machine` must have the scene of the orbit"),
        ({"outputs": ("left_peak",)}, "`outputs` must be a known name, but is 'left_peak'"),
        ({"orders": 600}, "`orders` must be less than 512, but is 600"),
        (
            {"orbit": missing(MACHINE.scene(), 1, RESULTS.impacts)},
            "`orbit` must be one that was found, but is none: The motion",
        ),
    ],
)
def test_refusals(orbit, asked, words):
    with pytest.raises(ValueError, match=words):
        jc.propagate(**{"machine": MACHINE, "orbit": orbit, "sigmas": {"speed": 1.0}, **asked})
