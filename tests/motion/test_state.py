"""A motion goes on from the state of another as if it had not stopped."""

from dataclasses import fields, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

import jaxcrusher as jc
from jaxcrusher.joint.clearance import ClearanceJoint
from jaxcrusher.mechanism.drives import GivenTorque
from jaxcrusher.mechanism.state import pins_of, places_of
from jaxcrusher.motion.flow import initial_state
from tests.crusher.kinds import placed

RMS = "foundation_rms"
OUTPUTS = (RMS, "winding")


def quiet(**values):
    return jc.paper_scene(30.0, 0.06e-3, start="contact", **values)


def free():
    """A shaft that nothing holds at its speed."""
    return eqx.tree_at(lambda s: s.drive, quiet(), GivenTorque(100.0, 30.0))


@pytest.mark.parametrize(
    ("scene", "dims", "rtol"),
    [
        # What steps of 1e-9 leave in quiet motion: states were up to 2e-8 apart.
        (quiet(), 4, 1e-7),
        pytest.param(quiet(impact_law="tracked"), 5, 1e-7, marks=pytest.mark.slow),
        (free(), 6, 1e-7),
        # Its tolerance is 2e-14 m at best, 3e-10 clearances a step; three thousand steps.
        pytest.param(quiet(formulation="multiplier"), 18, 1e-4, marks=pytest.mark.slow),
        # The mean alone is integrated, to 1e-9.
        (jc.ideal_scene(30.0), 0, 1e-8),
    ],
    ids=["prescribed speed", "tracked impact velocity", "free shaft", "multiplier", "ideal"],
)
def test_a_motion_goes_on(scene, dims, rtol):
    """Turn by turn, each from the state of the last, as three turns in one go."""
    whole = jc.statistics(scene, 0, 3, outputs=OUTPUTS)
    state = initial_state(scene)
    assert state.shape == (dims,)
    for turn in range(3):
        one = jc.statistics(scene, 0, 1, outputs=OUTPUTS, state=state)
        for name in OUTPUTS:
            np.testing.assert_allclose(one[name], whole.by_turn[name][turn], rtol=rtol, atol=rtol)
        state = one.state
    np.testing.assert_allclose(state, whole.state, rtol=0, atol=10 * rtol)
    if dims in (4, 18):
        # The multiplier form's crank angle is a coordinate: it must not be a turn ahead.
        # Turns to settle are a loop of their own, which is large in the multiplier form.
        settle = 1 if dims == 4 else 0
        section = jc.poincare_section(scene, settle, 3 - settle, outputs=OUTPUTS)
        np.testing.assert_allclose(section.foundation_rms, whole.by_turn[RMS][settle:], rtol=rtol)
        np.testing.assert_allclose(section.state, whole.state, rtol=0, atol=10 * rtol)
    if dims == 6:
        # No turn of a shaft that gathers speed is like the first.
        assert float(one.foundation_rms) > 2 * float(whole.by_turn[RMS][0])


class Wearing(ClearanceJoint):
    """It remembers what its damping and its friction took, J, beside a tracked impact velocity."""

    def initial_memory(self):
        """Return nothing taken, and the velocity."""
        none = jnp.zeros_like(self.clearance)
        return {"damping": none, "friction": none, "velocity": super().initial_memory()}

    def contact(self, eccentricity, rate, bearing_spin, journal_spin, memory):
        """Return the contact by the velocity."""
        spins = bearing_spin, journal_spin
        return super().contact(eccentricity, rate, *spins, memory["velocity"])

    def memory_rate(self, contact, memory):
        """Return the powers that are taken, and the rate of the velocity."""
        velocity = super().memory_rate(contact, memory["velocity"])
        taken = {"damping": contact.normal_loss, "friction": contact.friction_loss}
        return taken | {"velocity": velocity}


def wearing(**values):
    """Return a scene with such a bearing in A, and with the same one that remembers less."""
    plain = jc.build_scene({"impact_law": "tracked", **values})
    joint = plain.joints.at("main")
    parts = (getattr(joint, one.name) for one in fields(joint))
    return eqx.tree_at(lambda s: s.joints.at("main"), plain, Wearing(*parts)), plain


def test_a_bearing_owns_its_memory():
    """It is integrated with the motion, changes nothing of it, and all find it in its place."""
    scene, plain = wearing(slip="surface")
    found, other = (jc.statistics(one, 0, 1, outputs=(RMS,), rtol=1e-11) for one in (scene, plain))
    places, pins = places_of(scene), pins_of(scene)
    assert found.state.shape == (7,) and pins.tolist() == [0, 1]
    memory = places.memories.at("main") | {
        "velocity": places.memories.at("main")["velocity"].impact
    }
    memory = {n: float(found.state[at]) for n, at in memory.items()}
    # The ledger of a motion without that memory integrates the same powers. The memory weighs in
    # the error of a step: steps differ, and some dozen impacts make 1e4 times as much of 1e-11.
    times = np.array([0.0, 2 * np.pi / float(scene.drive.speed)])
    ledger = jc.simulate(plain, times, outputs=("energy",), rtol=1e-11).energy
    assert memory["damping"] == pytest.approx(float(ledger.contact_loss[-1]), rel=1e-6)
    assert memory["friction"] == pytest.approx(float(ledger.friction_loss[-1]), rel=1e-6)
    np.testing.assert_allclose(found.foundation_rms, other.foundation_rms, rtol=1e-6)
    np.testing.assert_allclose(found.state[pins], other.state[pins_of(plain)], rtol=0, atol=1e-6)
    assert memory["velocity"] == pytest.approx(float(other.state[4]), rel=1e-6)
    assert min(memory.values()) > 1e-3


def test_a_memory_stands_behind_its_own_joint_s_rates_in_both_formulations():
    found = []
    for formulation, pins in (("eccentricity", [0, 1, 7, 8]), ("multiplier", [])):
        values = {"slip": "surface", "elbow.clearance": 1e-4, "formulation": formulation}
        scene = placed(wearing(**values)[0], ((-0.9, -0.6), (0.5, 0.9)))
        places, state = places_of(scene), scene.formulation.initial(scene)
        assert pins_of(scene).tolist() == pins and places.memories.names == ("main",)
        snapshot = scene.formulation.snapshot(jnp.zeros(()), state, scene)
        rate, _ = ravel_pytree(scene.formulation.rate(snapshot, state, scene))
        memory, touch = places.memories.at("main"), snapshot.contacts.at("main")
        found.append([float(rate[memory[name]]) for name in ("damping", "friction")])
        assert found[-1] == [float(touch.normal_loss), float(touch.friction_loss)]
    # The multiplier form knows a penetration of some 1e-6 m to 1e-15 m.
    np.testing.assert_allclose(*found, rtol=1e-8)
    assert min(map(abs, found[0])) > 1.0
    with pytest.raises(ValueError, match="must have bearings without a memory, but one remembers"):
        jc.periodic_orbit(wearing(impact_law="constant")[0])


def test_histories_go_on():
    scene, turn = quiet(), 2 * np.pi / 30
    times = np.linspace(0, turn, 101)
    start = initial_state(scene)
    whole = jc.simulate(scene, times + turn, outputs=("foundation_force",), rtol=1e-9, state=start)
    state = jc.statistics(scene, 0, 1, outputs=OUTPUTS, state=start).state
    further = jc.simulate(scene, times, outputs=("foundation_force",), rtol=1e-9, state=state)
    # A swing of 1e-7 clearances times the contact's stiffness.
    np.testing.assert_allclose(further.foundation_force, whole.foundation_force, rtol=1e-5)


@pytest.mark.slow
def test_slopes_by_the_state():
    """The derivative by the state that a turn begins with is the section's Jacobian."""
    scene = quiet()

    def end(state):
        return jc.statistics(scene, 0, 1, outputs=(RMS,), state=state).state

    start = initial_state(scene)
    expected = jc.poincare_section(scene, 0, 1, slices=1, state=start).jacobians[0]
    # The same tangents, to the tolerance.
    np.testing.assert_allclose(jax.jacfwd(end)(start), expected, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("run", [jc.statistics, jc.poincare_section, jc.simulate])
def test_a_state_of_another_shape_is_refused(run):
    arguments = ([0.0, 0.1],) if run is jc.simulate else (0, 1)
    with pytest.raises(
        ValueError, match=r"^Argument `state` must have shape \(4,\), but is \(5,\)"
    ):
        run(quiet(), *arguments, state=np.zeros(5))


def test_a_free_shaft_has_no_section():
    with pytest.raises(ValueError, match=r"^Argument `scene` must have a shaft of constant speed"):
        jc.poincare_section(free(), 0, 1, state=np.zeros(6))


def test_ideal_joints_in_a_clamped_frame_have_no_state():
    """Their sections are empty, also where nothing is asked, and they have no regime."""
    scene = jc.ideal_scene(30.0)
    assert jc.poincare_section(scene, 1, 2).states.shape == (2, 0)
    with pytest.raises(ValueError, match="`slices` must be 0 for ideal joints in a clamped frame"):
        jc.poincare_section(scene, 1, 2, slices=2)
    assert bool(jc.statistics(scene, 0, 1, outputs=()).success)
    with pytest.raises(ValueError, match=r"^Argument `scene` must have a joint with clearance"):
        jc.regime(scene, 0, 20)


def test_friction_that_does_not_hold_a_shaft_at_rest_says_so():
    """Without a torque the shaft stops, and creeps on by less than the full friction."""
    outputs = ("penetration_ratio", "impact_speed", "shaft_speed_least")
    for torque, stops in ((0.0, True), (3e3, False)):
        scene = replace(quiet(slip="surface"), drive=GivenTorque(torque, 30.0))
        assert set(outputs) < set(scene.usual_statistics) & set(scene.statistics)
        found = jc.statistics(scene, 0, 1, outputs=outputs)
        assert (float(found.shaft_speed_least) < 0) == stops
        limits = found.validity
        assert bool(limits.others["shaft"].inside) != stops
        assert any(line.startswith("shaft: comes to rest") for line in limits.remarks()) == stops
    # The friction of rollers turns round at rest too.
    rolling = replace(jc.build_scene({"contact_law": "rollers"}), drive=GivenTorque(0.0, 30.0))
    assert "shaft_speed_least" in rolling.usual_statistics and "shaft" in rolling.limits
    # What cannot rest, or has no friction that would hold it.
    for scene in (quiet(slip="surface"), replace(quiet(friction=0), drive=GivenTorque(0.0, 30.0))):
        assert "shaft_speed_least" not in {*scene.usual_statistics, *scene.statistics}
