"""Calls as version 0.1 had them: the same numbers, and what to write instead is right."""

import functools
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import equinox as eqx
import numpy as np
import pytest
import xarray as xr

import jaxcrusher
from jaxcrusher.basics import setup
from jaxcrusher.dynamics import bifurcation, coexisting_orbits
from jaxcrusher.identification import identify
from jaxcrusher.identification.measurements import Measurement
from jaxcrusher.orbits import bifurcation_curve, orbit_branch

AXES, BASE, IDEAL = {"speed": [28.0, 33.0]}, {"joint": "ideal", "load": 5e3}, {"joint": "ideal"}
FOLD = SimpleNamespace(
    kind="fold", parameter=38.0, branch=SimpleNamespace(problem=None), point=SimpleNamespace(u=None)
)
BOX = ((37.0, 39.0), (0.9e-4, 1.1e-4))
# What is told a second time is an error.
pytestmark = pytest.mark.filterwarnings("error:.* takes a machine first")
ROWS = [Measurement(30.0, "ground_force_x", 1, 1e4, 1.0)]
TURNS, SPEEDS = {"settle_turns": 0, "turns": 20}, [28.0, 33.0]


def ideal(speed, load=8.8e3):
    return jaxcrusher.ideal_scene(speed, load=load)


def worn(speed, clearance=1e-4):
    return jaxcrusher.paper_scene(speed, clearance)


@functools.cache
def orbit():
    return jaxcrusher.periodic_orbit(ideal(30.0))


class Seen(Exception):
    """Carries the scene that a verb begins with."""


@dataclass
class Watch:
    """A function of a module that a verb calls, and the scene that it is called with."""

    module: Any
    name: str
    scene: Callable[..., Any]

    def first(self, call, monkeypatch):
        def seen(*given, **how):
            raise Seen(self.scene(*given, **how))

        with monkeypatch.context() as patch, pytest.raises(Seen) as raised:
            patch.setattr(self.module, self.name, seen)
            call()
        return raised.value.args[0]


@dataclass
class Form:
    """An earlier call: what stood first in it, the rest of it, and keywords that are no more.

    `names` are what the words of the new call mean. Where a number takes long, the scene that the
    verb begins with is watched in its place.
    """

    verb: str
    first: Callable[[], tuple]
    rest: tuple = ()
    how: dict = field(default_factory=dict)
    old: dict = field(default_factory=dict)
    names: dict = field(default_factory=dict)
    watch: Watch | None = None

    def called(self):
        return getattr(jaxcrusher, self.verb)(*self.first(), *self.rest, **self.old, **self.how)

    def written(self, words):
        """The result of the new call as its words say it."""
        known = {"jaxcrusher": jaxcrusher, "functools": functools, "rest": self.rest}
        known |= {"orbit": orbit(), "how": self.how, self.verb: getattr(jaxcrusher, self.verb)}
        return eval(words.replace("...)", "*rest, **how)"), known | self.old | self.names)

    def result(self, call, monkeypatch):
        return call() if self.watch is None else self.watch.first(call, monkeypatch)


def of_axes(axes=AXES, **old):
    how, names = {"rtol": 1e-6}, {"axes": axes}
    return Form("sweep", lambda: (axes,), (0, 1), how, old, names)


BEGUN = Watch(bifurcation, "initial_state", lambda scene: scene)
TRACED = Watch(orbit_branch, "traced", lambda over, at: over(at))
FORMS = {
    "sweep": of_axes(base=BASE),
    "sweep of the paper's crusher": of_axes({"joint": ["ideal"]}),
    "sweep of a function": of_axes(scene=ideal),
    "sweep of a function with a base": of_axes(scene=ideal, base={"load": 5e3}),
    "map": Form("orbit_map", lambda: (AXES,), (), {"nodes": 16}, {"base": BASE}, {"axes": AXES}),
    "basins": Form(
        "basin_map",
        lambda: (AXES,),
        old={"base": {"clearance": 5e-5}},
        names={"axes": AXES},
        watch=Watch(coexisting_orbits, "coexisting_orbits", lambda scene, **_: scene),
    ),
    "diagram": Form(
        "bifurcation",
        lambda: (worn,),
        (SPEEDS,),
        TURNS,
        names={"machine": lambda value: worn(value)},
        watch=BEGUN,
    ),
    "diagram with a name": Form(
        "bifurcation",
        lambda: (worn,),
        (SPEEDS,),
        TURNS,
        {"name": "speed"},
        {"machine": worn},
        BEGUN,
    ),
    "branch": Form(
        "orbit_branch",
        lambda: (worn,),
        (30.0, (29.0, 31.0)),
        names={"machine": lambda value: worn(value)},
        watch=TRACED,
    ),
    "curve": Form(
        "bifurcation_curve",
        lambda: (worn,),
        (FOLD, 1e-4, BOX),
        names={"machine": lambda first, second: worn(first, second)},
        watch=Watch(bifurcation_curve, "traced", lambda over, at: over(at)),
    ),
    "fit": Form(
        "identify",
        lambda: (BASE,),
        (ROWS, ["jaw.mass"]),
        names={"machine": BASE},
        watch=Watch(identify, "quantities_of", lambda scene: scene),
    ),
    "scatter": Form(
        "propagate",
        lambda: (orbit(), IDEAL),
        ({"jaw.mass": 10.0},),
        {"outputs": ("shaking_rms",), "observables": ()},
        names={"machine": IDEAL},
    ),
    "scatter of a function": Form(
        "propagate",
        lambda: (orbit(), ideal),
        ({"load": (8.8e3, 10.0), "speed": (30.0, 0.1)},),
        {"outputs": ("shaking_rms",), "observables": ()},
        names={"machine": ideal},
    ),
}


@pytest.mark.parametrize("name", FORMS)
@pytest.mark.usefixtures("unchecked")  # objects in place of a branch
def test_an_earlier_call_gives_the_same_and_says_once_what_to_write(name, monkeypatch):
    form = FORMS[name]
    monkeypatch.setattr(setup, "_told", set())
    with pytest.warns(UserWarning) as told:
        before = form.result(form.called, monkeypatch)
    (one,) = told
    said = rf"jaxcrusher\.{form.verb} takes a machine first: write (.+)\."
    words = re.fullmatch(said, str(one.message))
    assert words is not None, str(one.message)
    # What was told is the new form, of which nothing is told, and the earlier one tells no more.
    for call, known in ((lambda: form.written(words[1]), set()), (form.called, setup._told)):
        monkeypatch.setattr(setup, "_told", known)
        after = form.result(call, monkeypatch)
        if not isinstance(before, xr.Dataset):
            assert eqx.tree_equal(before, after)
            continue
        # The same programs of the same numbers.
        assert before.sizes == after.sizes and set(before) == set(after)
        for column, values in before.items():
            np.testing.assert_array_equal(values, after[column], err_msg=str(column))


@pytest.mark.usefixtures("unchecked")
def test_new_calls_are_told_nothing(monkeypatch):
    """Also by keywords alone, and where the machine is a function."""
    monkeypatch.setattr(setup, "_told", set())
    with pytest.raises(ValueError, match="`engine` must be one of"):
        jaxcrusher.sweep(machine=ideal, axes=AXES, settle_turns=0, turns=1, engine="none")
    asked = {"name": "speed", "start": 30.0, "bounds": (29.0, 31.0)}
    with pytest.raises(ValueError, match="`points` must be a whole number"):
        jaxcrusher.orbit_branch(machine=worn, **asked, points=0)
    asked = {"names": ("speed", "clearance"), "event": FOLD, "second": 1e-4, "bounds": BOX}
    with pytest.raises(ValueError, match="`points` must be a whole number"):
        jaxcrusher.bifurcation_curve(machine=worn, **asked, points=0)
    with pytest.raises(ValueError, match="`sigmas` must name a number"):
        jaxcrusher.propagate(machine=ideal, orbit=orbit(), sigmas={})
