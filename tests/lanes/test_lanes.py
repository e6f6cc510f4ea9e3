"""Lanes against diffrax, on a small problem that has a bit of everything; and one by one."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.basics.integrate import RESULTS
from jaxcrusher.batch.engines import in_lanes, in_turn, map_all
from jaxcrusher.lanes import machine, program, record
from jaxcrusher.lanes.code import LANES
from tests.lanes.swings import (
    OF_STEPS,
    PROBLEM,
    SEGMENTS,
    TIMES,
    Swing,
    again,
    field_of,
    run_of,
    swings_of,
)
from tests.processes import python


def _in_turn(function, swings):
    return map_all(function, swings, 1000, in_turn)


def _equal(one, other):
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(a, b)


def _taken(tree, index):
    return jax.tree.map(lambda leaf: np.asarray(leaf)[index], tree)


@pytest.mark.parametrize("solver", [diffrax.Tsit5(), diffrax.Dopri5()])
def test_the_steps_are_those_of_diffrax(solver):
    swings, function = swings_of(3 * LANES + 5), eqx.Partial(run_of, solver=solver)
    found, ends = in_lanes(function, swings)
    exact, expected = _in_turn(function, swings)
    assert ends.steps.max() > 2 * ends.steps.min(), "all lanes would do the same"
    # Rounding seldom turns the verdict on a step.
    assert np.abs(ends.steps - expected.steps).max() <= 1
    np.testing.assert_array_equal(ends.reached, expected.reached)
    assert bool((ends.result == RESULTS.successful).all())
    # Far below the tolerance of 1e-9: the same steps, and rounding.
    for name in ("last", "mean", "most"):
        np.testing.assert_allclose(found[name], exact[name], rtol=0, atol=1e-11)
    for ours, theirs in zip(found["kept"], exact["kept"], strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=OF_STEPS)


def test_the_bits_of_a_design_are_its_own():
    swings = swings_of(5 * LANES + 3)
    whole = in_lanes(run_of, swings)
    order = np.random.default_rng(2).permutation(5 * LANES + 3)
    _equal(in_lanes(run_of, _taken(swings, order)), _taken(whole, order))
    for size in (1, 2, LANES + 1):
        part = slice(7, 7 + size)
        _equal(in_lanes(run_of, _taken(swings, part)), _taken(whole, part))
    _equal(map_all(run_of, swings, 10, in_lanes), whole)


SHARE = 1.0


def _shortened(swing):
    return run_of(swing, times=SHARE * TIMES, rtol=1e-3)


def test_a_global_that_changes_is_seen(monkeypatch):
    swings = swings_of(3)
    for share in (1.0, 0.5, 1.0):
        monkeypatch.setitem(globals(), "SHARE", share)
        _, ends = map_all(_shortened, swings, engine=in_lanes)
        np.testing.assert_array_equal(ends.reached, share * SEGMENTS)


def _brief(swing):
    return run_of(swing, times=1e-4 * TIMES)


def test_segments_shorter_than_the_first_step():
    swings = swings_of(3)
    (found, ends), (exact, expected) = in_lanes(_brief, swings), _in_turn(_brief, swings)
    np.testing.assert_array_equal(ends.steps, expected.steps)
    for ours, theirs in zip(jax.tree.leaves(found), jax.tree.leaves(exact), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-15)


def _own_times(swing):
    return run_of(swing, times=TIMES / jnp.sqrt(swing.stiffness))


def test_each_design_may_have_times_of_its_own():
    swings = swings_of(LANES + 3)
    found, exact = in_lanes(_own_times, swings), _in_turn(_own_times, swings)
    np.testing.assert_allclose(found[1].reached, exact[1].reached, rtol=1e-15)
    for name in ("last", "mean", "most"):
        np.testing.assert_allclose(found[0][name], exact[0][name], rtol=0, atol=1e-11)


def test_the_number_of_threads_changes_no_bit(monkeypatch):
    swings, found = swings_of(5 * LANES + 3), []
    for threads in (1, 2, 5):
        monkeypatch.setattr(machine, "cores", lambda n=threads: n)
        found.append(in_lanes(run_of, swings))
    _equal(found[0], found[1])
    _equal(found[0], found[2])


@pytest.mark.filterwarnings("error")
def test_a_failure_stays_in_its_lane():
    swings = swings_of(4 * LANES)
    stiffness, blow = swings.stiffness.copy(), swings.blow.copy()
    ill = [3, 17, 18, 40]
    stiffness[3], blow[17], blow[18], stiffness[40] = np.nan, 50.0, -60.0, 1e9
    function = eqx.Partial(run_of, max_steps=3000)
    mixed = Swing(stiffness, blow, swings.exponent)
    found, ends = in_lanes(function, mixed)
    expected_found, expected = _in_turn(function, mixed)
    words = [str(RESULTS[item]) for item in _each(expected.result)]
    assert [str(RESULTS[item]) for item in _each(ends.result)] == words
    assert len({words[i] for i in ill}) == 3 and {words[i] for i in range(3)} == {""}
    np.testing.assert_array_equal(ends.success, ~np.isin(np.arange(4 * LANES), ill))
    np.testing.assert_allclose(ends.reached, expected.reached, rtol=1e-9)
    for ours, theirs in zip(jax.tree.leaves(found), jax.tree.leaves(expected_found), strict=True):
        wrong = np.isnan(ours)
        np.testing.assert_array_equal(wrong, np.isnan(theirs))
        assert wrong[ill].any(axis=tuple(range(1, wrong.ndim))).all()
    well = np.setdiff1d(np.arange(4 * LANES), ill)
    _equal(_taken((found, ends), well), _taken(in_lanes(function, swings), well))


def _bent(time, y, swing):
    """A field that chooses by a number, and does not read it otherwise."""
    return field_of(time, y, Swing(swing.stiffness, jnp.where(swing.blow > 1, 1.0, 0.0), 1.5))


def test_a_number_that_is_not_finite_fails_whatever_it_does():
    """NaN stands for a number outside of its limits, and one that is only compared hides it."""
    swings = swings_of(4)
    odd = Swing(swings.stiffness, np.array([0.0, np.nan, 0.0, np.inf]), swings.exponent)
    function = eqx.Partial(run_of, problem=replace(PROBLEM, field=_bent))
    (found, ends), (_, expected) = in_lanes(function, odd), _in_turn(function, odd)
    np.testing.assert_array_equal(expected.success, [True, False, True, False])
    _equal((ends.success, ends.reached), (expected.success, expected.reached))
    np.testing.assert_array_equal(np.isnan(found["mean"]).all(axis=1), ~np.asarray(ends.success))


def _each(result):
    return [jax.tree.map(lambda leaf, k=i: jnp.asarray(leaf[k]), result) for i in range(4 * LANES)]


def test_an_integration_after_another():
    swings = swings_of(LANES + 1)
    (last, steps), (exact, _) = in_lanes(again, swings), _in_turn(again, swings)
    assert last.shape == (LANES + 1, SEGMENTS, 2) and steps.shape == (LANES + 1,)
    # The tolerance of a step, on which rounding may turn the verdict.
    np.testing.assert_allclose(last, exact, atol=1e-9)


def _slope(swing):
    return jax.grad(lambda swing: jnp.sum(run_of(swing)[0]["mean"]))(swing)


def _twice(swing):
    """A loop over integrations."""
    return jax.lax.scan(lambda swing, _: (swing, run_of(swing)[0]["last"]), swing, length=2)[1]


def test_what_lanes_cannot_do_is_done_in_turn_and_said():
    swings = swings_of(3)
    said = "Lanes do not know derivatives: the engine 'loop' computes these scenes."
    with pytest.warns(UserWarning, match=said):
        found = map_all(_slope, swings, engine=in_lanes)
    _equal(found, _in_turn(_slope, swings))
    with pytest.warns(UserWarning, match="Lanes do not know an integration inside `scan`"):
        map_all(_twice, swings, engine=in_lanes)
    with pytest.warns(UserWarning, match="Lanes do not know the solver `Heun`"):
        map_all(eqx.Partial(run_of, solver=diffrax.Heun(), rtol=1e-3), swings, engine=in_lanes)
    median = replace(
        PROBLEM, summarise=lambda seen, *_: jnp.sort(seen["place"])[10], following=None
    )
    with pytest.warns(UserWarning, match="Lanes do not know the primitive `sort`"):
        map_all(eqx.Partial(run_of, problem=median, rtol=1e-3), swings, engine=in_lanes)


def test_threads_share_one_program(monkeypatch):
    built = []

    def slow(*operands):
        built.append(operands)
        time.sleep(0.05)
        return operands

    monkeypatch.setattr(program, "Program", slow)
    monkeypatch.setattr(program, "_PROGRAMS", {})
    with ThreadPoolExecutor(4) as pool:
        operands = [run_of] * 4, [swings_of(1)] * 4, [machine.PROCESSOR] * 4
        found = list(pool.map(program.program, *operands))
    assert len(built) == 1 and all(one is found[0] for one in found)


def test_threads_write_and_compile_one_program_once(monkeypatch):
    texts, write = [], record.kernels

    def slow(*operands):
        time.sleep(0.05)
        texts.append(write(*operands))
        return texts[-1]

    monkeypatch.setattr(record, "kernels", slow)
    function = eqx.Partial(run_of, rtol=2e-9)  # of no other test
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(in_lanes, [function] * 4, [swings_of(3)] * 4))
    assert len(texts) == 1
    for other in found[1:]:
        _equal(other, found[0])


@pytest.mark.parametrize("which", [0, 1])
def test_an_interrupted_batch_stops_its_threads(monkeypatch, which):
    # One thread fails, the first or the second; the other has work for minutes.
    swings = swings_of(2 * LANES)
    advance = machine._advance

    def interrupted(*operands):
        if threading.current_thread().name.endswith(f"_{which}"):
            raise KeyboardInterrupt
        return advance(*operands)

    monkeypatch.setattr(machine, "_advance", interrupted)
    monkeypatch.setattr(machine, "cores", lambda: 2)
    with pytest.raises(KeyboardInterrupt):
        in_lanes(
            eqx.Partial(run_of, rtol=1e-13, max_steps=10**9),
            Swing(swings.stiffness * 1e9, swings.blow, swings.exponent),
        )


# JAX prefers another platform, as it does a GPU. What crosses to it is counted by what is there.
ELSEWHERE = """
import jax
jax.config.update("jax_enable_x64", True)
from jax._src import xla_bridge
xla_bridge.register_backend_factory("second", xla_bridge.make_cpu_client, priority=1000)
from jaxcrusher.batch.engines import in_lanes
from jaxcrusher.lanes import program
from tests.lanes.swings import again, swings_of
processor, run, used = set(jax.devices("cpu")), program._Group.run, []

def watched(group, operands, count):
    function = group._function
    def called(*arrays):
        found = function(*arrays)
        used.extend(leaf.devices() <= processor for leaf in found)
        used.extend(not isinstance(leaf, jax.Array) for leaf in jax.tree.leaves(arrays))
        return found
    group._function = called
    try:
        return run(group, operands, count)
    finally:
        group._function = function

program._Group.run = watched
assert not jax.numpy.ones(1).devices() <= processor
in_lanes(again, swings_of(70))
print(len(used) > 0, all(used))
"""


def test_what_stands_between_integrations_is_computed_on_the_processor():
    assert python(ELSEWHERE).stdout == "True True\n"
