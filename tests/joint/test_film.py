"""A lubricating film against closed forms, a quadrature, Ocvirk's number and Reynolds' equation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from benchmarks.film.tables import RAIMONDI_BOYD, force_of
from benchmarks.peers.reynolds import film_force
from jaxcrusher.basics.plane import Vector
from jaxcrusher.joint.film import Film, FiniteFilm

MU, R, L, C = 0.08, 0.05, 0.04, 5e-5
FILM = Film(viscosity=MU, width=L, least_thickness=1e-7)
FINITE = FiniteFilm(viscosity=MU, width=L, least_thickness=1e-7)
SCALE = MU * R * L**3 / C**3


def force(e, rate=(0.0, 0.0), bearing_spin=0.0, journal_spin=0.0, film=FILM):
    """The force on the bearing, N."""
    found = film.action(Vector(*e), Vector(*rate), bearing_spin, journal_spin, R, C)
    return np.array([float(found.force.x), float(found.force.y)])


@pytest.mark.parametrize("share", [0.0, 1e-6, 0.1, 0.5, 0.9, 0.99])
def test_a_steady_journal_has_ocvirks_load_and_attitude(share):
    """DuBois and Ocvirk 1953, of a journal whose centre rests in a bearing at rest."""
    speed = 40.0
    along, across = -force((share * C, 0.0), journal_spin=speed)  # on the journal
    rest = 1 - share**2
    load = MU * speed * R * L**3 / (4 * C**2) * share / rest**2
    size = load * np.sqrt(16 * share**2 + np.pi**2 * rest)
    # The width of |e| / c where it vanishes moves it by 5e-19 / share, and the corner is far off.
    assert np.hypot(along, across) == pytest.approx(size, rel=1e-9, abs=1e-12)
    if share:
        attitude = np.arctan2(across, -along)
        # The least length and speed, of 1e-15, move the direction of 5e-11 m by some 1e-9.
        assert np.tan(attitude) == pytest.approx(np.pi * np.sqrt(rest) / (4 * share), rel=4e-9)


@pytest.mark.parametrize("share", [0.0, 0.2, 0.8, 0.98])
@pytest.mark.parametrize("towards", [1, -1])
def test_pure_squeeze(share, towards):
    """Elementary: the pin moves along its eccentricity, and nothing turns."""
    rest = 1 - share**2
    own = np.arccos(-towards * share)
    size = ((1 + 2 * share**2) * own + towards * 3 * share * np.sqrt(rest)) / rest**2.5
    along, across = force((share * C, 0.0), (towards * 1e-3, 0.0))
    assert along == pytest.approx(towards * 1e-3 * SCALE * size, rel=1e-9)
    assert abs(across) <= 1e-12 * abs(along)


def test_any_motion_is_reynolds_integral():
    """By a quadrature of the half where the film carries."""
    random = np.random.default_rng(0)
    for share in (0.01, 0.3, 0.7, 0.95):
        for _ in range(4):
            place, (ur, ut) = random.uniform(0, 2 * np.pi), random.normal(size=2)
            axis = np.array([np.cos(place), np.sin(place)])
            seen = ur * axis + ut * np.array([-axis[1], axis[0]])
            middle = np.arctan2(ut, ur)
            ends = middle - np.pi / 2, middle + np.pi / 2

            def part(phi, of, share=share, ur=ur, ut=ut):
                carried = ur * np.cos(phi) + ut * np.sin(phi)
                return carried * of(phi) / (1 - share * np.cos(phi)) ** 3

            radial, across = (
                quad(part, *ends, args=(of,), epsabs=0, epsrel=1e-11, limit=200)[0]
                for of in (np.cos, np.sin)
            )
            place = Vector(*(1e-5 * axis)), jnp.asarray(share), Vector(*seen), R, C
            found = FILM.resistance(*place) / SCALE
            turned = found.dot(Vector(*axis)), Vector(*axis).cross(found)
            scale = np.hypot(radial, across)
            # The quadrature's own error.
            np.testing.assert_allclose(turned, (radial, across), rtol=0, atol=1e-9 * scale)


@pytest.mark.parametrize("film", [FILM, FINITE])
def test_a_pin_that_whirls_at_half_speed_has_no_film(film):
    """An unloaded journal: wedge and squeeze cancel all round (Hori 1959)."""
    e, spin = np.array([3e-5, -1e-5]), 80.0
    whirl = spin / 2 * np.array([-e[1], e[0]])
    still = np.hypot(*force(e, journal_spin=spin, film=film))
    # The least speed is 1e-15 m/s against the 1 mm/s of the wedge.
    assert np.hypot(*force(e, whirl, journal_spin=spin, film=film)) < 1e-8 * still


@pytest.mark.parametrize("film", [FILM, FINITE])
def test_a_film_takes_power_and_balances_in_moment(film):
    random = np.random.default_rng(1)
    for _ in range(20):
        e, rate, spins = 3e-5 * random.normal(size=2), random.normal(size=2), random.normal(size=2)
        found = film.action(Vector(*e), Vector(*rate), *spins, R, C)
        taken = found.force.dot(Vector(*rate))
        taken -= found.bearing_moment * spins[0] + found.journal_moment * spins[1]
        assert float(found.loss) == pytest.approx(float(taken), rel=1e-10) and found.loss > 0
        both = float(found.bearing_moment + found.journal_moment)
        assert both == pytest.approx(float(Vector(*e).cross(found.force)), rel=1e-10, abs=1e-12)


def test_the_moment_of_a_concentric_journal_is_petroffs():
    """Petroff 1883: 2 pi mu omega R^3 L / c."""
    found = FILM.action(Vector(0.0, 0.0), Vector(0.0, 0.0), 0.0, 40.0, R, C)
    petroff = 2 * np.pi * MU * 40.0 * R**3 * L / C
    assert float(found.bearing_moment) == pytest.approx(petroff, rel=1e-12)
    assert float(found.journal_moment) == pytest.approx(-petroff, rel=1e-12)


def test_a_film_is_held_at_its_least_thickness():
    """There it resists as it does at this thickness, also beyond contact."""
    film = Film(viscosity=MU, width=L, least_thickness=0.02 * C)
    args = Vector(1e-3, 0.0), 0.0, 0.0, R, C
    held = [float(film.action(Vector(x * C, 0.0), *args).force.x) for x in (0.99, 1.0, 1.1)]
    np.testing.assert_allclose(held, held[0], rtol=1e-12)
    share = 0.98
    size = (1 + 2 * share**2) * np.arccos(-share) + 3 * share * np.sqrt(1 - share**2)
    assert held[0] == pytest.approx(1e-3 * SCALE * size / (1 - share**2) ** 2.5, rel=1e-9)


@pytest.mark.parametrize("film", [FILM, FINITE])
@pytest.mark.parametrize("e", [(0.0, 0.0), (2e-5, 1e-5), (4.99e-5, 0.0), (6e-5, 0.0)])
def test_slopes_are_finite(film, e):
    def size(x, y, u, v):
        return film.action(Vector(x, y), Vector(u, v), 0.0, 30.0, R, C).force.x

    for rate in ((0.0, 0.0), (1e-3, -2e-3)):
        slopes = jax.grad(size, argnums=(0, 1, 2, 3))(*map(jnp.asarray, (*e, *rate)))
        assert np.isfinite(slopes).all()


@pytest.mark.parametrize("film", [FILM, FINITE])
@pytest.mark.parametrize("spin", [20.0, -20.0])
@pytest.mark.parametrize("load", [1e-3, 10.0, 1e4, 1e6])
def test_a_pin_rests_where_the_film_carries_its_load(film, load, spin):
    given = load * np.array([0.6, -0.8])
    at = film.resting(Vector(*given), jnp.asarray(spin), R, C)
    found = force((float(at.x), float(at.y)), journal_spin=2 * spin, film=film)
    # The width of |e| / c is 1e-12, and the least one here is 1e-7 of c.
    np.testing.assert_allclose(found, given, rtol=1e-8, atol=1e-8 * load)


@pytest.mark.parametrize(("slenderness", "share"), [(1.0, 0.2), (0.5, 0.6), (0.25, 0.9)])
def test_reynolds_equation_has_raimondi_and_boyds_numbers(slenderness, share):
    """They solved it in 1958, with the film's end where the slope of its pressure vanishes."""
    number, attitude = RAIMONDI_BOYD[slenderness][share]
    size, angle = film_force(share, np.pi / 2, slenderness, ruptures=True)
    # Their numbers have three digits, of coarser differences: attitudes are 4 degrees off at most.
    assert 2 / (np.pi * size * share) == pytest.approx(number, rel=0.02)
    assert np.degrees(angle) == pytest.approx(attitude, abs=4.0)


def test_a_narrow_bearing_is_a_short_one():
    """Of a width of a fiftieth of the diameter Reynolds' equation leaves the leak across alone."""
    for share, turned in ((0.3, 0.0), (0.6, 1.0), (0.6, 2.5)):
        size, angle = film_force(share, turned, 0.02, ruptures=False)
        found = force_of(Film, 0.02, share, turned)
        # The leak along the bore, as the square of width over diameter, and the differences.
        assert abs(found) == pytest.approx(size, rel=4e-3)
        assert np.angle(found) == pytest.approx(angle, abs=2e-3)


@pytest.mark.parametrize("slenderness", [0.25, 0.5, 1.0])
def test_a_finite_film_is_near_reynolds_equation(slenderness):
    """As near as the page says, whichever way the pin moves."""
    for share, most in ((0.2, 0.12), (0.6, 0.12), (0.8, 0.2)):
        for turned in (0.0, 1.0, 2.0, 3.0):
            size, angle = film_force(share, turned, slenderness, ruptures=True)
            ours = force_of(FiniteFilm, slenderness, share, turned)
            assert abs(abs(ours) / size - 1) < most, (share, turned, abs(ours) / size)
            assert abs(np.angle(ours) - angle) < np.radians(4.0), turned
