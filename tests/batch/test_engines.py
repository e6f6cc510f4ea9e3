"""The engine that is chosen where none is asked for: by the card that is there, and the designs."""

import functools
import sys
import threading
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.devices import finds_card
from jaxcrusher.batch import engines
from jaxcrusher.batch.engines import (
    CARD_CHUNK,
    CHUNK,
    ENOUGH,
    in_order,
    map_all,
    map_chunks,
    run_all,
    run_chunks,
)
from jaxcrusher.files.journal import Journal
from jaxcrusher.lanes.verify import Unsupported


@pytest.fixture
def chosen(monkeypatch):
    """The engines that computed a chunk, one after the other, and its designs; with a card."""
    seen = []

    def counting(name):
        return lambda function, scenes: seen.append((name, len(scenes))) or scenes

    monkeypatch.setattr(engines, "finds_card", lambda: True)
    monkeypatch.setattr(engines, "devices", lambda: [None])
    for name in engines.ENGINES:
        monkeypatch.setitem(engines.ENGINES, name, counting(name))
    # Engines are told apart by what they are.
    monkeypatch.setattr(engines, "on_gpu", engines.ENGINES["gpu"])
    return seen


def test_many_designs_go_to_a_card(chosen):
    map_all(abs, np.ones(ENOUGH))
    map_all(abs, np.ones(ENOUGH - 1))
    # It takes larger chunks; in small ones it is not worth it.
    map_all(abs, np.ones(2 * CARD_CHUNK))
    map_all(abs, np.ones(2 * ENOUGH), chunk=ENOUGH // 2)
    rest = (ENOUGH - 1) // CHUNK + 1
    share = -(-(ENOUGH - 1) // rest)
    expected = [("gpu", ENOUGH), *[("lanes", share)] * rest, *[("gpu", CARD_CHUNK)] * 2]
    assert chosen == [*expected, *[("lanes", ENOUGH // 2)] * 4]


def test_without_a_card_and_where_another_is_asked_for_none_is_used(chosen, monkeypatch):
    map_all(abs, np.ones(ENOUGH), chunk=ENOUGH, engine="lanes")
    assert [len(part) for _, part in map_chunks(abs, np.ones(2), engine="gpu")] == [2]
    monkeypatch.setattr(engines, "finds_card", lambda: False)
    map_all(abs, np.ones(ENOUGH), chunk=ENOUGH)
    assert chosen == [("lanes", ENOUGH), ("gpu", 2), ("lanes", ENOUGH)]


@pytest.mark.parametrize("platform, engine", [("cpu", "loop"), ("gpu", "vmap")])
def test_what_lanes_cannot_do_follows_what_jax_computes_on(platform, engine, monkeypatch):
    monkeypatch.setattr(engines, "computes_on", lambda: platform)
    monkeypatch.setitem(engines.ENGINES, engine, lambda function, scenes: scenes + 10.0)
    for asked in (None, "gpu"):
        assert map_all(abs, np.ones(3), engine=asked).tolist() == [11.0, 11.0, 11.0]


@pytest.mark.parametrize(
    ("scenes", "chunk", "words"),
    [
        (30.0, None, r"`scenes` must hold arrays .*, but is with none\.$"),
        ({}, None, r"`scenes` must hold arrays .*, but is with no arrays\.$"),
        (np.ones((0, 2)), None, r"`scenes` must hold arrays .*, but is with 0\.$"),
        ((np.ones(2), 3.0), None, r"`scenes` must hold arrays .*, but is with none, 2\.$"),
        ((np.ones(2), np.ones(3)), None, r"`scenes` must hold arrays .*, but is with 2, 3\.$"),
        (np.ones(3), 0, "`chunk` must be a whole number >= 1, but is 0"),
        (np.ones(3), -100, "`chunk` must be a whole number >= 1, but is -100"),
    ],
)
def test_refusals(scenes, chunk, words):
    with pytest.raises(ValueError, match=words):
        map_all(abs, scenes, chunk)


def test_what_lanes_do_not_know_is_told(monkeypatch):
    def refuse(*_):
        raise Unsupported("the primitive `sort`")

    monkeypatch.setattr(engines, "program", refuse)
    monkeypatch.setitem(engines.ENGINES, "loop", lambda function, scenes: scenes + 10.0)
    told = "Lanes do not know the primitive `sort`: the engine 'loop' computes these scenes."
    with pytest.warns(UserWarning, match=told):
        assert map_all(abs, np.ones(3), engine="lanes").tolist() == [11.0, 11.0, 11.0]


AXES = {"speed": [28.0, 30.0], "clearance": [4e-5, 5e-5, 6e-5]}
ASKED = jc.paper_machine(joint="ideal"), AXES, 0, 1


@pytest.mark.slow
def test_a_sweep_says_which_engine_made_it_and_goes_on_with_it(tmp_path, monkeypatch):
    store = tmp_path / "grid"
    assert jc.sweep(*ASKED, rtol=1e-6, store=store).attrs["engine"] == "lanes"
    # A card is there, and three designs are many.
    monkeypatch.setattr(engines, "finds_card", lambda: True)
    monkeypatch.setattr(engines, "ENOUGH", 6)
    monkeypatch.setitem(engines.ENGINES, "gpu", engines.in_turn)
    assert jc.sweep(*ASKED, rtol=1e-6).attrs["engine"] == "gpu"
    # Of which each choice is a program, and a chunk, of its own.
    choices = {"joint": ["ideal", "clearance"], "speed": [28.0, 29.0, 30.0]}
    assert jc.sweep(jc.paper_machine(), choices, 0, 1, rtol=1e-6).attrs["engine"] == "lanes"
    one_line = (
        r"^Argument `engine` must be 'lanes' for the store \S+, which .* but is 'gpu' here\.$"
    )
    with pytest.raises(ValueError, match=one_line):
        jc.sweep(*ASKED, rtol=1e-6, store=store)
    assert jc.sweep(*ASKED, rtol=1e-6, store=store, engine="lanes").attrs["engine"] == "lanes"


class NoCard(Exception):
    """CuPy's error without a driver."""


def none_found():
    raise NoCard


@pytest.mark.parametrize(
    ("count", "found"), [(lambda: 1, True), (lambda: 0, False), (none_found, False)]
)
def test_cards_are_those_that_cupy_counts(monkeypatch, count, found):
    runtime = SimpleNamespace(getDeviceCount=count, CUDARuntimeError=NoCard)
    cuda, cupy = ModuleType("cupy.cuda"), ModuleType("cupy")
    cuda.runtime, cupy.__spec__ = runtime, SimpleNamespace(name="cupy")
    monkeypatch.setitem(sys.modules, "cupy", cupy)
    monkeypatch.setitem(sys.modules, "cupy.cuda", cuda)
    assert finds_card() is found


@pytest.mark.parametrize("stop", [False, True])
def test_on_a_card_the_next_chunk_is_prepared_while_one_is_computed(monkeypatch, stop):
    """Each waits until the next has begun; results come in their order all the same."""
    begun = [threading.Event() for _ in range(5)]

    def compute(i):
        begun[i].set()
        if not stop:
            # The next but one does not begin before this one's result was taken.
            assert i == 4 or begun[i + 1].wait(60)
            assert i > 1 or not begun[i + 2].is_set()
        return i

    results = in_order(compute, range(5), "gpu")
    if stop:
        assert next(results) == 0
        results.close()
        assert not begun[4].is_set()
    else:
        assert list(results) == [0, 1, 2, 3, 4]
    # Other engines keep all cores busy with one.
    others = in_order(begun.__getitem__, range(5), "lanes")
    begun[4].clear()
    assert next(others) is begun[0] and not begun[4].is_set()


def test_an_error_of_a_chunk_on_a_card_is_that_of_the_batch():
    def compute(i):
        if i == 1:
            raise ValueError("no such chunk")
        return i

    results = in_order(compute, range(9), "gpu")
    assert next(results) == 0
    with pytest.raises(ValueError, match="no such chunk"):
        next(results)


class Doubled:
    """A function that a worker opens once, as all its chunks are of one program."""

    opened = 0

    def __call__(self, scenes):
        return {"twice": 2 * scenes}

    def __setstate__(self, _):
        Doubled.opened += 1

    def __getstate__(self):
        return {"not": "empty"}


computed, others_came = [], threading.Event()


def first_ends_last(function, scenes):
    computed.append(scenes.tolist())
    if scenes[0] == 0:
        others_came.wait(60)
    return function(scenes)


def test_chunks_of_a_cluster_come_as_they_finish_and_are_kept_by_the_caller(tmp_path, monkeypatch):
    """They are joined in order, and an error of the caller gives those in progress up."""
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(engines, "devices", lambda: [None])
    values, told = np.arange(8.0), []
    with distributed.Client(
        processes=False, n_workers=1, threads_per_worker=2, dashboard_address=None
    ) as client:
        asked = Doubled(), values, 2, first_ends_last
        came = []
        for rows, _ in run_chunks(*asked, scheduler=client):
            came.append(rows.start)
            if len(came) == 3:
                others_came.set()
        assert came[-1] == 0
        computed.clear()
        run = functools.partial(run_all, *asked)
        how = {"journal": Journal(tmp_path), "scheduler": client}
        found = run(**how, progress=lambda *counts: told.append(counts))
        np.testing.assert_array_equal(found["twice"], 2 * values)
        assert told == [(2, 8), (4, 8), (6, 8), (8, 8)] and Doubled.opened == 1
        assert len(computed) == 4 and len(list(tmp_path.iterdir())) == 4
        np.testing.assert_array_equal(run(**how)["twice"], 2 * values)
        # Nor does it depend on who computed a chunk whether it is known.
        next(tmp_path.iterdir()).unlink()
        np.testing.assert_array_equal(run(journal=Journal(tmp_path))["twice"], 2 * values)
        assert len(computed) == 5

        def stop(*_):
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            run(scheduler=client, progress=stop)
        assert not [one for one in client.futures.values() if one.status == "pending"]
