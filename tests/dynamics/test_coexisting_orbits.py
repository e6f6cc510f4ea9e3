"""The motions that many starts come to; orbits by shooting."""

from types import SimpleNamespace

import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.plane import Vector
from jaxcrusher.dynamics import coexisting_orbits as module
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.state import pins_of
from jaxcrusher.motion.flow import initial_state
from jaxcrusher.orbits.shot import shoot


@pytest.fixture(scope="module")
def found():
    return jc.coexisting_orbits(jc.paper_scene(40.0, 0.12e-3), starts=16, turns=400)


@pytest.mark.slow
def test_a_companion_of_two_turns(found):
    """Many starts come to it, the others swing about the quiet motion."""
    # The most frequent of each period: rarer ones lie round the quiet motion.
    loud, quiet = (next(o for o in found.orbits if o.period == period) for period in (2, 1))
    # Which of the two comes first is a matter of some starts, and of rounding.
    label = next(i for i, one in enumerate(found.orbits) if one is loud)
    # Four turns after 600 at three tolerances: 25 131.73 (1e-6), 25 129.0841 (1e-9), .08606.
    np.testing.assert_allclose(loud.foundation_rms, 25129.08606, atol=2e-4)
    np.testing.assert_allclose(quiet.foundation_rms, 22221.2840, atol=1e-3)
    assert loud.stable and quiet.stable
    # It leaves the bore for a moment each second turn.
    assert -0.003 < loud.least_penetration < 0 < quiet.least_penetration
    assert 0.99 < loud.contact_fraction < 1
    np.testing.assert_allclose(loud.foundation_peak, 61647, rtol=1e-3)
    # After 1000 turns six of ten starts; of these 16 a standard error is 0.12.
    assert 0.2 < found.shares[label] < 0.95
    assert sum(found.shares) + sum(found.unsettled.values()) == pytest.approx(1)
    assert "period 2: RMS 25129.09 N" in str(found)
    # Each start is kept, and what it came to. Rounding decides where a start between two basins
    # goes, so of those that came to the loud motion one of the three nearest has to.
    assert found.starts.shape == (16, 4) and found.labels.shape == (16,)
    assert np.mean(found.labels == label) == found.shares[label]
    starts = found.starts[found.labels == label]
    nearest = np.argsort(np.linalg.norm(starts - np.asarray(loud.section), axis=1))[:3]
    runs = (
        jc.poincare_section(
            loud.scene, 400, 20, state=start, outputs=("foundation_rms",), rtol=1e-7
        )
        for start in starts[nearest]
    )
    # It decays to 1/e in 36 turns.
    reached = (np.mean(run["foundation_rms"] ** 2) ** 0.5 for run in runs)
    assert any(value == pytest.approx(25129, rel=2e-3) for value in reached)


@pytest.mark.usefixtures("unchecked")  # no orbits are needed
def test_the_standard_error_of_a_share():
    """That of a beta distribution, here by its sampled standard deviation; never 0."""
    labels = np.array([0] * 12 + [1] * 3 + [-1])
    found = module.CoexistingOrbits((None, None, None), np.zeros((16, 4)), labels, {})
    assert found.shares == (0.75, 0.1875, 0.0)
    random = np.random.default_rng(0)
    for error, count in zip(found.share_errors, (12, 3, 0), strict=True):
        # A million samples leave a thousandth of a standard deviation.
        sampled = np.std(random.beta(count + 1, 17 - count, 1_000_000))
        np.testing.assert_allclose(error, sampled, rtol=5e-3)


@pytest.mark.slow
def test_shooting_from_nowhere_says_so():
    scene = jc.paper_scene(40.0, 0.12e-3)
    lost = shoot(scene, np.array([0.0, 0.0, 0.3, 0.0]), 1)
    assert not lost.success and "does not repeat" in lost.failure
    assert np.isnan(lost.foundation_rms) and np.isnan(lost.multipliers).all()


# Of a state of one joint.
PINS = np.array([0, 1])


def swinging(section, width, pace=3**0.5, turns=250):
    """Section points that go round those of an orbit."""
    phase = 2 * np.pi * pace * np.arange(turns)
    round_it = width * np.stack([np.cos(phase), np.sin(phase)], axis=1)
    return np.concatenate([np.resize(section, (turns, 2)) + round_it, 0 * round_it], axis=1)


def oscillation_about(*arguments):
    return module._shortest(module._oscillations(swinging(*arguments), PINS))


def test_what_a_motion_swings_about():
    """The shortest orbit that the points go round, and how wide; the swing's own turns are none."""
    one, two = np.array([[0.3, 0.4]]), np.array([[0.0, 0.0], [1.0, 0.0]])
    for section in (one, two):
        swing = oscillation_about(section, 0.05)
        # The mean of 120 points of a circle is that far from its middle.
        np.testing.assert_allclose(swing.centre[:, :2], section, atol=0.05 / 20)
        # A circle of radius r is r / sqrt(2) wide in each direction.
        np.testing.assert_allclose(swing.spread, 0.05 / np.sqrt(2), rtol=0.01)
        # An orbit that far off is none that it swings about: a quarter of the spread is allowed.
        assert swing.is_about(section) and swing.is_about(section[::-1])
        assert not swing.is_about(section + 0.02)
    # Locked to the turn five to twelve: it repeats, but after no less than twelve.
    assert len(oscillation_about(one, 0.05, 5 / 12).centre) == module.CYCLE
    repeated = oscillation_about(one, 0.05, 1 / 3)
    assert len(repeated.centre) == 3 and repeated.spread < 1e-12


class Orbit:
    """As much of one as the bookkeeping asks for."""

    scene = SimpleNamespace(headline="foundation_rms")

    def __getitem__(self, name):
        return getattr(self, name)

    def __init__(self, section, stable=True, least=0.02):
        self.section, self.stable, self.least_penetration = np.asarray(section), stable, least
        self.period, self.foundation_rms = len(section), 1.0 + np.sum(section)

    def state(self, angle):
        """Of one joint, at the beginning of a turn."""
        at = Vector(*self.section[round(angle / 2 / np.pi)])
        parts = SimpleNamespace(eccentricities=Named({"main": at}))
        return SimpleNamespace(parts=parts)


@pytest.mark.usefixtures("unchecked")  # what stands for scene and orbits is none
def test_known_orbits_are_not_shot_for_again(monkeypatch):
    one, two = [[0.3, 0.4]], [[0.0, 0.0], [1.0, 0.0]]
    shots = []

    def shoot(scene, guess, period):
        shots.append(guess)
        return Orbit(two, stable=len(shots) > 2)

    monkeypatch.setattr(module, "shoot", shoot)
    known = module._Known(None, [Orbit(one)])
    wide = oscillation_about(one, 0.05)
    assert known.about(wide, 0.1) == 0 and not known.surely_decays(0, wide)
    narrow = oscillation_about(one, 0.015)
    # It keeps contact, which is 0.02 clearances deep.
    assert known.about(narrow, 0.1) == 0 and known.surely_decays(0, narrow)
    other = oscillation_about(two, 1e-4)
    assert known.about(other, 0.0) is None and not shots
    # In vain, from each of its turns, then not again; from another place it is found.
    assert known.about(other, 0.1) is None and known.about(other, 0.1) is None
    assert len(shots) == 2
    beside = oscillation_about(np.array(two) + 0.01, 1e-4)
    assert known.about(beside, 0.1) == 1 and len(known.orbits) == 2
    assert known.about(other, 0.1) == 1 and len(shots) == 3
    # Turn and turn about.
    late = oscillation_about(two[::-1], 1e-4)
    assert known.about(late, 0.1) == 1 and len(shots) == 3
    # What still swings belongs to the orbit that it swings about less than before, also where it
    # is in step with the shaft for a while; not what swings on.
    for pace in (np.sqrt(3), 1 / 3):
        before, now = (
            module._oscillations(swinging(one, width, pace), PINS) for width in (0.06, 0.05)
        )
        assert known.approached(before, now) == 0
        assert known.approached(now, now) is None
    far = module._oscillations(swinging([[0.6, 0.4]], 0.05), PINS)
    assert known.approached(before, far) is None


@pytest.mark.usefixtures("unchecked")  # what stands for scene and orbits is none
def test_an_orbit_is_one_whichever_of_its_turns_it_was_shot_over(monkeypatch):
    """An orbit of one turn that a swing in step with every other turn was shot for, first."""
    twice, once = Orbit([[0.1, 0.0], [0.1, 0.0]]), Orbit([[0.1, 0.0]])
    once.foundation_rms = twice.foundation_rms
    monkeypatch.setattr(module, "shoot", lambda scene, guess, period: once)
    known = module._Known(None, [twice])
    assert known.about(oscillation_about(once.section, 1e-4), 0.1) == 0
    assert len(known.orbits) == 1


@pytest.mark.usefixtures("unchecked")  # what stands for orbits is none
def test_orbits_that_are_mirror_images_are_two():
    """All statistics of the two are equal."""
    here, there = Orbit([[0.5, 0.0], [-0.2, 0.0]]), Orbit([[-0.5, 0.0], [0.2, 0.0]])
    again = Orbit([[-0.2, 0.0], [0.5, 0.0]] * 2)
    there.foundation_rms = again.foundation_rms = here.foundation_rms
    assert module._same(here, again) and module._same(again, here)
    assert not module._same(here, there) and not module._same(again, there)


@pytest.mark.usefixtures("unchecked")  # what stands for the orbit is none
def test_starts_whose_runs_fail_come_to_no_orbit(monkeypatch):
    def failing(function, cases, chunk, **_):
        states, _ = cases
        return states[:, None], {}, SimpleNamespace(success=np.zeros(len(states), bool))

    monkeypatch.setattr(module, "run_all", failing)
    none = Orbit([[0.0, 0.0]], stable=False)
    monkeypatch.setattr(module, "periodic_orbit", lambda scene, effort: none)
    found = jc.coexisting_orbits(jc.paper_scene(30.0, 0.06e-3), starts=3)
    assert found.labels.tolist() == [-1, -1, -1] and not found.orbits


def test_refusals():
    with pytest.raises(ValueError, match="have a joint with clearance"):
        jc.coexisting_orbits(jc.ideal_scene(30.0))
    with pytest.raises(ValueError, match="`spread` must be finite and > 0"):
        jc.coexisting_orbits(jc.paper_scene(30.0, 0.06e-3), spread=0.0)
    with pytest.raises(ValueError, match="`turns` must be a whole number >= 96"):
        jc.coexisting_orbits(jc.paper_scene(30.0, 0.06e-3), turns=95)


@pytest.mark.slow
def test_what_was_found_can_be_handed_back(found):
    """The loud motion leaves the bore: shooting goes on from its section point."""
    loud = next(orbit for orbit in found.orbits if orbit.period == 2)
    again = jc.periodic_orbit(loud.scene, guess=loud)
    assert again.stable and again.period == 2
    # Both close to 1e-7 clearances.
    np.testing.assert_allclose(again.foundation_rms, loud.foundation_rms, rtol=1e-7)


@pytest.mark.slow
def test_a_frame_on_springs_is_no_joint():
    """All starts of a quiet machine on its block come to the orbit that Newton's method finds."""
    block = {"foundation.mass": 6000.0, "speed": 27.0, "clearance": 0.05e-3}
    scene = jc.build_scene(block)
    found = jc.coexisting_orbits(scene, starts=4, turns=96)
    assert found.shares == (1.0,) and len(found.orbits) == 1
    (orbit,) = found.orbits
    # Four numbers of the joint, and six of the frame, of which none is a place of a pin.
    assert orbit.section.shape == (10,)
    assert pins_of(scene).tolist() == [0, 1]


SEATS = {"elbow.clearance": 6e-5, "load_law": "normal_to_jaw", "restitution": 0.7}


@pytest.mark.parametrize(
    ("choices", "pins"),
    [
        ({}, [0, 1, 4, 5]),
        ({"impact_law": "tracked"}, [0, 1, 5, 6]),
        ({"elbow.impact_law": "tracked"}, [0, 1, 4, 5]),
        ({"impact_law": "tracked", "foundation.mass": 6e3}, [0, 1, 5, 6]),
    ],
)
def test_a_shift_of_pins_moves_no_memory(choices, pins):
    """States hold the joints one after the other, each with its memory behind its rates."""
    scene = jc.build_scene(SEATS | choices)
    start = np.asarray(initial_state(scene))
    begun = module._shifted(scene, pins_of(scene), 40, 0.3, 0)
    assert pins_of(scene).tolist() == pins
    moved = np.abs(begun - start).max(axis=0) > 0
    assert np.flatnonzero(moved).tolist() == pins
    # Up to 0.3 clearances in any direction, evenly over the disc.
    radii = np.linalg.norm((begun - start)[:, pins].reshape(40, 2, 2), axis=2)
    assert radii.max() < 0.3 and radii.mean() == pytest.approx(0.2, rel=0.1)


@pytest.mark.slow
def test_motions_with_memories_come_to_the_orbit_of_those_without():
    """Their pins stay in contact, where a memory rests and changes the orbit by nothing."""
    for law in ("tracked", "constant"):
        laws = {"impact_law": law, "elbow.impact_law": law, "elbow.restitution": 0.7}
        scene = jc.build_scene(SEATS | laws)
        found = jc.coexisting_orbits(scene, starts=6, spread=0.05, turns=400)
        assert found.shares == (1.0,)
        # Their damping differs: a thousandth of the force, and out of phase with it.
        assert float(found.orbits[0].foundation_rms) == pytest.approx(15834.85, rel=1e-6)
