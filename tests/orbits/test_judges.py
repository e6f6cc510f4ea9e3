"""The crusher's own orbits, by equations and programs that share nothing with the package."""

import numpy as np
import pytest
from scipy.integrate import solve_bvp, solve_ivp

import jaxcrusher as jc
from benchmarks.peers import numba_peer
from benchmarks.peers.equations import Crusher
from jaxcrusher.motion.flow import flat
from tests.differences import differences

TURN = 2 * np.pi
# Mesh to begin with, a turn; the swing goes round the bore some 27 times in one.
MESH = 400


@pytest.fixture(scope="module")
def orbit():
    return jc.periodic_orbit(jc.paper_scene(30.0, 0.06e-3, slip="surface"))


@pytest.fixture(scope="module")
def field():
    """The crusher by hand for numba: the rate of (e / c, e' in m/s) and the force, by angle."""
    numbers, rate = numba_peer.numbers(Crusher(friction=0.1)), np.empty(5)

    def evaluate(angle, y):
        numba_peer.field(angle, np.append(y, 0.0), numbers, rate)
        return rate.copy()

    return evaluate


@pytest.fixture(scope="module")
def judged(orbit, field):
    """SciPy's boundary values, from the pin's places to 1 %, and at rest in the bore."""
    angles = np.linspace(0, TURN, MESH + 1)
    places = orbit.motion(angles, ("eccentricity",))["eccentricity"] / 0.06e-3
    guess = np.concatenate([1.01 * np.asarray(places).T, np.zeros((2, MESH + 1))])

    def rates(angles, states):
        return np.stack([field(a, y)[:4] for a, y in zip(angles, states.T, strict=True)], axis=1)

    found = solve_bvp(rates, lambda a, b: a - b, angles, guess, tol=1e-8, max_nodes=20_000)
    assert found.success, found.message
    return found


def test_the_orbit_by_boundary_values(orbit, field, judged):
    """SciPy's solve_bvp on the equations by hand, from another guess: motion and RMS."""
    # Its residuals are 1e-8 of the rates; the orbit is known to 1e-10.
    state = np.asarray(flat(orbit.state()))
    np.testing.assert_allclose(judged.sol(0.0), state, atol=1e-6)
    angles = TURN * np.arange(2048) / 2048
    squares = [TURN * field(a, y)[4] for a, y in zip(angles, judged.sol(angles).T, strict=True)]
    np.testing.assert_allclose(np.sqrt(np.mean(squares)), orbit.foundation_rms, rtol=1e-8)


@pytest.mark.slow
def test_multipliers_by_neighbouring_motions(orbit, field, judged):
    """Differences of SciPy's DOP853 over a turn, about the orbit by boundary values."""

    def after(y):
        run = solve_ivp(
            lambda a, y: field(a, y)[:4], (0, TURN), y, "DOP853", rtol=1e-12, atol=1e-13
        )
        return run.y[:, -1]

    # Of fourth order: a swing through a contact bends over hundredths of a clearance.
    expected = np.poly(differences(after, judged.sol(0.0), 5e-5, order=4))
    # Two of them are nearly one, and lose digits that the polynomial they are roots of does not.
    # Measured: 2e-7, of steps a tenth or ten times as long some 3e-6.
    np.testing.assert_allclose(np.poly(np.asarray(orbit.multipliers)), expected, atol=1e-6)
