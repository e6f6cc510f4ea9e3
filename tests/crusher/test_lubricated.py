"""A crusher whose main bearing has a film: orbits, runs, slopes, power, both formulations."""

import numpy as np
import pytest

import jaxcrusher as jc
from benchmarks.peers.crusher_bodies import crusher
from benchmarks.stability.free_orbits import by_free_bodies
from jaxcrusher.scenes.parameters import complete
from jaxcrusher.testing import check_law
from tests.crusher.formulations import forces_by_both
from tests.differences import assert_slopes

THIN = {"speed": 30.0, "clearance": 6e-5, "film.viscosity": 0.02}


def rms(viscosity):
    return jc.periodic_orbit(jc.build_scene(THIN | {"film.viscosity": viscosity})).foundation_rms


def test_a_pin_starts_in_its_film():
    """Not in its bore, at a clearance and more, where a dry one would carry the same force."""
    scene = jc.build_scene(THIN | {"start": "contact"})
    e, _ = scene.start.eccentricities(scene)
    clearance = float(scene.joints.at("main").clearance)
    share = float(np.hypot(e.at("main").x, e.at("main").y)) / clearance
    assert 0.05 < share < 0.95


@pytest.mark.slow
def test_the_orbit_is_what_a_run_settles_on():
    """A film damps a disturbance to 0.04 in a turn, where a dry bearing needs 14 000 turns."""
    scene = jc.build_scene(THIN)
    orbit = jc.periodic_orbit(scene)
    assert orbit.stable and orbit.largest_multiplier == pytest.approx(0.0403, abs=1e-4)
    assert orbit.validity.inside and orbit.film_ratio == pytest.approx(12.913, abs=1e-3)
    run = jc.statistics(scene, 6, 1)
    # What 0.04^6 and the tolerance of the run leave.
    assert float(run.foundation_rms) == pytest.approx(float(orbit.foundation_rms), rel=5e-9)
    # Of central differences over a share of 5e-4.
    assert_slopes(rms, 0.02, 1e-5, rtol=1e-6)


@pytest.mark.slow
def test_both_formulations_move_alike_and_keep_their_ledger():
    # By the drift that the multipliers' tolerance allows.
    np.testing.assert_allclose(*forces_by_both(THIN | {"start": "contact"}), rtol=2e-6)


@pytest.mark.slow
def test_the_law_runs_everywhere():
    check_law(jc.build_scene(THIN).joints["main"])


@pytest.mark.slow
def test_free_bodies_with_a_quadrature_for_a_film_stay_on_the_orbit():
    """Of films at A and O, by SciPy."""
    at_o = {"clearance": 5e-5, "film.viscosity": 0.03, "film.width": 0.07}
    values = complete(THIN | {f"shaft_bearing.{name}": value for name, value in at_o.items()})
    orbit = jc.periodic_orbit(jc.build_scene(values))
    assert orbit.stable and np.isinf(orbit.least_penetration)
    state, rms = by_free_bodies(orbit, crusher(values))
    # Clearances and m/s, and a share, of an integration at 1e-11 in positions of 1 m.
    assert state < 1e-8 and rms < 1e-7


@pytest.mark.slow
def test_a_wide_film_of_finite_length_is_thinner():
    """A film as wide as the diameter leaks along the bore, which the short bearing leaves out."""
    wide = THIN | {"film.width": 0.26, "film.viscosity": 2e-3}
    short, finite = (
        jc.periodic_orbit(jc.build_scene(wide | {"film_law": law})) for law in ("short", "finite")
    )
    assert short.stable and finite.stable
    assert finite.film_ratio < 0.9 * short.film_ratio


def test_a_film_needs_sliding_surfaces():
    with pytest.raises(ValueError, match=r"`film\.viscosity` must not stand beside rollers"):
        jc.build_scene(THIN | {"contact_law": "rollers"})
    with pytest.raises(ValueError, match=r"must come with `film\.viscosity`"):
        jc.build_scene({"film.width": 0.1})
    with pytest.raises(ValueError, match=r"must come with `elbow\.clearance`"):
        jc.build_scene({"elbow.film.viscosity": 0.1})


def test_a_thin_film_is_outside_the_model():
    scene = jc.build_scene(THIN | {"film.least_thickness": 4e-5})
    orbit = jc.periodic_orbit(scene, nodes=16)
    assert not orbit.validity.inside and "its surfaces touch" in str(orbit.validity.remarks())
