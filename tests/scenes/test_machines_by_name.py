"""A machine: its scenes, its numbers by name, and programs that equal machines share."""

import json
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.batch.points import make_grid
from jaxcrusher.batch.sweep import plan
from jaxcrusher.dynamics import bifurcation, coexisting_orbits
from jaxcrusher.identification import identify
from jaxcrusher.identification.measurements import Measurement
from jaxcrusher.orbits import orbit_branch
from jaxcrusher.scenes.machine import machine_of

EXAMPLES = Path(__file__).parents[2] / "examples"
CURVE = np.stack([np.radians(np.arange(0.0, 360.0, 30.0)), np.linspace(3e3, 9e3, 12)], axis=1)
CLEARANCE = "joints.B.clearance"


def pump(**values):
    return jc.read_machine(EXAMPLES / "pump.toml").replace(**values)


def paper(**values):
    return jc.paper_machine(start="contact", **values)


def test_a_scene_is_that_of_the_numbers():
    assert eqx.tree_equal(paper().scene(), jc.paper_scene(30.0, 0.06e-3, start="contact"))
    faster = paper().scene(speed=33.0, clearance=5e-5)
    assert eqx.tree_equal(faster, jc.paper_scene(33.0, 5e-5, start="contact"))
    whole = jc.read_machine(EXAMPLES / "pump.toml")
    assert eqx.tree_equal(whole.scene(), jc.read_scene(EXAMPLES / "pump.toml"))
    assert float(whole.scene(**{CLEARANCE: 4e-5}).joints["B"].clearance) == 4e-5


def test_a_scene_of_traced_numbers_has_slopes():
    """The same as of a scene in its own words; past a limit it is NaN, and not another number."""
    machine = jc.paper_machine(joint="ideal")

    def rms(speed):
        return jc.periodic_orbit(machine.scene(speed=speed)).foundation_rms

    def same(speed):
        return jc.periodic_orbit(jc.ideal_scene(speed)).foundation_rms

    assert float(jax.grad(rms)(30.0)) == float(jax.grad(same)(30.0)) > 0
    friction = jax.jit(lambda of: paper().scene(friction=of).joints.at("main").friction.coefficient)
    assert float(friction(0.2)) == 0.2 and np.isnan(friction(-0.2))


def test_another_machine_has_other_numbers_and_leaves_the_first_as_it_is():
    first = paper(clearance=5e-5)
    second = first.replace(clearance=7e-5, **{"jaw.mass": 600.0})
    assert (first.number("clearance"), second.number("clearance")) == (5e-5, 7e-5)
    assert first.number("jaw.mass") == 524.0 and second.given["start"] == "contact"
    drawn = pump(speed=100.0)
    assert drawn.number("speed") == 100.0 and drawn.number(CLEARANCE) == 5e-5
    # What is given is not left open any more.
    whole, name = jc.read_machine(EXAMPLES / "slider_crank.toml"), "joints.B.static_speed"
    assert name in whole.defaults and name not in whole.replace(**{name: 0.2}).defaults


@pytest.mark.parametrize(
    ("machine", "name", "meant"),
    [(paper, "sped", "'speed'"), (pump, "joints.B.clearanc", CLEARANCE)],
)
def test_a_misspelt_number_is_refused_with_what_is_meant(machine, name, meant):
    for call in (
        lambda: machine().scene(**{name: 1.0}),
        lambda: machine().replace(**{name: 1.0}),
        lambda: machine().over(name),
        lambda: machine().number(name),
        lambda: jc.sweep(machine(), {name: [1.0, 2.0]}, 0, 1),
        lambda: jc.orbit_branch(machine(), name, 1.0, (0.5, 2.0)),
        lambda: jc.gradient_report(machine(), "shaking_rms", [name]),
    ):
        with pytest.raises(ValueError, match=rf"`{name}` must .*{meant}") as error:
            call()
        assert "\n" not in str(error.value)


def test_a_choice_is_no_number_and_a_function_has_none_of_its_own():
    with pytest.raises(ValueError, match="`start` must be a known name"):
        paper().number("start")
    with pytest.raises(ValueError, match=r"`speed` must have a value, as \{name: value\}"):
        machine_of(jc.ideal_scene).number("speed")
    assert machine_of(jc.ideal_scene).replace(speed=30.0).number("speed") == 30.0
    machine = paper()
    assert machine_of(machine) is machine


@pytest.mark.parametrize(
    "machine",
    [
        lambda: paper(clearance=5e-5),
        lambda: paper(load_law="by_angle", load_curve=CURVE.copy()),
        lambda: jc.read_machine(EXAMPLES / "pump.toml"),
        lambda: machine_of(jc.ideal_scene).replace(load=8e3),
    ],
)
def test_scenes_of_equal_machines_share_one_program(machine):
    """Over some numbers, whatever values these have; another number is another program."""
    traces = []

    @eqx.filter_jit
    def speed(scenes, value):
        traces.append(scenes)
        return scenes(value).drive.speed

    for one in (machine(), machine(), machine().replace(speed=44.0)):
        assert float(speed(one.over("speed"), jnp.array([33.0]))) == 33.0
    assert len(traces) == 1
    speed(machine().replace(gravity=9.8).over("speed"), jnp.array([33.0]))
    assert len(traces) == 2


@pytest.mark.parametrize(("machine", "name"), [(paper, "jaw.mass"), (pump, "bodies.rod.mass")])
def test_machines_of_one_structure_share_programs(machine, name):
    """That of a scene, whose numbers are its leaves, and that of a sweep."""
    traces = []

    @jax.jit
    def speed(scene):
        traces.append(scene)
        return scene.drive.speed

    one, other = machine(), machine().replace(speed=31.0, **{name: 0.5})
    assert float(speed(one.scene())) != float(speed(other.scene())) == 31.0
    assert len(traces) == 1
    axes = {"speed": [30.0, 31.0]}
    window, same = (plan(make_grid(of, axes), 0, 1, 1e-6, 2).window for of in (one, other))
    assert window == same and hash(window) == hash(same)
    assert plan(make_grid(one.replace(start="centred"), axes), 0, 1, 1e-6, 2).window == window


class Seen(Exception):
    """Carries the scene that a verb begins with."""


def seen(scene, **_):
    raise Seen(scene)


# Verb -> its call, and where its scene is watched; sweeps and maps of functions are computed.
VERBS = {
    "basin_map": (
        lambda of: jc.basin_map(of, {"speed": [30.0]}, starts=2),
        (coexisting_orbits, "coexisting_orbits", seen),
    ),
    "bifurcation": (
        lambda of: jc.bifurcation(of, "speed", [30.0], settle_turns=0, turns=20),
        (bifurcation, "initial_state", seen),
    ),
    "orbit_branch": (
        lambda of: jc.orbit_branch(of, "speed", 30.0, (29.0, 35.0)),
        (orbit_branch, "traced", lambda over, value: seen(over(value))),
    ),
    "identify": (
        lambda of: jc.identify(
            of, [Measurement(30.0, "ground_force_x", 1, 1.0, 1.0)], {"clearance": 6e-5}
        ),
        (identify, "quantities_of", seen),
    ),
}


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.usefixtures("unchecked")
def test_a_function_of_named_numbers_is_a_machine(verb, monkeypatch):
    call, watched = VERBS[verb]
    monkeypatch.setattr(*watched)
    for of in (
        paper(),
        lambda speed, clearance=6e-5: paper().scene(speed=speed, clearance=clearance),
    ):
        with pytest.raises(Seen) as raised:
            call(of)
        assert eqx.tree_equal(raised.value.args[0], paper().scene())


@pytest.mark.parametrize(
    ("file", "settle", "off"),
    [("pump", 2, 1e-6), pytest.param("slider_crank", 0, 1e-4, marks=pytest.mark.slow)],
)
def test_a_linkage_is_swept(file, settle, off):
    """Two ways differ by steps of 1e-9; the impacts of a turn multiply that by some thousand."""
    machine, turns = jc.read_machine(EXAMPLES / f"{file}.toml"), max(settle, 1)
    names = ("shaking_rms", "drive_torque_rms")
    found = jc.sweep(machine, {"speed": [60.0, 90.0]}, settle, turns, outputs=names)
    assert found.success.all() and found.speed.attrs["units"] == "rad/s"
    assert json.loads(found.attrs["parameters"])["bodies.rod.mass"] == [0.21, "kg"]
    one = jc.statistics(machine.scene(speed=90.0), settle, turns, outputs=names)
    for name in names:
        assert float(found[name][1]) == pytest.approx(float(one[name]), rel=off), name
    assert found.shaking_rms[0] < found.shaking_rms[1]


@pytest.fixture(scope="module")
def orbit():
    return jc.periodic_orbit(pump().scene(), nodes=96)


@pytest.mark.slow
def test_slopes_of_a_linkage_are_reported_by_the_names_of_its_numbers(orbit):
    names = ["speed", "bodies.plunger.mass"]
    report = jc.gradient_report(pump(start="contact"), "shaking_rms", names)
    assert report.usable and [*report.slopes] == names, str(report)
    # What shakes rises with the square of the speed, but for some thousandths of a quiet pin.
    expected = 2 * float(orbit.shaking_rms) / pump().number("speed")
    assert report.slopes["speed"].value == pytest.approx(expected, rel=1e-2)
    with pytest.raises(ValueError, match="`parameters` must name at least one number"):
        jc.gradient_report(pump(), "shaking_rms", "speed")


@pytest.mark.slow
def test_a_mass_of_a_linkage_is_found_and_its_tolerance_told(orbit):
    name, mass = "bodies.plunger.mass", pump().number("bodies.plunger.mass")
    amplitude = jc.harmonics(orbit, 2, outputs=("ground_force",)).amplitude
    rows = [
        Measurement(pump().number("speed"), "ground_force_x", k, float(one), 1e-3)
        for k in (1, 2)
        for one in amplitude.sel(order=k, quantity="ground_force_x").values.reshape(-1)
    ]
    found = jc.identify(pump(**{name: 1.1 * mass}), rows, [name], starts=1, nodes=96)
    # Of its own amplitudes, to where fits end.
    assert found.values[name] == pytest.approx(mass, rel=1e-6)
    only = {"outputs": ("shaking_rms",), "observables": ()}
    scatter = jc.propagate(pump(), orbit, {name: 0.01 * mass}, **only)
    more, less = (
        jc.periodic_orbit(pump(**{name: by * mass}).scene(), nodes=96).shaking_rms
        for by in (1.01, 0.99)
    )
    # Differences over a hundredth of a force that is nearly linear in it.
    deviation = float(scatter.standard_deviation[0])
    assert deviation == pytest.approx(abs(float(more - less)) / 2, rel=1e-3)
    with pytest.raises(ValueError, match="`machine` must have the scene of the orbit"):
        jc.propagate(pump(speed=80.0), orbit, {name: 0.01 * mass}, **only)
