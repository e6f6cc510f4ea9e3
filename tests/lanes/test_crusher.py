"""Crushers in lanes: the same answers as diffrax."""

from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.loop_kernels import OPTION
from jaxcrusher.batch.engines import in_lanes, in_turn, map_all, stack
from jaxcrusher.crusher.loads import AbstractLoad, JawForce
from jaxcrusher.mechanism.drives import GivenTorque
from jaxcrusher.motion.flow import Flow
from jaxcrusher.motion.method import resolve
from jaxcrusher.motion.section import advance
from tests.pairs import slow

COUNT = 37  # no multiple of the lanes


def _numbers(seed=0, count=COUNT):
    random = np.random.default_rng(seed)
    return {"speed": random.uniform(25, 40, count), "clearance": random.uniform(3e-5, 12e-5, count)}


def _row(numbers, choices, rtol):
    result = jc.statistics(jc.build_scene({**numbers, **choices}), 0, 1, rtol=rtol)
    return {**result.values, "success": result.success, "state": result.state}


def _equal(one, other):
    jax.tree.map(np.testing.assert_array_equal, one, other)


def _agree(function, cases, names):
    """Lanes and diffrax give the same numbers, each to a tolerance of its own."""
    found, exact = map_all(function, cases, engine=in_lanes), map_all(function, cases, 8, in_turn)
    assert bool(found["success"].all() and exact["success"].all())
    for name, tolerance in names.items():
        np.testing.assert_allclose(found[name], exact[name], rtol=tolerance, err_msg=name)


# At rtol 1e-9 other rounding, as of a speed one unit in the last place up, moves diffrax's own RMS
# by 2e-9 and its peaks by 1e-6; the steps and with them the errors are not the same.
QUIET = {"foundation_rms": 1e-8, "foundation_mean": 1e-8, "foundation_peak": 5e-6}


@pytest.mark.parametrize(
    "choices",
    [
        {},
        {"slip": "surface", "contact_law": "flores", "impact_law": "tracked"},
        *slow({"joint": "ideal"}, {"formulation": "multiplier"}, {"contact_law": "rollers"}),
    ],
    ids=lambda choices: "-".join(choices.values()) or "paper",
)
def test_quiet_motions_agree_with_diffrax(choices):
    function = eqx.Partial(_row, choices={"start": "contact", **choices}, rtol=1e-9)
    _agree(function, _numbers(count=5), QUIET)


ON_SUPPORTS = ("transmitted_rms", "transmitted_peak", "left_peak", "frame_displacement_peak")
ON_SUPPORTS += ("frame_velocity_rms", "shaking_moment_rms", "foundation_rms")


def _on_supports(numbers):
    values = {"start": "contact", "foundation.mass": 4e3, "foundation.x": 0.2, **numbers}
    result = jc.statistics(jc.build_scene(values), 0, 1, outputs=ON_SUPPORTS, rtol=1e-9)
    return {**result.values, "success": result.success}


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_a_frame_on_supports_agrees_with_diffrax():
    # As above: peaks of samples feel rounding more than means.
    names = {name: 5e-6 if name.endswith("peak") else 1e-7 for name in ON_SUPPORTS}
    _agree(_on_supports, _numbers(count=3), names)


def _free(scene):
    # At 1e-9 a start one unit in the last place away moves diffrax's own RMS by 5e-8.
    result = jc.statistics(scene, 0, 1, rtol=1e-11)
    return {**result.values, "success": result.success}


@pytest.mark.slow
def test_a_free_shaft_agrees_with_diffrax():
    scenes = [jc.paper_scene(speed, 6e-5, start="contact") for speed in (28.0, 31.0, 34.0)]
    torque = GivenTorque(100.0, 30.0)
    scenes = stack([eqx.tree_at(lambda scene: scene.drive, one, torque) for one in scenes])
    _agree(_free, scenes, QUIET)


class Stepped(AbstractLoad):
    """A law of a user: a step for each tenth of a metre a second, and more the other way."""

    magnitude: jax.Array
    levels: jax.Array  # a whole number

    def force(self, jaw):
        velocity = jaw.velocity()
        steps = 0.1 * (self.levels * velocity.y).astype(int)
        sideways = 0.1 * jnp.tanh(10 * velocity.x) / jax.lax.div(self.levels, 4)
        return JawForce(-self.magnitude * (1 + steps + sideways) * jaw.axis)


def _rms(scene):
    result = jc.statistics(scene, 0, 1, rtol=1e-9)
    return {"foundation_rms": result.foundation_rms, "success": result.success}


@pytest.mark.slow
@pytest.mark.usefixtures("promoting")
@pytest.mark.filterwarnings("error")
def test_a_law_with_casts_and_whole_numbers_agrees_with_diffrax():
    load = Stepped(jnp.asarray(12239.0), jnp.asarray(10))
    scenes = [jc.paper_scene(speed, 12e-5, start="contact") for speed in (35.0, 40.0, 41.0)]
    scenes = stack([eqx.tree_at(lambda scene: scene.pushes[0], one, load) for one in scenes])
    # A step that crosses a jump is as good as rounding makes it: 3e-7. Without the cast the
    # force is another one, by 3e-3.
    _agree(_rms, scenes, {"foundation_rms": 1e-6})


@pytest.mark.slow
def test_sections_agree_with_diffrax():
    scenes = stack([jc.paper_scene(speed, 6e-5, start="contact") for speed in (28.0, 31.0, 34.0)])
    function = eqx.Partial(jc.poincare_section, settle_turns=1, turns=2)
    found = map_all(function, scenes, engine=in_lanes)
    exact = map_all(function, scenes, 8, in_turn)
    assert bool(found.success.all()) and found.states.shape == (3, 2, 4)
    # Rates of 0.02 m/s under an absolute tolerance of 1e-9 m/s a step.
    np.testing.assert_allclose(found.states, exact.states, rtol=0, atol=1e-7)


def _early(numbers, choices):
    """The foundation's force over the first 20 ms of impacts."""
    times = jnp.linspace(0, 0.02, 200)
    return jc.simulate(jc.build_scene({**numbers, **choices}), times, rtol=1e-12).foundation_force


@pytest.mark.slow
def test_impacts_agree_pointwise_at_first():
    function, numbers = eqx.Partial(_early, choices={"start": "centred"}), _numbers(count=3)
    found = map_all(function, numbers, engine=in_lanes)
    exact = map_all(function, numbers, 8, in_turn)
    # Impacts amplify errors: both are 5e-6 off at 1e-10, 6e-7 at 1e-11, and differ by 4e-8 here.
    np.testing.assert_allclose(found, exact, rtol=0, atol=2e-7 * np.abs(exact).max())


IMPACTS = ("B_force_peak", "B_impact_speed", "B_contact_fraction", "drive_torque_peak")


def _tracked(scene):
    """The first three impacts of the slider-crank, each of which sets its impact velocity."""
    method = resolve(scene, 1e-10)
    _, values, outcome = advance(Flow(scene), 0.5, method, scene.entries(IMPACTS))
    return {**values, "success": outcome.success}


def test_impacts_by_tracked_velocities_agree_with_diffrax():
    scene = jc.read_scene(Path(__file__).parents[2] / "examples" / "slider_crank.toml")
    cases = [eqx.tree_at(lambda s: s.drive.speed, scene, jnp.asarray(v)) for v in (480.0, 520.0)]
    # Parabolas through steps that rounding moves are 1e-5 off, and errors grow over the impacts.
    _agree(_tracked, stack(cases), dict.fromkeys(IMPACTS, 1e-4))


def test_lanes_are_the_default_and_need_no_set_up(recwarn, monkeypatch):
    function, numbers = eqx.Partial(_row, choices={"start": "centred"}, rtol=1e-6), _numbers()
    monkeypatch.setenv("XLA_FLAGS", OPTION)
    _equal(map_all(function, numbers), map_all(function, numbers, engine=in_lanes))
    assert [str(one.message) for one in recwarn] == []
