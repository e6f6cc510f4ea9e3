"""Results by name: what was asked for is there, and what was not says so."""

import copy
import pickle

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.motion.section import Section


@pytest.fixture(scope="module")
def results():
    scene = jc.ideal_scene(30.0)
    motion = jc.simulate(scene, [0.0, 0.1], outputs=("drive_torque",))
    return motion, jc.statistics(scene, 0, 1, outputs=("foundation_mean",))


def test_what_was_asked_for_is_there(results):
    motion, summary = results
    assert motion.drive_torque.shape == (2,) and motion["drive_torque"] is motion.drive_torque
    assert [*summary.values] == ["foundation_mean"] and summary.foundation_mean.shape == ()
    assert [*motion] == ["drive_torque"] and "winding" not in motion
    assert "drive_torque" in dir(motion) and "success" in dir(motion)
    section = Section(
        jnp.zeros((2, 4)), jnp.zeros((0, 4, 4)), motion.outcome, {"winding": jnp.ones(2)}
    )
    assert section.winding.sum() == 2 and section.slices == 0


def test_a_displacement_begins_at_zero():
    motion = jc.simulate(jc.ideal_scene(30.0), [0.0, 0.05, 0.1], outputs=("jaw_position",))
    moved = np.asarray(motion.jaw_displacement)
    assert (moved[0] == 0).all() and (moved[1] != 0).all()
    np.testing.assert_array_equal(moved, motion.jaw_position - motion.jaw_position[:1])


def test_print_shows_numbers_and_units(results):
    motion, summary = results
    mean = float(summary.foundation_mean) / 1e3
    row = f"foundation_mean  {mean:.4g} kN  mean of |R_O| + |R_C|"
    assert str(summary) == f"Statistics: 1 turn, inside the contact model\n  {row}"
    title, row = str(motion).splitlines()
    assert title == "Trajectory: 2 times from 0 to 0.1 s"
    assert row.startswith("  drive_torque  ") and row.endswith(" N m, shape (2,)  drive torque")
    # Of what is not by name too: a result in words, and a whole number.
    outcome = " ".join(str(motion.outcome).split())
    assert "RESULTS<>, reached=" in outcome and f"steps={int(motion.outcome.steps)}" in outcome


def test_what_was_not_asked_for_says_so(results):
    motion, summary = results
    for result, name in ((motion, "normal_force"), (summary, "drive_power")):
        words = f"^`{name}` was not asked for: name it in `outputs`.$"
        with pytest.raises(AttributeError, match=words):
            getattr(result, name)
        with pytest.raises(KeyError, match=words[1:-1]):
            result[name]
        assert not hasattr(result, name) and getattr(result, name, None) is None
    with pytest.raises(
        AttributeError, match=r"^There is no `foundation_rsm`, but foundation_mean\.$"
    ):
        _ = summary.foundation_rsm
    # What is made of others names the one that is missing.
    for result, name, missing in (
        (motion, "energy", "energy"),
        (motion, "jaw_displacement", "jaw_position"),
        (motion, "contact_fraction", "penetration_ratio"),
        (summary, "whirl", "contact_fraction"),
        (summary, "foundation_rms_error", "foundation_rms"),
    ):
        with pytest.raises(KeyError, match=f"`{missing}` was not asked for"):
            getattr(result, name)
    # An ideal joint has no contact of which something could be missing.
    assert summary.validity.verdict() == "inside the contact model"


def test_a_linkage_offers_nothing_that_is_made_of_a_crusher_s():
    motion = jc.simulate(jc.read_scene("examples/four_bar.toml"), [0.0], outputs=("drive_power",))
    for name in ("jaw_displacement", "contact_fraction"):
        assert name not in dir(motion) and not hasattr(motion, name)
        with pytest.raises(AttributeError, match=f"^There is no `{name}`, but drive_power"):
            getattr(motion, name)


def test_results_are_pytrees_that_can_be_copied_and_kept(results):
    for result in results:
        for other in (
            jax.tree.map(lambda leaf: leaf, result),
            copy.deepcopy(result),
            pickle.loads(pickle.dumps(result)),
        ):
            assert type(other) is type(result)
            for name in result.values:
                np.testing.assert_array_equal(other[name], result[name])


def test_what_follows_from_a_batch_is_that_of_each_motion():
    """Changes since each motion's own begin, and statistics over its own turns."""
    speeds, times = jnp.array([28.0, 30.0, 33.0]), jnp.array([0.0, 0.02, 0.04])

    def moved(speed):
        outputs = ("jaw_position", "energy")
        return jc.simulate(jc.ideal_scene(speed), times, outputs=outputs)

    def cut(speed):
        scene = jc.paper_scene(speed, 0.06e-3, start="contact")
        return jc.poincare_section(scene, 0, 2, outputs=("foundation_rms",), slices=2, rtol=1e-6)

    motions, sections = jax.vmap(moved)(speeds), jax.vmap(cut)(speeds)
    whole = sections.statistics
    assert sections.slices == 2 and whole.turns == 2
    for i, speed in enumerate(speeds):
        one = moved(speed)
        # Rounding of programs for one and for three, in m, J and shares.
        np.testing.assert_allclose(motions.jaw_displacement[i], one.jaw_displacement, atol=1e-12)
        np.testing.assert_allclose(motions.energy.imbalance[i], one.energy.imbalance, atol=1e-6)
        rms = cut(speed).statistics.foundation_rms
        assert float(whole.foundation_rms[i]) == pytest.approx(float(rms), rel=1e-6)


def test_a_batch_of_orbits_is_not_taken_for_one():
    """Its first axis would be taken for that of the nodes."""
    orbits = jax.vmap(lambda speed: jc.periodic_orbit(jc.ideal_scene(speed)))(
        jnp.array([28.0, 30.0])
    )
    for asked in (lambda: orbits.motion(np.zeros(1)), orbits.state, lambda: orbits.alike):
        with pytest.raises(
            ValueError, match=r"^Argument `orbit` must be one orbit, but is a batch"
        ):
            asked()
    each = jax.vmap(lambda one: one.motion(jnp.zeros(1), ("drive_torque",))["drive_torque"])
    assert each(orbits).shape == (2, 1)
