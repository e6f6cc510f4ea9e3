"""Every design gets an answer: an orbit by some way, or what the motion does instead."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.integrate import Outcome
from jaxcrusher.motion.indicators import CHAOS
from jaxcrusher.motion.section import fine
from jaxcrusher.orbits import search as searches
from jaxcrusher.orbits import transient
from jaxcrusher.orbits.effort import EFFORTS, Budget
from jaxcrusher.orbits.result import RESULTS, WAYS, missing
from jaxcrusher.orbits.search import (
    Attempt,
    OrbitSearch,
    first_stable,
    searched,
    with_doubled,
)
from jaxcrusher.orbits.solving import orbit_nodes
from jaxcrusher.orbits.transient import Round, Transient, resting_start
from jaxcrusher.periodic import newton
from jaxcrusher.periodic.multipliers import UNSURE
from jaxcrusher.periodic.trigonometric import resample

# Near a harmonic of the drive Newton's method fails from rest. RMS of 20 turns after 3000 from the
# start in contact, at a tolerance of 1e-9, by the integrator.
TONGUES = [(33.457, 0.10988e-3, 19563.158876), (36.882, 0.08524e-3, 20609.260234)]


def rms(speed, clearance):
    return jc.periodic_orbit(jc.paper_scene(speed, clearance, slip="surface")).foundation_rms


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "clearance", "waited"), TONGUES)
def test_a_damping_is_lowered_where_rest_is_too_far(speed, clearance, waited):
    orbit = jc.periodic_orbit(jc.paper_scene(speed, clearance, slip="surface"))
    assert orbit.stable and orbit.found == "from the pins at rest, by a damping lowered to none"
    # The runs' tolerance leaves 1e-10.
    assert float(orbit.foundation_rms) == pytest.approx(waited, rel=1e-9)
    again = jc.periodic_orbit(jc.paper_scene(speed, clearance, slip="surface"))
    for one, other in zip(jax.tree.leaves(orbit), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.slow
def test_where_motions_coexist_the_answer_is_what_the_machine_comes_to():
    """A damping leads to a quieter motion, of 20 931.5 N, to which no start near rest comes."""
    scene = jc.paper_scene(37.8047, 0.094538e-3, slip="surface")
    orbit = jc.periodic_orbit(scene)
    assert orbit.stable and orbit.found == "from the mean of turns that were waited for"
    # RMS of 20 turns after 3000 by the integrator, within what the nodes know of it.
    assert orbit.error < 1e-6
    assert float(orbit.foundation_rms) == pytest.approx(21113.789507, rel=float(orbit.error))
    quiet = jc.periodic_orbit(scene, nodes=384)
    assert quiet.stable and float(quiet.foundation_rms) == pytest.approx(20931.5, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("impact_velocity", [1e-4, 1e-6])
def test_multipliers_of_a_contact_that_damps_too_fast_for_the_usual_steps(impact_velocity):
    """A small impact velocity damps a contact to rest within a thousandth of a turn."""
    scene = jc.paper_scene(30.0, 0.06e-3, impact_velocity=impact_velocity)
    usual = jc.periodic_orbit(scene, nodes=96)
    assert usual.stable and usual.multipliers_error < UNSURE
    found, _ = orbit_nodes(scene, None, 1, 96)
    # What `jax.jit` has, by steps of the shortest length: little where it is least.
    assert bool(found.multipliers.error < UNSURE) == (impact_velocity > 1e-5)
    # By the integrator, slice by slice; at this tolerance it leaves 1e-8 of the largest.
    section = jc.poincare_section(scene, 0, 1, slices=64, state=usual.section, rtol=1e-10)
    matrix = np.eye(4)
    for jacobian in np.asarray(section.jacobians):
        matrix = jacobian @ matrix
    largest = np.max(np.abs(np.linalg.eigvals(matrix)))
    assert float(usual.largest_multiplier) == pytest.approx(largest, rel=1e-6)


@pytest.mark.slow
def test_slopes_of_an_orbit_that_took_the_long_way():
    """By the equations themselves, eagerly and under `jax.jit`, which lowers the same damping."""
    speed, clearance, waited = TONGUES[0]
    slope = jax.grad(rms, argnums=1)(speed, clearance)
    value, traced = jax.jit(jax.value_and_grad(rms, argnums=1))(speed, clearance)
    assert float(value) == pytest.approx(waited, rel=1e-9)
    assert float(traced) == pytest.approx(float(slope), rel=1e-6)
    # Central differences over 1 nm: 19 563.1588742 N is known to 1e-11, which leaves 2e-5 of it.
    assert float(slope) == pytest.approx(-201103.0, rel=5e-5)


@pytest.mark.slow
def test_a_guess_is_not_left_for_the_pins_at_rest_under_jit():
    """The fixed tries of a traced call: its guess, or rest and the damping."""
    speed, clearance, _ = TONGUES[0]
    scene, far = jc.paper_scene(speed, clearance, slip="surface"), jnp.full((96, 2), 0.1)

    @jax.jit
    def found(scene, guess):
        return jc.periodic_orbit(scene, nodes=96, guess=guess)

    failed, orbit = found(scene, far), found(scene, jnp.full((96, 2), jnp.nan))
    assert not failed.success and np.isnan(failed.foundation_rms)
    assert orbit.success and orbit.found.endswith("by a damping lowered to none")


def test_the_first_stable_orbit_is_the_answer():
    """An unstable orbit that is found first is kept for the case that no try finds another."""
    scene = jc.paper_scene(27.0, 0.05e-3)
    stable = jc.periodic_orbit(scene, nodes=96)
    unstable = dataclasses.replace(stable, multipliers=2 * stable.multipliers, way=WAYS.guess)
    none = dataclasses.replace(stable, result=RESULTS.not_closed)
    made = {"stable": stable, "unstable": unstable, "none": none}

    def answer(*names):
        return first_stable(Attempt(made[name], made[name]) for name in names)

    assert answer("none", "unstable", "stable", "none").way == WAYS.rest
    assert answer("none", "unstable", "none").way == WAYS.guess
    assert not answer("none", "none").success


def test_nodes_are_doubled_until_the_orbit_is_closed():
    """The last ones say so where it is not; how it was found is what the first nodes say."""
    scene, asked = jc.paper_scene(27.0, 0.05e-3), []
    stable = jc.periodic_orbit(scene, nodes=96)
    beside = dataclasses.replace(stable, section=stable.section + 0.1)
    names = ["way", "closure"]
    Found = dataclasses.make_dataclass("Found", names, namespace={"doubted": False})

    def answer(*closures):
        class Search(OrbitSearch):
            def by_so_many(self, guess, turns, count):
                way, closure = WAYS.guess if asked else WAYS.damping, closures[len(asked)]
                asked.append(count)
                return Attempt(beside, beside), Found(way, jnp.array(closure))

            def with_multipliers(self, found, nodes):
                return found

        asked.clear()
        return Search(scene, scene, None, None, None, Budget("usual")).by_nodes(None, 1).orbit

    orbit = answer(1e-3, 0.0)
    assert asked == [96, 192] and orbit.success and orbit.way == WAYS.damping
    orbit = answer(1e-3, 1e-3, 1e-3)
    assert asked == [96, 192, 384] and orbit.result == RESULTS.not_closed


def test_a_section_point_that_keeps_contact_is_solved_for_by_nodes(monkeypatch):
    """Shooting, a long program, is for what these nodes do not resolve."""
    scene, asked = jc.paper_scene(27.0, 0.05e-3), []
    stable = jc.periodic_orbit(scene, nodes=96)
    none = dataclasses.replace(stable, result=RESULTS.unresolved)

    class Search(OrbitSearch):
        def by_nodes(self, guess, turns, count, most=None):
            asked.append(count)
            # A turn's tolerance of 1e-8, over 1 less the largest multiplier, which is 0.9996.
            found = resample(jnp.asarray(guess), 96)
            np.testing.assert_allclose(found, stable.eccentricity, atol=2.5e-5)
            return Attempt(stable, stable)

        def by_shooting(self, start, turns):
            asked.append("shot")
            return Attempt(stable, stable)

    search = Search(scene, scene, None, None, None, Budget("usual"))
    beside = stable.section + jnp.array([1e-3, 0.0, 0.0, 0.0])
    (found,) = search.by_shots(beside, 1, WAYS.waiting)
    assert found.orbit.way == WAYS.waiting and asked == [192]
    # What leaves its bore is shot for, and so is what nodes do not resolve.
    path = np.asarray(resample(stable.eccentricity, 1024))
    for bent, orbit, expected in ((2.0, stable, ["shot"]), (0.0, none, [192, "shot"])):
        wave = bent * np.cos(2 * np.pi * 120 * np.arange(1024) / 1024)[:, None]
        one = searches.Followed(stable.section, jnp.asarray(path + wave), fine())
        monkeypatch.setattr(searches, "followed", lambda *_, one=one: one)
        monkeypatch.setattr(
            Search, "by_nodes", lambda *a, o=orbit: asked.append(a[3]) or Attempt(o, o)
        )
        asked.clear()
        list(search.by_shots(stable.section, 1, WAYS.waiting))
        assert asked == expected


def test_newtons_method_comes_to_the_section_point_of_an_orbit():
    """With the slopes of one turn and of two, and its slopes are those of the multipliers."""
    scene = jc.paper_scene(30.0, 0.06e-3)
    orbit = jc.periodic_orbit(scene, nodes=96)
    search = OrbitSearch(scene, scene, None, None, None, Budget("usual"))
    for turns in (1, 2):
        found = search.approached(orbit.section + jnp.array([1e-3, -1e-3, 0.0, 0.0]), turns)
        # A turn's tolerance of 1e-8, over 1 less the largest multiplier, which is 0.99993.
        np.testing.assert_allclose(found.point, orbit.section, atol=1.4e-4)
        largest = np.max(np.abs(np.linalg.eigvals(np.asarray(found.jacobian) + np.eye(4))))
        # Differences leave 1e-4 of a slope.
        assert largest == pytest.approx(float(orbit.largest_multiplier) ** turns, abs=1e-3)
    assert search.budget.steps > 1000
    assert search.approached(jnp.full(4, 50.0), 1) is None


def test_twice_the_turns_are_shot_for_once_beside_an_orbit_that_doubles():
    """A call that asks for a period, and an orbit that does not double, are left as they are."""
    scene = jc.paper_scene(27.0, 0.05e-3)
    stable, beside = jc.periodic_orbit(scene, nodes=96), []
    doubles = dataclasses.replace(stable, multipliers=jnp.full(4, -2 + 0j))
    twice = dataclasses.replace(stable, way=WAYS.doubling)

    def answer(orbit, found, period=None):
        class Search(OrbitSearch):
            def doubled(self, orbit):
                beside.append(orbit)
                yield Attempt(found, found)

        beside.clear()
        search = Search(scene, scene, None, None, period, Budget("thorough"))
        return first_stable(with_doubled(search, [Attempt(orbit, orbit)] * 2)), len(beside)

    orbit, count = answer(doubles, twice)
    assert orbit.way == WAYS.doubling and count == 1
    orbit, count = answer(doubles, twice, period=1)
    assert not orbit.stable and count == 0
    turning = dataclasses.replace(stable, multipliers=stable.multipliers * 2j)
    assert answer(turning, twice)[1] == 0
    none = dataclasses.replace(stable, result=RESULTS.not_closed)
    orbit, count = answer(doubles, none)
    assert (
        orbit.way == WAYS.rest and count == 1
    )  # the same orbit, found again, is not doubled again


@pytest.mark.slow
@pytest.mark.optimised
def test_an_orbit_that_has_doubled_leads_to_that_of_twice_the_turns():
    """Between two doublings 0.0003 rad/s apart; by random starts 20 927.9590 N."""
    scene = jc.paper_scene(36.5455, 0.11293e-3)
    orbit = jc.periodic_orbit(scene)
    assert orbit.stable and orbit.period == 2 and orbit.way == WAYS.doubling
    assert float(orbit.foundation_rms) == pytest.approx(20927.959, abs=1e-3)
    single = jc.periodic_orbit(scene, period=1, nodes=96)
    assert single.instability.endswith("so the motion repeats after 2 turns or more.")
    # From rest the nodes would lead to the orbit of one turn, 0.07 N below.
    again = jc.periodic_orbit(scene, **orbit.alike)
    assert float(again.foundation_rms) == pytest.approx(float(orbit.foundation_rms), abs=1e-4)
    assert float(single.foundation_rms) < float(orbit.foundation_rms) - 0.06


def test_an_unstable_orbit_says_how_disturbances_grow():
    orbit = jc.periodic_orbit(jc.paper_scene(27.0, 0.05e-3), nodes=96)
    assert orbit.instability == ""

    def said(largest, error=0.0):
        values = jnp.array([0.5, largest, 0.1, 0.1], complex)
        error = jnp.array(error)
        return dataclasses.replace(orbit, multipliers=values, multipliers_error=error).instability

    assert "change sides each period and grow, so the motion repeats after 2 turns" in said(-1.01)
    assert "grow to one side" in said(1.25) and "1.25" in said(1.25)
    assert "a modulus of 1.25:" in said(0.75 + 1j) and "quasi-periodic" in said(0.75 + 1j)
    assert "1 within the error" in said(0.9999, 1e-3)
    assert dataclasses.replace(orbit, result=RESULTS.whirl).instability == ""


class Swinging(Transient):
    """Turns at random, again and again; a motion beside goes off as exp(growth * turns)."""

    def __init__(self, growth, spent, steps=0, whirling=False):
        """Take what disturbances grow by, steps of the integrator a turn, and whether it whirls."""
        super().__init__(jc.paper_scene(27.0, 0.05e-3), spent)
        self.rate, self.steps, self.whirling = growth, steps, whirling

    @property
    def start(self):
        return jnp.full(4, 0.5)

    def piece(self, state):
        """Thousandths tell how it goes on, and what is behind them is a disturbance."""
        begun = np.round(np.asarray(state), 3)
        random = np.random.default_rng(np.round(1e3 * begun).astype(int))
        grown = np.exp(self.rate * np.arange(1, transient.PIECE + 1))[:, None]
        states = np.round(random.uniform(size=(transient.PIECE, 4)), 3)
        states += np.clip(np.asarray(state - begun) * grown, -0.5, 0.5)
        turn = jnp.ones(transient.PIECE)
        values = {"contact_fraction": turn, "winding": -20 * self.whirling * turn}
        return jnp.asarray(states), values, self._outcome(transient.PIECE)

    def _outcome(self, turns):
        return Outcome(fine().result, jnp.zeros(()), jnp.array(turns * self.steps))


@pytest.mark.parametrize(
    ("growth", "effort", "rounds"), [(0.1, "usual", 4), (2.0, "usual", 2), (0.1, "quick", 2)]
)
def test_a_swing_that_may_settle_is_waited_for_and_chaos_is_not(growth, effort, rounds):
    """At (38.687 rad/s, 0.10569 mm) disturbances grow by 0.07 a turn before the motion settles."""
    wait = Swinging(growth, Budget(effort))
    seen = list(wait.rounds())
    assert len(seen) == rounds and [one.chaotic for one in seen] == [growth > 1] * rounds
    assert wait.budget.turns == len(seen[-1].states) * 2 == 120 * 2**rounds
    name = RESULTS.chaotic if growth > 1 else RESULTS.aperiodic
    assert wait.regime() == name


def test_a_wait_ends_where_its_steps_are_spent():
    """10 000 steps a turn: 72 turns, and 24 beside them, are all pieces of a million steps."""
    wait = Swinging(0.1, Budget("quick"), steps=10_000)
    (last,) = wait.rounds()
    assert wait.budget.turns == 72 and len(last.states) == 36
    assert wait.budget.steps == 960_000 <= EFFORTS["quick"].steps
    said = wait.explanation()
    assert said.startswith("The motion from rest does not repeat within the wait")
    assert "Tried: a wait of 72 turns." in said and 'effort="thorough"' in said
    endless = Swinging(0.1, Budget("thorough"), steps=10_000)
    assert len(list(endless.rounds())) == 6 and endless.budget.turns == 7680


def test_turns_of_more_steps_than_the_effort_has_are_not_waited_for():
    """Each turn of the paper's crusher takes some 600 steps."""
    wait = Transient(jc.paper_scene(27.0, 0.05e-3), Budget("quick"))
    wait.budget.bounds = wait.budget.bounds._replace(steps=200 * transient.PIECE)
    assert not list(wait.rounds()) and wait.budget.turns == 0
    assert wait.regime() == RESULTS.too_long
    assert wait.budget.steps <= 201


@pytest.mark.usefixtures("unchecked")  # an error alone in place of what Newton's method found
@pytest.mark.parametrize(("steps", "integrated"), [(1e6, True), (1e4, False)])
def test_tangents_beyond_the_effort_are_not_integrated(monkeypatch, steps, integrated):
    """The first turn of the paper's crusher takes 1279 steps, tangents sixteen times as many."""
    scene, asked = jc.paper_scene(27.0, 0.05e-3), []
    success = RESULTS.promote(newton.RESULTS.successful)
    at_rest = dataclasses.replace(
        missing(scene, 1, RESULTS.unresolved), result=success, section=resting_start(scene)[0]
    )

    def tangents(*_):
        asked.append(1)
        return jnp.zeros(4), jnp.array(0.0)

    monkeypatch.setattr(searches, "integrated_multipliers", tangents)
    Unsure = dataclasses.make_dataclass("Unsure", ["multipliers"], namespace={"doubted": False})
    Error = dataclasses.make_dataclass("Error", ["error"])
    search = OrbitSearch(scene, scene, None, None, None, Budget("usual"))
    search.budget.bounds = search.budget.bounds._replace(steps=steps)
    found = search.with_multipliers(Attempt(at_rest, at_rest), Unsure(Error(jnp.array(2 * UNSURE))))
    assert bool(asked) == integrated == (found.orbit.multipliers_error == 0)
    turns = 17 if integrated else 1
    assert 600 * turns < search.budget.steps < 2000 * turns


def test_an_interrupted_search_says_what_it_knows():
    spent = Budget("usual")
    spent.nodes.add(96)

    def stopped():
        raise KeyboardInterrupt
        yield

    with pytest.raises(KeyboardInterrupt, match=r"no orbit yet\. Tried: 96 nodes a turn\."):
        first_stable(stopped(), Swinging(0.1, spent))


@pytest.mark.parametrize(("rate", "grows"), [(1.7, True), (0.05, False), (-0.5, False)])
def test_growth_is_that_of_a_motion_beside(rate, grows):
    """It is at least log(1 / 1e-5) / 24 of two motions that are as far apart as they come."""
    wait = Swinging(rate, Budget("usual"), steps=4)
    growth = wait.growth(wait.start, np.asarray(wait.piece(wait.start)[0])[-1])
    # A distance of 1e-5 is the difference of two numbers of 1, and grows by up to 1e-5 as it dies.
    assert growth == pytest.approx(min(rate, np.log(1e5) / transient.PIECE), rel=1e-3)
    assert (growth > CHAOS) == grows and wait.budget.steps == 4 * transient.PIECE


def test_each_effort_takes_its_tries_in_its_order():
    """None of the tries leads anywhere, and nodes are of no use where contact is lost."""
    scene, asked = jc.paper_scene(27.0, 0.05e-3), []
    names = ["way", "closure"]
    Found = dataclasses.make_dataclass("Found", names, namespace={"doubted": False})

    class Still(Swinging):
        def rounds(self):
            return iter(2 * [Round(np.zeros((120, 4)))])

        def regime(self):
            return RESULTS.aperiodic

    class Search(OrbitSearch):
        def by_so_many(self, guess, turns, count):
            rest = guess is None or np.isnan(guess).all()
            asked.append(("rest" if rest else "guess", count))
            return Attempt(orbit, orbit), Found(WAYS.rest, jnp.array(0.0))

        def with_multipliers(self, found, nodes):
            return found

        def by_shots(self, start, turns, way):
            asked.append(("shot", turns))
            yield Attempt(orbit, orbit)

        def transient(self):
            return Still(0.1, self.budget)

    rest, shots = ("rest", 96), 3 * [("shot", 1)]
    finer = [("rest", 192), ("rest", 384)]  # the orbit found first is NaN
    for lost, effort, tried in (
        (True, "quick", [rest, *shots]),
        (True, "usual", [rest, *shots]),
        (True, "thorough", [*finer, *shots]),
        (False, "quick", [rest, *shots]),
        (False, "usual", [rest, *finer, *shots]),
    ):
        orbit = missing(scene, 1, RESULTS.contact_lost if lost else RESULTS.unresolved)
        asked.clear()
        answer = searched(Search(scene, scene, None, None, None, Budget(effort)), None)
        assert not answer.success and asked == tried
        counts = " and ".join(sorted({str(count) for _, count in tried} - {"1"}, key=int))
        assert f"Tried: {counts} nodes a turn" in answer.failure


def test_means_are_taken_over_the_turns_that_a_motion_repeats_after():
    turns, swing = np.arange(120), 1e-3 * np.sin(0.7 * np.arange(120))
    quiet, doubled = (
        swing[:, None] * np.ones(4),
        (swing + 0.1 * (-1.0) ** turns)[:, None] * np.ones(4),
    )
    assert [turns for turns, _ in Round(quiet).means(None, 4)] == [1]
    found = dict(Round(doubled).means(None, 4))
    # The swing leaves a hundredth of itself in the mean of sixty turns.
    assert list(found) == [1, 2] and np.allclose(found[2], -0.1, atol=1e-4)
    assert list(dict(Round(doubled).means(3, 4))) == [3]


@pytest.mark.slow
@pytest.mark.optimised
def test_what_has_no_orbit_is_named():
    """The jaw that its load leaves goes from impact to impact."""
    orbit = jc.periodic_orbit(jc.paper_scene(30.0, 0.06e-3, load_law="closing_stroke"))
    assert not orbit.success and np.isnan(orbit.foundation_rms)
    assert orbit.failure.startswith("The motion from rest is chaotic: disturbances of it grow. ")


@pytest.mark.slow
def test_what_the_motion_does_beside_an_unstable_orbit_is_named():
    """The motion of one turn has doubled its period, and beyond a cascade there is chaos.

    From a section point nearby the orbit that doubled is found. A call without a guess says that
    the motion is chaotic, and does not look for one of the many unstable orbits in it.
    """
    chaos = "The motion from rest is chaotic: disturbances of it grow."
    scene = jc.paper_scene(34.0, 0.12e-3, load_law="closing_stroke")
    near = np.array([0.6177, 0.8089, -0.0012, 0.0026])
    doubled = jc.periodic_orbit(scene, method="shooting", guess=near)
    assert doubled.success and not doubled.stable
    assert doubled.instability.startswith("Its largest multiplier is -2.008")
    assert f"{chaos} Its RMS is " in doubled.instability
    assert doubled.instability.endswith(" turns.") and doubled.failure == ""
    orbit = jc.periodic_orbit(scene)
    assert not orbit.success and orbit.failure.startswith(chaos)


def test_a_motion_that_repeats_is_told_from_chaos():
    wait = Swinging(0.1, Budget("usual"))
    assert wait.regime() is None
    turns, two = np.arange(960), np.tile([[0.1] * 4, [0.2] * 4], (120, 1))
    noise = np.random.default_rng(0).uniform(size=(960, 4))
    swing = 0.1 * np.cos(0.7 * turns)[:, None] * np.ones(4)
    dying = swing * np.exp(-turns / 5000)[:, None]
    for states, growth, name in (
        (two, 0.1, RESULTS.repeats_2),
        (np.tile(noise[:24], (10, 1)), 0.1, RESULTS.repeats_late),
        # After a transient: the last 120 turns repeat.
        (np.concatenate([noise[:120], two[:120]]), 0.1, RESULTS.repeats_2),
        (noise, 0.1, RESULTS.aperiodic),
        (noise, 1.0, RESULTS.chaotic),
        (swing, 0.0, RESULTS.quasi_periodic),
        (swing[:240], 0.0, RESULTS.aperiodic),  # too few points for that
        (dying, 0.0, RESULTS.unsettled),
    ):
        wait._last = Round(states, growth)
        assert wait.regime() == name
    whirling = Swinging(0.1, Budget("usual"), whirling=True)
    assert not list(whirling.rounds()) and whirling.budget.turns == transient.PIECE
    assert whirling.regime() == RESULTS.whirl
