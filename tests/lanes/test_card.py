"""A GPU's lanes without a GPU: each of its threads as one of the processor's, side by side."""

import shutil
import subprocess

import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.devices import finds_card
from jaxcrusher.batch.engines import in_lanes, map_all, on_gpu
from jaxcrusher.lanes import card, program
from tests.lanes.cards import simulated_card  # noqa: F401
from tests.lanes.swings import OF_STEPS, SEGMENTS, TIMES, Swing, run_of, swings_of
from tests.pairs import slow


def _ill(swings):
    """One that cannot begin, one that takes too many steps, and one that ends early."""
    stiffness, blow = swings.stiffness.copy(), swings.blow.copy()
    stiffness[[3, 40]], blow[17] = (np.nan, 1e9), 50.0
    return Swing(stiffness, blow, swings.exponent)


def test_threads_agree_with_lanes(simulated):
    swings = _ill(swings_of(80))
    found, ends = map_all(run_of, swings, engine=on_gpu)
    exact, expected = map_all(run_of, swings, engine=in_lanes)
    np.testing.assert_array_equal(np.flatnonzero(~np.asarray(ends.success)), [3, 17, 40])
    np.testing.assert_array_equal(ends.result._value, expected.result._value)
    # The same instructions, but for the order of sums.
    assert np.abs(ends.steps - expected.steps).max() <= 1
    for name in ("last", "mean", "most"):
        np.testing.assert_allclose(found[name], exact[name], rtol=0, atol=1e-11)
    for ours, theirs in zip(found["kept"], exact["kept"], strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=OF_STEPS)
    assert np.isnan(found["mean"][[3, 17]]).any(1).all()


def _longer(swing):
    return run_of(swing, times=jnp.concatenate([TIMES, TIMES + SEGMENTS]))


@pytest.mark.parametrize(("function", "count"), [(run_of, 3), (run_of, 200), (_longer, 80)])
def test_a_batch_is_one_copy_up_a_kernel_and_one_copy_down(simulated, function, count):
    """However many designs and segments there are; a second batch compiles nothing."""
    once = {"up": 1, "kernels": 1, "down": 1}
    for _ in range(2):
        map_all(function, swings_of(count), engine=on_gpu)
    assert simulated.used == {name: 2 for name in once} | {"compiled": 1, "streams": 1}


@pytest.mark.parametrize(("speeds", "turns"), [(70, 1), *slow((2, 1), (2, 3))])
def test_a_sweep_calls_jax_as_often_for_any_designs_and_turns(
    simulated, monkeypatch, speeds, turns
):
    calls, run = [], program._Group.run

    def counting(group, operands, count):
        before = len(calls)
        function = group._function
        group._function = lambda *arrays: calls.append(count) or function(*arrays)
        try:
            return run(group, operands, count)
        finally:
            group._function = function
            assert len(calls) == before + 1

    monkeypatch.setattr(program._Group, "run", counting)
    asked = jc.paper_machine(start="contact"), {"speed": np.linspace(28, 32, speeds)}, 0, turns
    found = jc.sweep(*asked, rtol=1e-5, engine="gpu")
    # Before the integration, of what is the same for all and of what is not; and behind it.
    assert len(calls) == 3
    assert simulated.used == {"up": 1, "kernels": 1, "down": 1, "compiled": 1, "streams": 1}
    exact = jc.sweep(*asked, rtol=1e-5, engine="lanes")
    # Rounding, in a quiet motion.
    np.testing.assert_allclose(found.foundation_rms, exact.foundation_rms, rtol=1e-9)


needs_card = pytest.mark.skipif(not finds_card(), reason="CuPy finds no GPU of NVIDIA's")


@needs_card
def test_a_real_card_agrees_with_lanes():
    axes = {"speed": np.linspace(28, 32, 40), "clearance": [5e-5, 7e-5]}
    found, exact = (
        jc.sweep(jc.paper_machine(start="contact"), axes, 1, 2, rtol=1e-8, engine=engine)
        for engine in ("gpu", "lanes")
    )
    assert found.success.all() and found.engine == "gpu"
    # Of 4096 quiet designs the RMS agreed to 1.1e-7 on an H100: what rounding makes at this rtol.
    np.testing.assert_allclose(found.foundation_rms, exact.foundation_rms, rtol=1e-7)


@needs_card
def test_a_real_card_gives_the_same_bits_in_chunks_and_at_once():
    asked = jc.paper_machine(), {"speed": np.linspace(28, 32, 300)}, 0, 1
    runs = [jc.sweep(*asked, rtol=1e-6, chunk=n, engine="gpu") for n in (300, 100)]
    np.testing.assert_array_equal(*(one.foundation_rms for one in runs))


@needs_card
def test_a_failure_on_a_real_card_stays_in_its_thread():
    swings = _ill(swings_of(80))
    found, ends = map_all(run_of, swings, engine=on_gpu)
    exact, expected = map_all(run_of, swings, engine=in_lanes)
    np.testing.assert_array_equal(ends.result._value, expected.result._value)
    for name in exact:
        # Far below the tolerance of 1e-9 where steps are the same.
        np.testing.assert_allclose(found[name], exact[name], rtol=0, atol=1e-9)


def test_ptx_is_kept(simulated, monkeypatch, tmp_path):
    def again():
        card._warps.cache_clear()
        map_all(run_of, swings_of(3), engine=on_gpu)
        return simulated.used["compiled"], len(list(tmp_path.glob("*.ptx")))

    assert again() == (1, 1)
    assert again() == (1, 1)  # found in the folder
    for file in tmp_path.glob("*.ptx"):
        file.write_bytes(file.read_bytes()[:-1])
    assert again() == (2, 1)
    monkeypatch.setattr(card, "_ENTRY", card._ENTRY + "; a thread starts otherwise")
    assert again() == (3, 2)


def test_each_device_has_its_kernel(simulated):
    for device in (0, 0, 1):
        simulated.cuda.Device().id = device
        map_all(run_of, swings_of(3), engine=on_gpu)
    assert card._warps.cache_info().currsize == 2 and simulated.used["compiled"] == 1


def test_the_text_is_taken_by_the_compiler_of_nvidia(simulated, monkeypatch, tmp_path):
    texts = []
    monkeypatch.setattr(card, "ptx", lambda text: texts.append(text) or text.encode())
    map_all(run_of, swings_of(3), engine=on_gpu)
    monkeypatch.undo()
    code = card.ptx(texts[0])
    assert b".visible .entry warps(" in code and b".extern" not in code
    if shutil.which("ptxas"):
        (tmp_path / "warps.ptx").write_bytes(code)
        subprocess.run(
            ["ptxas", "-arch=sm_90", "-o", "cubin", "warps.ptx"], cwd=tmp_path, check=True
        )
