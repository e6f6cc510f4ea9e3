"""The judgement of `benchmarks.stability` tells a wrong number; what has no motion is refused."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from benchmarks.peers import scipy_peer
from benchmarks.peers.crusher_bodies import crusher
from benchmarks.stability import drawn, drawn_run, judgement, mechanisms
from benchmarks.stability.cases import BASE, bearing_case, described, seat_case
from benchmarks.stability.drawn_orbits import OPEN
from benchmarks.stability.drawn_orbits import judged as judged_orbit
from benchmarks.stability.free_orbits import by_free_bodies
from benchmarks.stability.inputs import cast
from benchmarks.stability.judgement import AGREES, DISAGREES
from benchmarks.stability.reference import reference
from jaxcrusher.basics.plane import scalar
from jaxcrusher.motion.section import fine
from jaxcrusher.motion.simulation import Trajectory
from jaxcrusher.scenes.parameters import PE250X400
from tests.pairs import slow

CASE = bearing_case("centred")


@pytest.fixture(scope="module")
def known():
    return reference(CASE.peer, CASE.pins)


def error(scene, known) -> float:
    """Of the span, over what is allowed."""
    found = judgement.pointwise(scene, judgement.simulate(scene), known)
    assert found["span_ms"] > 20
    return found["error"] / found["allowed"]


@pytest.mark.slow
def test_pointwise_tells_another_stiffness(known):
    assert error(CASE.scene("eccentricity"), known) <= 1
    softer = replace(BASE, young=0.999 * BASE.young)
    assert error(bearing_case("centred", softer).scene("eccentricity"), known) > 1


@pytest.fixture(scope="module")
def seat():
    case = seat_case("loose", "A, B, C", "centred", "ABC")
    return case, reference(case.peer, case.pins)


@pytest.mark.slow
def test_seats_are_compared_by_force_and_every_eccentricity(seat):
    case, known = seat
    assert known.contacts[-1] > 10
    scene = case.scene("eccentricity")
    ours = judgement.simulate(scene)
    found = judgement.pointwise(scene, ours, known)
    assert found["span_ms"] > 10 and found["error"] <= found["allowed"]
    names = ("foundation_force", "eccentricity", "elbow_eccentricity", "pivot_eccentricity")
    assert set(known.histories) == set(names)
    for name in names:
        wrong = eqx.tree_at(lambda o, n=name: o.values[n], ours, replace_fn=lambda v: 1.01 * v)
        found = judgement.pointwise(scene, wrong, known)
        assert not found["error"] <= found["allowed"], name


@pytest.mark.slow
def test_pointwise_tells_another_stiffness_of_a_seat(seat):
    _, known = seat
    for name in ("elbow.young", "pivot.young"):
        changes = {name: 0.999 * float(described("ABC", {})[name])}
        softer = seat_case("", "", "centred", "ABC", changes).scene("eccentricity")
        found = judgement.pointwise(softer, judgement.simulate(softer), known)
        assert found["error"] > found["allowed"]


def test_statistics_tell_another_mean():
    theirs = np.random.default_rng(0).normal(1000, 10, 24)
    for shift, agrees in ((0.0, True), (100.0, False)):
        _, off, allowed = judgement.statistical(np.array([1000 + shift]), theirs, 0.0)
        assert (off <= allowed) == agrees
    # A whirl beside quiet runs: on another branch there is nothing to agree with.
    _, off, allowed = judgement.statistical(np.array([1e6]), theirs, 0.0)
    assert not off <= allowed


def test_motion_that_is_not_finite_fails():
    scene = CASE.scene("eccentricity")
    broken = eqx.tree_at(lambda s: s.joint.normal.stiffness, scene, scalar(float("nan")))
    found = judgement.simulate(broken)
    assert not found.success
    assert found.failure
    assert np.isnan(found.foundation_force).all()


def test_scene_in_32_bits_is_refused():
    with pytest.raises(ValueError, match="64-bit floats only, but is with float32"):
        judgement.simulate(cast(CASE.scene("eccentricity")))
    with pytest.raises(ValueError, match="64-bit floats only, but is with float32"):
        jax.eval_shape(judgement.simulate, cast(CASE.scene("eccentricity")))


@pytest.mark.parametrize("young, clearance", [(207e9, 0.03e-3), (207e13, 0.06e-3), (207e9, 1e-6)])
def test_corner_stays_small_beside_the_contact(young, clearance):
    joint = jc.build_scene({"young": young, "clearance": clearance}).joint
    # 0.5 N of 15 kN; and |e| at touch-down right to 1e-9 clearances.
    assert joint.normal.elastic_force(scalar(0.0)) <= 0.501
    assert joint.norm_width**2 / (2 * clearance) <= 1e-9 * clearance
    if young == 207e9 and clearance >= 0.03e-3:
        assert (float(joint.normal.width), float(joint.norm_width)) == (1e-8, 1e-9)


@pytest.mark.parametrize(
    "kind", [*drawn.KINDS[:3], *slow(*drawn.KINDS[3:])], ids=lambda kind: kind.name
)
def test_drawn_crushers_are_built_and_told_apart(kind):
    """Every number is within its limits, and another seed draws all of them anew."""
    one, again, other = (drawn.numbers(kind, seed) for seed in ("1", "1", "2"))
    assert jc.build_scene(one).is_ideal is False
    for name, value in one.items():
        np.testing.assert_array_equal(value, again[name])
    same = {name for name in one if np.array_equal(one[name], other[name])}
    assert same <= {*kind.choices, "start", "counterweight.mass", "rollers.bearings"}


def test_a_drawn_motion_is_compared_while_neighbours_stay_together():
    """A force that is off by a thousandth is told where they do, and not where they part."""
    instants = np.linspace(0, 1, drawn_run.INSTANTS)

    def motion(force):
        seen = {"foundation_force": force, "normal_force": 1 + 0 * force}
        return Trajectory(jnp.asarray(instants), fine(), jax.tree.map(jnp.asarray, seen))

    known = motion(1e4 * np.cos(instants))
    off = motion(1e4 * np.cos(instants) + 10 * (instants > 0.5))
    parted = motion(1e4 * np.cos(instants) + 1e3 * (instants > 0.4))
    for ours, fellow, neighbours, verdict in (
        (known, known, [known] * 3, AGREES),
        (off, known, [known] * 3, DISAGREES),
        (off, known, [known, parted, known], AGREES),
        (off, parted, [known] * 3, AGREES),
        (off, motion(1e4 * np.cos(instants) + 0.9 * (instants > 0.5)), [known] * 3, DISAGREES),
        (off, motion(1e4 * np.cos(instants) + 1.1 * (instants > 0.5)), [known] * 3, AGREES),
        (motion(np.nan * instants), known, [known] * 3, DISAGREES),
    ):
        row = drawn_run.judged("", 0, ours, known, fellow, neighbours)
        assert row.verdict == verdict
        assert (row.span < 0.5) == (fellow is parted or neighbours[1] is parted)


@pytest.mark.parametrize(
    "family",
    [*mechanisms.FAMILIES[:3], *slow(*mechanisms.FAMILIES[3:])],
    ids=lambda family: family.name,
)
def test_drawn_mechanisms_go_round_and_are_told_apart(family):
    one, again, other = (
        mechanisms.mechanism(family, seed).machine for seed in ("1 0", "1 0", "1 1")
    )
    assert one.values == again.values and one.structure == other.structure
    assert {name for name in one.values if one.values[name] == other.values.get(name)} <= {
        "start",
        *(name for name in one.values if name.endswith(("_law", "slip", "_speed"))),
    }
    scene = one.scene()
    assert scene.joints.names == tuple(family.loose)
    assert (scene.supports is not None) == family.supports


@pytest.mark.slow
def test_an_orbit_is_judged_by_free_bodies():
    """The quiet orbit closes, and one that is begun with a wrong rate does not."""
    numbers = PE250X400 | {"load_law": "normal_to_jaw", "slip": "surface"}
    orbit = jc.periodic_orbit(jc.build_scene(numbers))
    bodies = crusher(numbers)
    # The orbit is right to 1e-9 clearances, a step of SciPy to 1e-11 of 1 m, or 2e-7 of them.
    assert max(by_free_bodies(orbit, bodies)) < 1e-7
    wrong = replace(orbit, section=orbit.section + 1e-4)
    assert by_free_bodies(wrong, bodies)[0] > 1e-6


def test_scipy_that_takes_too_long_leaves_an_orbit_open():
    bodies = crusher(PE250X400)
    late = lambda _: scipy_peer.integrate(bodies, [0.0, 0.01], seconds=0.0)  # noqa: E731
    row = judged_orbit("", 0, lambda: jc.ideal_scene(31.0), late)
    assert row.verdict == OPEN and "in 0 s" in row.remark and np.isnan(row.state)
