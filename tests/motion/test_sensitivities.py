"""Derivatives against central differences, and where they must stay finite."""

import importlib
import warnings

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics import setup
from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher.template import STATISTIC
from jaxcrusher.mechanism.starts import Given
from jaxcrusher.motion.flow import initial_state
from jaxcrusher.motion.tangents import changes, combine, tangents
from tests.differences import differences
from tests.pairs import slow

DESIGN = jnp.array([30.0, 0.06e-3])


def first_impact(design, slip="surface", rtol=1e-11, **method):
    """Numbers of the first 5 ms of a centred start: one impact, at about 3 ms."""
    scene = jc.paper_scene(design[0], design[1], slip=slip)
    times = jnp.linspace(0, 5e-3, 501)
    outputs = ("foundation_force", "drive_torque", "eccentricity")
    motion = jc.simulate(scene, times, outputs=outputs, rtol=rtol, **method)
    force = motion.foundation_force
    return jnp.stack(
        [
            jnp.sqrt(jnp.mean(force**2)),
            force.max(),
            jnp.mean(motion.drive_torque),
            1e6 * motion.eccentricity[-1, 0],
            1e6 * motion.eccentricity[-1, 1],
        ]
    )


def test_first_impact_agrees_with_differences():
    function = jax.jit(lambda design: first_impact(design, "surface", rtol=1e-13))
    tangents = jax.jit(jax.jacfwd(lambda design: first_impact(design, "surface", rtol=1e-9)))(
        DESIGN
    )
    # Steps of 3e-4 of the design truncate at 3e-6; shorter ones drown in the noise of the two
    # runs (1e-3 at steps of 3e-6, or at 3e-4 and rtol 1e-11; up to 1e-4 at 1e-12). 1e-4 is what
    # was promised.
    expected = differences(function, DESIGN, 3e-4 * DESIGN)
    np.testing.assert_allclose(tangents, expected, rtol=1e-4)


@pytest.mark.slow
def test_every_way_to_differentiate_agrees():
    def peak(design, **method):
        return first_impact(design, **method)[1]

    forward = jax.jit(jax.jacfwd(peak))(DESIGN)
    # The same rule, transposed: rounding only.
    np.testing.assert_allclose(jax.jit(jax.grad(peak))(DESIGN), forward, rtol=1e-9)
    checkpoints = diffrax.RecursiveCheckpointAdjoint()
    through_steps = jax.jit(
        jax.grad(lambda d: peak(d, method=jc.Method(adjoint=checkpoints, max_steps=4096)))
    )
    # Nothing controls the error of differentiated steps: against tangents at 1e-13 it is 1e-3 at a
    # tolerance of 1e-9, 1e-4 to 2e-4 at this one of 1e-11, and 5e-6 at 1e-12.
    through = through_steps(DESIGN)
    np.testing.assert_allclose(through, forward, rtol=1e-3)
    assert np.max(np.abs(through / forward - 1)) > 1e-7  # the tangents are not what was taken


OUTPUT = ("foundation_force",)
RMS = ("foundation_rms",)


@pytest.mark.parametrize(
    ("start", "computed", "warns"),
    [
        ("centred", lambda scene: jc.statistics(scene, 2, 1, outputs=RMS).foundation_rms, True),
        ("centred", lambda scene: jc.statistics(scene, 0, 1, outputs=RMS).foundation_rms, False),
        ("contact", lambda scene: jc.statistics(scene, 2, 1, outputs=RMS).foundation_rms, False),
        *slow(
            ("centred", lambda scene: jc.poincare_section(scene, 2, 1).states[-1, 0], True),
            (
                "centred",
                lambda scene: jc.simulate(scene, [0.6], outputs=OUTPUT)[OUTPUT[0]][0],
                True,
            ),
            (
                "centred",
                lambda scene: jc.simulate(scene, [0.1], outputs=OUTPUT)[OUTPUT[0]][0],
                False,
            ),
        ),
    ],
)
def test_who_differentiates_a_run_that_parts_from_its_neighbours_is_told_once(
    start, computed, warns, monkeypatch
):
    """Of three turns with impacts the slope of the RMS is 1e28 N/m, and of the orbit 5e4 N/m.

    Nobody is told in contact, of fewer turns, and where no derivative is taken.
    """
    monkeypatch.setattr(setup, "_told", {"loops", "cores"})
    said = []
    monkeypatch.setattr(warnings, "warn", lambda text, **_: said.append(text))

    def of_clearance(clearance):
        scene = {"speed": 30.0, "clearance": clearance, "start": start}
        return computed(jc.build_scene(scene))

    of_clearance(6e-5)
    assert not said
    for _ in "12":
        jax.grad(of_clearance)(6e-5)
    assert len(said) == warns
    assert all(text.startswith("A derivative over") and "gradient_report" in text for text in said)


@pytest.mark.slow
def test_tangents_of_what_is_about_the_mean_of_a_turn():
    metric = "shaking_moment_rms"

    def scene(point):
        return jc.paper_scene(point[0], 0.06e-3, start="contact")

    state = initial_state(scene(DESIGN))

    def value(point):
        found = jc.statistics(scene(point), 0, 2, outputs=(metric,), state=state, rtol=1e-12)
        return float(found[metric])

    along = tangents(scene, DESIGN[:1], metric, state, 2, 1e-10)
    slope = combine(STATISTIC[metric], along.values, changes(along, np.zeros((4, 1))))
    np.testing.assert_allclose(slope, differences(value, DESIGN[:1], 3e-3), rtol=1e-4)


@pytest.mark.slow
def test_a_second_derivative_at_the_tolerance_of_users():
    """By clearance, where the contact is a twentieth of a clearance deep."""

    def rms(clearance, rtol):
        scene = jc.paper_scene(30.0, clearance, start="contact")
        return jc.statistics(scene, 0, 1, outputs=("foundation_rms",), rtol=rtol).foundation_rms

    second = jax.jit(jax.hessian(rms))
    # 1.3003e8 N/m2, as differences of slopes at 1e-11 and less say too. Measured: 8e-4; 0.12 where
    # the tolerance is not narrower than that of the motion alone.
    assert float(second(6e-5, 1e-9)) == pytest.approx(float(second(6e-5, 1e-12)), rel=2e-3)
    assert float(second(6e-5, 1e-12)) == pytest.approx(1.3003e8, rel=1e-4)


@pytest.mark.parametrize(
    "slip, formulation",
    [
        ("surface", "eccentricity"),
        pytest.param("centre", "eccentricity", marks=pytest.mark.slow),
        pytest.param("surface", "multiplier", marks=pytest.mark.slow),
    ],
)
def test_finite_at_zero_eccentricity_and_zero_slip(slip, formulation):
    """The field's derivatives at e = 0, and in contact where the surfaces do not slip."""
    scene = jc.paper_scene(30.0, 0.06e-3, slip=slip, formulation=formulation)
    rate = Vector(0.0, 0.0)
    for relative in (Vector(0.0, 0.0), Vector(0.0, 1.05), Vector(1.0, 0.0)):
        placed = eqx.tree_at(lambda s: s.start, scene, Given({"main": relative}, {"main": rate}))

        def field(state, placed=placed):
            s = placed.formulation.snapshot(jnp.array(0.0), state, placed)
            return placed.formulation.rate(s, state, placed)

        state = placed.formulation.initial(placed)
        first = jax.jacfwd(field)(state)
        second = jax.jacfwd(jax.jacfwd(field))(state)
        for leaf in jax.tree.leaves((first, second)):
            assert np.isfinite(leaf).all()


def test_no_retrace():
    """Other values of a traced or concrete design run the same program."""
    traces = 0

    @eqx.filter_jit
    def rms(scene):
        nonlocal traces
        traces += 1
        return jc.statistics(scene, 0, 1, outputs=("foundation_rms",)).foundation_rms

    values = [
        float(rms(jc.build_scene({"joint": "ideal", "speed": w, "load": f})))
        for w, f in ((30.0, 9e3), (31, 8e3))
    ]
    assert traces == 1 and values[0] != values[1]
    compiled = importlib.import_module("jaxcrusher.motion.simulation")._simulate
    times = np.linspace(0, 1e-4, 3)
    jc.simulate(jc.paper_scene(30.0, 6e-5), times, outputs=("normal_force",))
    before = compiled._cached._cache_size()
    jc.simulate(jc.paper_scene(33.0, 8e-5), 2 * times, outputs=("normal_force",), rtol=1e-9)
    assert compiled._cached._cache_size() == before
