"""Any linkage by a file: what it reads, what it refuses, and its motion by closed forms."""

import re
import tomllib
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.plane import Vector
from jaxcrusher.crusher.machine import require_crusher
from jaxcrusher.joint.rollers import RollerBearing
from jaxcrusher.mechanism.acting import RoughFeed, rough_feed
from jaxcrusher.mechanism.linkage import Point
from jaxcrusher.mechanism.motion import Crank, ideal_at_rest, moving, triad_lever
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.observables import kinetic_energy
from jaxcrusher.scenes.build import build_linkage
from jaxcrusher.scenes.linkages import LEAST_LEVER, _levers
from jaxcrusher.scenes.reader import linkage, read_machine, read_scene
from tests.differences import differences

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = ("slider_crank", "four_bar", "double_toggle", "six_bar")
PLAIN = {
    "crank": "crank",
    "speed": 20.0,
    "gravity": 0.0,
    "bodies": {
        "crank": {"mass": 0.3, "inertia": 1e-4},
        "rod": {"mass": 0.2, "inertia": 2e-4, "mass_centre": [0.06, 0.0]},
        "slider": {"mass": 0.15, "inertia": 1e-4},
    },
    "joints": {
        "O": {"bore": ["frame", 0, 0], "pin": ["crank", 0, 0]},
        "A": {"bore": ["rod", 0, 0], "pin": ["crank", 0.05, 0]},
        "B": {"bore": ["rod", 0.12, 0], "pin": ["slider", 0, 0]},
    },
    "slides": {"guide": {"body": "slider", "along": [1, 0]}},
}


def changed(**parts):
    """The plain slider-crank with other tables, each merged into its own; None leaves one out."""
    merged = {name: dict(of) if isinstance(of, dict) else of for name, of in PLAIN.items()}
    for name, part in parts.items():
        if isinstance(part, dict):
            whole = {**merged.get(name, {}), **part}
            part = {key: value for key, value in whole.items() if value is not None}
        merged[name] = part
    return merged


GUIDE = {"body": "slider", "along": [1, 0]}
ENDS = {"bore": ["rod", 0.12, 0], "pin": ["slider", 0, 0]}
LOOSE = ENDS | {"clearance": 1e-4, "bore_radius": 0.01}
ROLLERS = {
    "contact_law": "rollers",
    "rollers": {"count": 20.0, "diameter": "5 mm", "pitch_diameter": 0.03, "length": 0.01},
    "bore_radius": 0.02,
}
DIAMETERS = {"diametral_clearance": 2e-4, "bore_diameter": "20 mm"}
ANGLES = np.radians(np.arange(0.0, 360.0, 15.0))
CURVE = np.stack([ANGLES, 100 * (1 + np.cos(ANGLES))], axis=1)


def with_pin(**keys):
    """The plain slider-crank with a loose pin B that has these keys too."""
    return changed(joints={"B": LOOSE | keys})


def with_guide(**keys):
    """The plain slider-crank with a guide that has these keys too."""
    return changed(slides={"guide": GUIDE | keys})


def with_gas(**keys):
    """The plain slider-crank with a force of these keys on its slider."""
    return changed(forces={"gas": {"body": "slider", **keys}})


@pytest.mark.parametrize("name", NAMES)
def test_an_example_is_read(name):
    path = EXAMPLES / f"{name}.toml"
    machine, scene = read_machine(path), read_scene(path)
    drawing, twice = machine.structure, 2 * machine.values["speed"]
    assert scene.linkage.crank == drawing.crank and len(scene.joints) == 1
    # The drawing of another file of the same bodies is equal: programs are kept by it.
    assert read_machine(path).structure == drawing and hash(drawing) == hash(drawing)
    assert float(machine.scene(speed=twice).drive.speed) == twice


def test_a_file_and_python_say_the_same():
    one = read_machine(EXAMPLES / "slider_crank.toml", [("speed", "191 rpm")]).scene()
    other = linkage(
        **changed(
            speed="191 rpm",
            bodies={
                "crank": {"mass": 0.3, "inertia": 1e-4, "mass_centre": [0.025, 0]},
                "rod": {"mass": 0.21, "inertia": 2.5e-4, "mass_centre": [0.06, 0]},
                "slider": {"mass": 0.14, "inertia": 1e-4},
            },
            joints={
                "B": {
                    "bore": ["rod", 0.12, 0],
                    "pin": ["slider", 0, 0],
                    "clearance": "0.5 mm",
                    "bore_radius": 0.01,
                    "poisson": 0.3,
                    "impact_law": "tracked",
                    "friction": 0.0,
                }
            },
        )
    )
    for scene in (one, other):
        assert float(scene.joints["B"].clearance) == 5e-4
    seen = [
        jc.simulate(scene, [0.0, 2e-3], outputs=("slider_acceleration",)).slider_acceleration
        for scene in (one, other)
    ]
    np.testing.assert_array_equal(*map(np.asarray, seen))


def test_an_ideal_slider_crank_obeys_closed_forms():
    """Accelerations at the dead centres; the drive's power is that of the force and the motion."""
    scene = linkage(**with_gas(force=[-300.0, 0.0]) | {"points": {"big_end": ["rod", 0, 0]}})
    turn, r, length = 2 * np.pi / 20.0, 0.05, 0.12
    motion = jc.simulate(scene, turn * np.linspace(0, 1, 201))
    dead = r * 20.0**2
    found = np.asarray(motion.slider_acceleration)[[0, 100], 0]
    np.testing.assert_allclose(found, [-dead * (1 + r / length), dead * (1 - r / length)])
    # The big end goes round the crank's axis.
    size = np.linalg.norm(motion["big_end_acceleration"], axis=1)
    np.testing.assert_allclose(size, dead, rtol=1e-12)
    # The tolerance of 1e-11 a step, some hundred steps, and works of 30 J.
    ledger = motion.energy
    assert np.abs(ledger.imbalance).max() < 3e-9 and np.ptp(ledger.load_work) > 29.9
    # The frame carries the guide, the bearing, and the reaction of the gas: the weights less m a.
    guide = np.asarray(motion.guide_force)
    total = np.asarray(motion.O_reaction)[:, 1] + guide
    np.testing.assert_allclose(total, np.asarray(motion.ground_force)[:, 1], atol=1e-9)


def test_ideal_joints_move_by_multipliers_too():
    times, outputs = (
        np.linspace(0.0, 0.1, 5),
        ("guide_force", "drive_torque", "slider_acceleration"),
    )
    one, other = (
        jc.simulate(linkage(**changed(formulation=way)), times, outputs=outputs)
        for way in ("multiplier", "eccentricity")
    )
    assert bool(one.success)
    for name in outputs:
        size = np.abs(other[name]).max()
        # A tolerance of 1e-11 throws, at 20 rad/s.
        np.testing.assert_allclose(one[name], other[name], rtol=0, atol=1e-9 * size)


def test_a_spring_stores_what_it_takes():
    """Half k s^2 and the preload, and a damper whose loss closes the ledger."""
    spring = {
        "begin": ["frame", 0.3, 0.0],
        "end": ["slider", 0, 0],
        "stiffness": 2000.0,
        "length": 0.1,
        "damping": 5.0,
        "preload": 20.0,
    }
    scene = linkage(**changed(springs={"buffer": spring}))
    motion = jc.simulate(scene, np.linspace(0, 0.3, 101))
    stretch = 0.3 - np.asarray(motion.slider_position)[:, 0] - 0.1
    stored = 20.0 * stretch + 1000.0 * stretch**2
    np.testing.assert_allclose(motion.energy.elastic, stored, rtol=1e-12)
    assert np.abs(motion.energy.imbalance).max() < 1e-9
    assert float(motion.energy.spring_loss[-1]) > 0.1


def test_a_force_by_the_angle_of_the_crank():
    # The direction's length is no part of the force.
    scene = linkage(**with_gas(along=[-2, 0], curve=CURVE))
    motion = jc.simulate(scene, np.linspace(0, 0.3, 61), outputs=("guide_force", "energy"))
    # The spline through 24 points of a cosine is off by 2e-5 of it.
    rate = np.gradient(np.asarray(motion.energy.load_work), np.asarray(motion.time))
    seen = jc.simulate(scene, motion.time, outputs=("slider_velocity",)).slider_velocity[:, 0]
    expected = -100 * (1 + np.cos(20.0 * np.asarray(motion.time))) * np.asarray(seen)
    # Differences of second order over steps of 0.1 rad.
    np.testing.assert_allclose(rate[1:-1], expected[1:-1], atol=0.01 * np.abs(expected).max())


def test_an_empty_table_is_none():
    none = {key: {} for key in ("forces", "springs", "points", "assembly", "foundation")}
    for scene in (linkage(**PLAIN, **none), linkage(**with_pin(), **none)):
        assert scene.pushes == scene.springs == () and scene.foundation is None


def test_a_diameter_is_twice_a_radius():
    joint = linkage(**changed(joints={"B": ENDS | DIAMETERS})).joints["B"]
    assert float(joint.clearance) == 1e-4 and float(joint.bore_radius) == 0.01


def loosened(joints, **clearances):
    """Joints of which some have a clearance."""
    loose = {name: {"clearance": c, "bore_radius": 0.05} for name, c in clearances.items()}
    return {name: joint | loose.get(name, {}) for name, joint in joints.items()}


STEPHENSON = {
    "crank": "crank",
    "speed": 20.0,
    "bodies": {
        name: {"mass": 1.0, "inertia": 0.01} for name in ("crank", "rod", "plate", "lower", "upper")
    },
    "joints": {
        "O": {"bore": ["frame", 0, 0], "pin": ["crank", 0, 0]},
        "A": {"bore": ["rod", 0, 0], "pin": ["crank", 0.035, 0]},
        "B": {"bore": ["rod", 0.25, 0], "pin": ["plate", 0, 0]},
        "C": {"bore": ["plate", 0.15, 0], "pin": ["lower", 0.2, 0]},
        "D": {"bore": ["plate", 0.07, 0.12], "pin": ["upper", 0.22, 0]},
        "E": {"bore": ["frame", 0.42, -0.2], "pin": ["lower", 0, 0]},
        "F": {"bore": ["frame", 0.36, 0.34], "pin": ["upper", 0, 0]},
    },
    "assembly": {"plate": [0.28, 0.0, 0.0]},
}


def stephenson(assembly=STEPHENSON["assembly"], **pins):
    """The triad of the examples with other places of pins and bores, as B_bore=(0.2, 0)."""
    joints = {name: dict(one) for name, one in STEPHENSON["joints"].items()}
    for name, place in pins.items():
        joint, end = name.split("_")
        joints[joint][end] = [joints[joint][end][0], *place]
    return STEPHENSON | {"joints": joints, "assembly": assembly}


# One that is put together in another way after a turn, and in the first one after two.
TWICE = stephenson(
    {"plate": [-0.0594, -0.1477, "-38.29 deg"]},
    A_pin=(0.0762, 0),
    B_bore=(0.2719, 0),
    C_bore=(0.1923, 0),
    C_pin=(0.1878, 0),
    D_bore=(0.0795, 0.0811),
    D_pin=(0.3063, 0),
    E_bore=(0.1014, 0.0152),
    F_bore=(-0.0693, -0.1458),
)
EVERY = "at every angle of the crank"
PLATE = f"let plate and rod and lower and upper meet {EVERY}"
ROD_ALONE = {"begin": ["rod", 0, 0], "end": ["rod", 1, 0], "stiffness": 1.0, "length": 1.0}
REFUSED = {
    "joints.B.bore` must name a body: crank, rod, slider, frame, but is 'bar'": changed(
        joints={"B": {"bore": ["bar", 0.12, 0], "pin": ["slider", 0, 0]}}
    ),
    "bodies.rod.mass` must be given in kg, but is missing": changed(
        bodies={"rod": {"inertia": 1e-4}}
    ),
    "crank` must name the body that the drive turns: crank, rod, slider, but is wheel": changed(
        crank="wheel"
    ),
    "crank` must have a joint to the frame, but is 'crank' without one": changed(
        joints={"O": {"bore": ["rod", 0.01, 0], "pin": ["crank", 0, 0]}}
    ),
    f"let rod and slider meet {EVERY}, but is open at a crank angle of 6": changed(
        joints={"A": {"bore": ["rod", 0, 0], "pin": ["crank", 0.13, 0]}}
    ),
    f"{EVERY}, but is at a dead point, from which they may go on either way": changed(
        joints={"A": {"bore": ["rod", 0, 0], "pin": ["crank", 0.11999, 0]}}
    ),
    "bodies` must form dyads": changed(bodies={"link": {"mass": 1.0, "inertia": 1.0}}),
    "joints.B.bore_radius` must be given in m with `joints.B.clearance`, but is missing": changed(
        joints={"B": ENDS | {"clearance": 1e-4}}
    ),
    "bodies.rod.colour` must be a known key, but is not; there are bodies.rod.mass": changed(
        bodies={"rod": {"mass": 0.2, "inertia": 2e-4, "colour": 1.0}}
    ),
    "bodies.rod.mass_centre` must be a pair [x, y] in m, but is [0.1, 0.0, 0.0]": changed(
        bodies={"rod": {"mass": 0.2, "inertia": 2e-4, "mass_centre": [0.1, 0.0, 0.0]}}
    ),
    "joints.B.bore_radius` must come with `joints.B.clearance`, but is alone": changed(
        joints={"B": ENDS | {"bore_radius": 0.01}}
    ),
    "forces.gas.force` must not stand beside `forces.gas.curve`, but is given": with_gas(
        along=[1, 0], force=[1.0, 0.0], curve=[[0.0, 1.0], [1.0, 2.0], [2.0, 1.0]]
    ),
    "joints.B.diametral_clearance` must not stand beside `joints.B.clearance`, but is given": (
        with_pin(diametral_clearance=2e-4)
    ),
    "spede` must be a known key, but is not; did you m": changed(spede=1.0),
    "`forcs` must be a known key, but is not; did you mean": changed(forcs={}),
    "foundation.inertia` must be given in kg m2 with `foundation.mass`, but is missing": changed(
        foundation={"mass": 10.0}
    ),
    "assembly.rod` must be 1 or -1, but is 2": changed(assembly={"rod": 2}),
    "assembly.crank` must name a body of a dyad": changed(assembly={"crank": 1}),
    "assembly.rod.x` must be a known key, but is not; did you mean": changed(
        assembly={"rod": {"x": 1}}
    ),
    "assembly.rod` must be one side of a dyad, but is two by rod and slider": changed(
        assembly={"rod": 1, "slider": -1}
    ),
    (
        "points.Öse` must be named by letters, digits and _, as results and MATLAB's variables are"
    ): changed(points={"Öse": ["rod", 0.1, 0]}),
    "points` must have names that no body has, but is rod": changed(
        points={"rod": ["rod", 0.1, 0]}
    ),
    "points.wall` must be of a body, or of a frame on supports, but is of frame": changed(
        points={"wall": ["frame", 0.1, 0]}
    ),
    (
        "slides and points` must have other names than to be seen as what joints, machine or "
        "supports have, but is seen as ground_force, ground_moment"
    ): changed(slides={"ground": GUIDE, "guide": None}),
    "fluctuation_order` must come with `speed_fluctuation`, but": changed(fluctuation_order=2.0),
    "foundation.left` must come with `foundation.mass`, but is alone": changed(
        foundation={"left": -1.0}
    ),
    "joints.B.static_speed` must be less than full_speed 0.1 m/s, but is 0.1": with_pin(
        static_speed=0.1, full_speed=0.1, friction=0.1
    ),
    "joints.B.static_speed` must be less than full_speed 0.1 m/s, but is 0.2": with_pin(
        static_speed=0.2, full_speed=0.1, friction=0.1
    ),
    "bodies.rod` must have its joints A and B apart, but is with both at one point": changed(
        joints={"B": {"bore": ["rod", 0, 0], "pin": ["slider", 0, 0]}}
    ),
    "bodies.crank` must have its joints A and O apart, but is with both at one point": changed(
        joints={"A": {"bore": ["rod", 0, 0], "pin": ["crank", 0, 0]}}
    ),
    "springs.s` must join two bodies, but is of rod alone": changed(springs={"s": ROD_ALONE}),
    "forces.gas.body` must be a body that moves, but is 'frame'": with_gas(
        body="frame", force=[1.0, 0.0]
    ),
    "forces.gas.curve` must be pairs [rad, N], but is not": with_gas(
        along=[1, 0], curve=[["a", 1.0]]
    ),
    "`forces.gas.along` must be a direction, but is zero": with_gas(along=[0, 0], curve=CURVE),
    "Argument `slides.guide.along` must be a direction, but is zero.": with_guide(along=[0, 0]),
    "slides.guide.height` must be given in m with `slides.guide.clearance`, but is missing": (
        with_guide(clearance=1e-4, length=0.05, corner_radius=1e-3)
    ),
    "slides.guide` must have a length and a height, but is without": with_guide(
        clearance=1e-4, height=0.05, corner_radius=1e-3
    ),
    "slides.guide.corner_radius` must come with `slides.guide.clearance`, but is alone": with_guide(
        corner_radius=1e-3
    ),
    "slides.guide.full_speed` must come with `slides.guide.friction`, but is alone": with_guide(
        full_speed=1.0
    ),
    "slides.guide.static_speed` must be less than full_speed 1.0 m/s, but is 1.0": with_guide(
        static_speed=1.0, friction=0.1
    ),
    "joints.B.contact_law` must name a module, but laws:Mine: No module named 'laws'": with_pin(
        contact_law="laws:Mine"
    ),
    "bodies.rod.mass` must be finite and > 0 kg": changed(
        bodies={"rod": {"mass": -1.0, "inertia": 2e-4}}
    ),
    "joints.B.contact_law` must be one of": with_pin(**ROLLERS | {"contact_law": "hertz"}),
    "joints.B.rollers.count` must come with `joints.B.contact_law": with_pin(
        **ROLLERS | {"contact_law": "flores"}
    ),
    "joints.B.rollers.wheels` must be a known key": with_pin(
        **ROLLERS | {"rollers": {"wheels": 3.0}}
    ),
    "rollers.diameter` must be smaller than the pitch": with_pin(
        **ROLLERS | {"rollers": {"diameter": 0.3}}
    ),
    "forces.gas.bandwidth` must come with `forces.gas.scatter`": with_gas(
        force=[-300.0, 0.0], bandwidth=5.0
    ),
    "forces.gas.seed` must be a whole number, but is 1.5": with_gas(
        force=[-300.0, 0.0], scatter=0.2, seed=1.5
    ),
    "forces.gas.scatter` must lie in [0, 1]": with_gas(force=[-300.0, 0.0], scatter=2.0),
    "assembly.plate` must say roughly where the body is at crank angle zero, [x, y, angle], as it"
    " meets rod, lower, upper in a triad, but is missing": stephenson({}),
    "[x, y, angle], as it meets rod, lower, upper in a triad, but ": stephenson({"plate": 1}),
    "in a triad, but is [0.2, 0.0]": stephenson({"plate": [0.2, 0.0]}),
    "assembly.rod` must name a body of a dyad, but is none": stephenson(
        {"plate": [0.28, 0.0, 0.0], "rod": 1}
    ),
    "assembly.plate.angle` must lie in [-": stephenson({"plate": [0.28, 0.0, 12.0]}),
    # A triad is dead where its lower bar is 0.194695 m long.
    f"{PLATE}, but is open at a crank angle of 147 deg": stephenson(C_pin=(0.19, 0)),
    f"{PLATE}, but is open at a crank angle of 0 deg": stephenson(B_bore=(0.9, 0)),
    f"{PLATE}, but is open, or goes too unevenly to be found, at a crank angle of 189 deg": (
        stephenson(C_pin=(0.1947, 0))
    ),
    f"{PLATE}, but is at a dead point, from which they may go on either way,": stephenson(
        C_pin=(0.19472, 0)
    ),
    "come back to where plate was after a turn of the crank, but is together in anoth": TWICE,
    f"{PLATE} with all clearances, but is open": (
        STEPHENSON | {"joints": loosened(STEPHENSON["joints"], C=8e-3)}
    ),
}


@pytest.mark.parametrize(("words", "description"), REFUSED.items())
def test_refusals(words, description):
    with pytest.raises(ValueError, match=re.escape(words)) as caught:
        linkage(**description)
    assert "\n" not in str(caught.value)


def test_a_guess_is_three_numbers_of_the_machine():
    machine = read_machine(EXAMPLES / "six_bar.toml", [("assembly.plate.angle", "5 deg")])
    units = {word: machine.numbers[f"assembly.plate.{word}"].unit for word in ("x", "y", "angle")}
    assert units == {"x": "m", "y": "m", "angle": "rad"}
    assert machine.number("assembly.plate.angle") == pytest.approx(np.radians(5), rel=1e-15)
    guess = machine.scene(**{"assembly.plate.x": 0.27}).linkage.guesses.at("plate")
    assert (float(guess.place.x), float(guess.place.y)) == (0.27, 0.0)
    # Any guess leads to the same place, to rounding.
    one, other = (machine.scene(**{"assembly.plate.x": x}) for x in (0.25, 0.3))
    places = [ideal_at_rest(scene.linkage, 1.0).centre("upper").array() for scene in (one, other)]
    np.testing.assert_allclose(*places, rtol=0, atol=1e-15)


def test_a_triad_in_lanes_moves_as_by_itself():
    """A length is swept, so that each lane follows its own course; one that is open is no number.

    The pin is pressed, and steps of 1e-9 are not multiplied by impacts.
    """
    machine, name = read_machine(EXAMPLES / "six_bar.toml"), "joints.C.pin.x"
    names = ("shaking_rms", "drive_torque_rms", "C_force_peak")
    found = jc.sweep(machine, {name: [0.199, 0.202]}, 0, 1, outputs=names, rtol=1e-9)
    assert found.success.all()

    def alone(length):
        scene = machine.scene(**{name: length})
        return jc.statistics(scene, 0, 1, outputs=names, rtol=1e-9)

    ours = jax.jit(jax.vmap(alone))(jnp.array([0.202, 0.05]))
    for one in names:
        assert float(found[one][1]) == pytest.approx(float(ours[one][0]), rel=1e-6), one
        assert abs(float(found[one][0] / found[one][1]) - 1) > 1e-4, one
        assert np.isnan(ours[one][1]), one


@pytest.mark.slow
def test_slopes_of_an_orbit_of_a_triad_are_those_of_differences():
    """By a length, whose derivative goes through Newton's steps; with ideal joints too.

    Friction changes its law within a node of the orbit, which puts 4e-3 on differences.
    """
    machine, name = read_machine(EXAMPLES / "six_bar.toml"), "joints.C.pin.x"
    machine = machine.replace(**{"joints.C.friction": 0.0})

    def shaking(length):
        return jc.periodic_orbit(machine.scene(**{name: length})).shaking_rms

    def ideal(length):
        scene = machine.scene(**{name: length}).ideal()
        return jc.statistics(scene, 0, 1, outputs=("shaking_rms",))["shaking_rms"]

    for of in (shaking, ideal):
        both = jax.jit(jax.value_and_grad(of))  # one program compiles for longer than it computes
        expected = float(differences(lambda at, both=both: both(at)[0], 0.2, 1e-4, order=4))
        # Orbits to some 1e-10 over steps of 1e-4, and a fourth order of 1e-7.
        assert float(both(np.float64(0.2))[1]) == pytest.approx(expected, rel=1e-6)


def test_levers_of_a_triad_with_all_clearances_are_bounds_of_first_order():
    """Pins at the rims of all bores at once come near the bound, and past it by second orders."""
    clearances = dict.fromkeys("OABCDEF", 1e-4)
    loose = STEPHENSON | {"joints": loosened(STEPHENSON["joints"], **clearances)}
    held, random = linkage(**loose).linkage, np.random.default_rng(0)
    angles = jnp.radians(jnp.arange(0.0, 360.0, 6.0))
    ((ideal, least),) = map(np.asarray, _levers(held, clearances, angles))

    def one(angle, off):
        e = Named({name: Vector(*at) for name, at in zip(clearances, off, strict=True)})
        motion = moving(held, Crank(angle, jnp.zeros(())), e, Named())
        return jnp.abs(triad_lever(motion, held.triads[0]))

    turned = 2 * np.pi * random.random((200, 7))
    off = 1e-4 * np.stack([np.cos(turned), np.sin(turned)], axis=2)
    seen = np.asarray(jax.jit(jax.vmap(jax.vmap(one, (None, 0)), (0, None)))(angles, off))
    fallen, most = ideal - seen.min(axis=1), ideal - least
    # The second order is 7e-4 m over 0.2 m of the first one.
    assert (fallen < 1.01 * most).all() and (fallen > 0.5 * most).all()


def test_a_crusher_may_say_its_kind_and_has_no_number_of_a_linkage(tmp_path):
    path = tmp_path / "crusher.toml"
    path.write_text('kind = "crusher"\nspeed = "30 rad/s"')
    assert float(read_scene(path).drive.speed) == 30.0
    for key, value in (("clearance", "1 mm"), ("slip", "centre")):
        path.write_text(f'[joints.B]\n{key} = "{value}"')
        with pytest.raises(ValueError, match=f"joints.B.{key}` must be of a linkage"):
            read_scene(path)


@pytest.mark.parametrize(
    ("file", "key", "text", "value"),
    [
        ("four_bar", "joints.B.slip", "centre", "centre"),
        ("slider_crank", "joints.B.impact_law", "constant", "constant"),
        ("slider_crank", "start", "contact", "contact"),
        ("pump", "bodies.rod.mass_centre.y", "1 mm", 1e-3),
        ("pump", "gravity", "0 m/s2", 0.0),
        ("pump", "speed_fluctuation", "2 %", 0.02),
    ],
)
def test_a_key_may_be_set_that_a_file_has_or_may_have(file, key, text, value):
    found = read_machine(EXAMPLES / f"{file}.toml", [(key, text)])
    assert found.values[key] == value


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("clearance", "clearance` must be a known key, but is not; did you mean joints.O.clear"),
        ("jaw.mass", "jaw.mass` must be a known key, but is not; there are speed, "),
        ("forces.pressure.along.x", "did you mean forces.pressure.at.x or forces.pressure.force.x"),
        ("fluctuation_order", "fluctuation_order` must come with `speed_fluctuation`, but"),
        ("joints.A.friction", "joints.A.friction` must come with `joints.A.clearance`, but"),
        ("joints.A.clearance", "joints.A.bore_radius` must be given in m with `joints.A.clear"),
        ("foundation.mass", "foundation.inertia` must be given in kg m2 with `foundation.m"),
    ],
)
def test_a_drawing_refuses_what_it_does_not_read(name, words):
    machine = read_machine(EXAMPLES / "pump.toml")
    for call in (machine.scene, machine.replace):
        with pytest.raises(ValueError, match=re.escape(words)):
            call(**{name: 0.01})
    with pytest.raises(ValueError, match=re.escape(words)):
        jc.sweep(machine, {name: [0.01, 0.02]}, 1, 1)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("joints.B.restitution", 1.5, "joints.B.restitution` must lie in [0.01, 1], but is 1.5"),
        ("joints.B.friction", -0.1, "joints.B.friction` must lie in [0, 10], but is -0.1"),
        ("bodies.rod.mass", -1.0, "bodies.rod.mass` must be finite and > 0 kg, but is -1.0"),
        ("forces.pressure.at.x", 2e3, "forces.pressure.at.x` must lie in [-1000, 1000] m"),
        ("joints.B.slip", "middle", "joints.B.slip` must be one of 'centre', 'surface', but"),
        ("bodies.rod.mass", None, "bodies.rod.mass` must be given in kg, but is missing"),
    ],
)
def test_a_drawing_refuses_what_a_file_may_not_have(name, value, words):
    """A restitution above 1 would put energy in; one that `jax.jit` alone knows becomes NaN."""
    machine = read_machine(EXAMPLES / "pump.toml")
    other = {**machine.values, name: value}
    other = {key: one for key, one in other.items() if one is not None}
    with pytest.raises(ValueError, match=re.escape(words)):
        machine.structure.scene(other)
    if isinstance(value, float):
        seen = jax.jit(lambda one: machine.scene(**{name: one}))
        good = [np.isfinite(leaf).all() for leaf in jax.tree.leaves(seen(value))]
        assert not all(good)


def test_a_friction_s_traced_speeds_are_in_order():
    """As known ones are: a ramp that would begin above its end is NaN."""
    friction = {"joints.B.friction": 0.1, "joints.B.full_speed": 0.2}
    machine = read_machine(EXAMPLES / "slider_crank.toml").replace(**friction)

    def begin(speed):
        scene = machine.scene(**{"joints.B.static_speed": speed})
        return scene.joints.at("B").friction.static_speed

    begins = jax.vmap(begin)(jnp.array([0.1, 0.2, 0.3]))
    np.testing.assert_array_equal(begins, [0.1, np.nan, np.nan])


def test_numbers_of_a_joint_are_not_called_those_of_a_jaw():
    numbers = read_machine(EXAMPLES / "pump.toml").numbers
    meanings = [of.meaning for name, of in numbers.items() if name.startswith("joints.")]
    assert meanings and not [text for text in meanings if "main bearing" in text or "jaw" in text]


@pytest.mark.parametrize(
    ("name", "seen"),
    [
        ("gravity", lambda scene: scene.linkage.gravity),
        ("bodies.rod.mass_centre.y", lambda scene: scene.point("rod").arm.y),
        ("forces.pressure.force.y", lambda scene: scene.pushes[0].given.y),
        ("foundation.x", lambda scene: scene.foundation.point.x),
        ("speed_fluctuation", lambda scene: scene.drive.fluctuation),
    ],
)
def test_a_drawing_reads_what_is_zero_or_left_to_its_default(name, seen):
    machine = read_machine(EXAMPLES / "pump.toml")
    assert name not in machine.values and float(seen(machine.scene(**{name: 0.01}))) == 0.01


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("joints.B.slip", "`joints.B.slip` must be one of 'centre', 'surface'"),
        ("joints.A.pin.x", "coupler and rocker meet at every angle of the crank"),
        ("joints.B.clearanc", r"`joints.B.clearanc` must be .* did you mean joints.B.clearance\?$"),
        ("joints.Q.clearanc", r"`joints.Q.clearanc` must be .* did you mean joints.O.clearance\?$"),
        ("joint.B.clearance", r"`joint.B.clearance` must be .* did you mean \[joints\]\?$"),
        ("bodies.crank.mas", r"`bodies.crank.mas` must be .* did you mean bodies.crank.mass\?$"),
    ],
)
def test_refusals_of_what_overrides_a_file(name, words):
    with pytest.raises(ValueError, match=words):
        read_machine(EXAMPLES / "four_bar.toml", [(name, "500 mm")])


@pytest.mark.slow
def test_an_orbit_of_impacts():
    """The four-bar's loose pin is thrown off more than once a turn, and the motion repeats."""
    orbit = jc.periodic_orbit(read_scene(EXAMPLES / "four_bar.toml"))
    assert bool(orbit.stable) and float(orbit.least_penetration) < -0.5
    # As docs/linkages.md prints them.
    assert float(orbit.shaking_rms) == pytest.approx(131, abs=0.5)
    moduli = np.sort(np.abs(np.asarray(orbit.multipliers)))
    assert moduli[-2:] == pytest.approx([0.057, 0.117], abs=5e-4)


@pytest.mark.parametrize("side", [{"coupler": 1}, {"rocker": -1}, {"coupler": 1, "rocker": -1}])
def test_the_side_of_two_links_does_not_ask_for_their_order(side):
    """The line from the outer joint of the one to that of the other has a left and a right."""
    given = tomllib.loads((EXAMPLES / "four_bar.toml").read_text())
    given["assembly"] = side
    turned = given | {"bodies": dict(reversed(given["bodies"].items()))}
    poses = []
    for scene in (linkage(**given), linkage(**turned)):
        state = scene.formulation.initial(scene)
        poses.append(scene.formulation.snapshot(jnp.zeros(()), state, scene).motion.poses)
    for body in given["bodies"]:
        one, other = (np.array(jax.tree.leaves(of[body])) for of in poses)
        np.testing.assert_allclose(one, other, rtol=1e-14, atol=1e-14)  # rounding


def test_statistics_of_a_linkage_are_those_of_its_motion():
    """RMS by the trapezoidal rule over a turn, of what an ideal machine does."""
    scene = linkage(**changed())
    turn = 2 * np.pi / 20.0
    motion = jc.simulate(scene, turn * np.linspace(0, 1, 2001))
    names = ("shaking_rms", "B_force_rms", "B_force_peak", "drive_torque_rms", "guide_force_peak")
    names += ("drive_torque_peak",)
    found = jc.statistics(scene, 0, 1, outputs=names)
    force = np.linalg.norm(motion.B_reaction, axis=1)
    size = np.linalg.norm(motion.shaking_force, axis=1)
    for name, expected in (
        ("shaking_rms", np.sqrt(np.mean(size[:-1] ** 2))),
        ("B_force_rms", np.sqrt(np.mean(force[:-1] ** 2))),
        ("B_force_peak", force.max()),
        ("drive_torque_rms", np.sqrt(np.mean(np.asarray(motion.drive_torque)[:-1] ** 2))),
        ("guide_force_peak", np.abs(motion.guide_force).max()),
        ("drive_torque_peak", np.abs(motion.drive_torque).max()),
    ):
        # Peaks are looked at at 1024 instants a turn.
        assert float(found[name]) == pytest.approx(expected, rel=1e-5)
    assert not bool(found.whirl)
    s = scene.formulation.snapshot(jnp.zeros(()), scene.formulation.initial(scene), scene)
    assert float(kinetic_energy(s, scene)) > 0


def test_statistics_of_a_small_machine_are_those_of_a_large_one():
    """Masses of a thousandth and lengths of a tenth: forces of 1e-4, torques of 1e-5 as much."""
    machine = read_machine(EXAMPLES / "slider_crank.toml")
    values = {name: one for name, one in machine.values.items() if not name.startswith("joints.B.")}
    values |= {"joints.B.bore.x": 0.12, "speed": 6.0}
    small = {
        name: one * {"kg": 1e-3, "m": 0.1, "kg m2": 1e-5}.get(machine.numbers[name].unit, 1.0)
        for name, one in values.items()
    }
    scale = {"shaking_rms": 1e-4, "guide_force_rms": 1e-4, "rod_acceleration_rms": 0.1}
    scale |= {"shaking_moment_rms": 1e-5, "drive_torque_rms": 1e-5, "drive_torque_peak": 1e-5}
    one, other = (
        jc.statistics(machine.structure.scene(v), 0, 1, outputs=tuple(scale))
        for v in (values, small)
    )
    for name, factor in scale.items():
        assert float(other[name]) == pytest.approx(factor * float(one[name]), rel=1e-6), name


def test_a_pin_that_impacts_winds_round_its_bore_while_they_touch():
    """By the angle of its eccentricity, which passes the centre at 0.01 clearances once."""
    scene = read_scene(EXAMPLES / "four_bar.toml")
    turn, clearance = 2 * np.pi / float(scene.drive.speed), 1e-4
    motion = jc.simulate(scene, turn * np.linspace(0, 1, 20001), outputs=("B_eccentricity",))
    place = np.asarray(motion.B_eccentricity) @ [1, 1j]
    touching = np.abs(place) > clearance
    turned = np.angle(place[1:] / place[:-1])[touching[1:] & touching[:-1]]
    found = jc.statistics(scene, 0, 1, outputs=("B_winding",))
    # The ends of contacts lie between samples: 1 % here, and 7 % of a quarter of the samples.
    assert float(found.B_winding) == pytest.approx(turned.sum() / (2 * np.pi), rel=0.02)


SUPPORTS = {
    "mass": 5.0,
    "inertia": 0.1,
    "left": -0.1,
    "right": 0.2,
    "base": -0.1,
    "horizontal_stiffness": 2e4,
    "vertical_stiffness": 3e4,
    "horizontal_damping": 20.0,
    "vertical_damping": 30.0,
}


def test_a_linkage_may_stand_on_supports():
    """The ledger closes with what the supports' dampers take, and the frame is told."""
    scene = linkage(**changed(foundation=SUPPORTS, gravity=9.81))
    motion = jc.simulate(scene, np.linspace(0, 0.5, 101))
    # The tolerance of 1e-11 a step over works of some joules.
    assert np.abs(motion.energy.imbalance).max() < 1e-9
    assert float(motion.energy.support_loss[-1]) > 1e-4
    assert {"transmitted_rms", "frame_velocity_rms"} < set(scene.statistics)


@pytest.mark.parametrize("eccentricity", [0.0, 5e-3])
def test_a_rotor_alone_on_supports_is_an_oscillator(eccentricity):
    """Its unbalance turns, and the frame's G is in its axis: no moment, and both axes are alike."""
    mass, speed, stiffness, damping = 3.0, 90.0, 2e4, 800.0
    body = {"mass": mass, "inertia": 1e-2, "mass_centre": [eccentricity, 0.0]}
    foundation = SUPPORTS | {"left": -0.2, "right": 0.2, "base": 0.0}
    foundation |= dict.fromkeys(("horizontal_stiffness", "vertical_stiffness"), stiffness / 2)
    foundation |= dict.fromkeys(("horizontal_damping", "vertical_damping"), damping / 2)
    joints = {"O": PLAIN["joints"]["O"]}
    scene = linkage(
        crank="crank", speed=speed, bodies={"crank": body}, joints=joints, foundation=foundation
    )
    found = jc.statistics(scene, 8, 1, outputs=("transmitted_rms",))
    spring = stiffness + 1j * speed * damping
    force = mass * eccentricity * speed**2
    force *= abs(spring / (spring - (mass + foundation["mass"]) * speed**2))
    # Eight turns of 0.07 s leave exp(-50 * 0.56) of what the start sets swinging.
    assert float(found.transmitted_rms) == pytest.approx(force, rel=1e-6, abs=1e-6)


@pytest.mark.slow
def test_its_orbit_on_supports_is_that_of_late_turns():
    scene = linkage(**changed(foundation=SUPPORTS, gravity=9.81))
    orbit = jc.periodic_orbit(scene)
    late = jc.statistics(scene, 60, 2, outputs=("transmitted_rms",))
    # Sixty turns leave 1e-4 of what the start sets swinging.
    assert float(orbit.transmitted_rms) == pytest.approx(float(late.transmitted_rms), rel=1e-3)


FOUR_BAR = {
    "crank": "crank",
    "speed": 20.0,
    "bodies": {name: {"mass": 1.0, "inertia": 0.01} for name in ("crank", "coupler", "rocker")},
    "joints": {
        "O": {"bore": ["frame", 0, 0], "pin": ["crank", 0, 0]},
        "A": {"bore": ["coupler", 0, 0], "pin": ["crank", 0.05, 0]},
        "B": {"bore": ["coupler", 0.2, 0], "pin": ["rocker", 0.15, 0]},
        "C": {"bore": ["frame", 0.22, 0], "pin": ["rocker", 0, 0]},
    },
}
SIX_BAR = FOUR_BAR | {
    "bodies": FOUR_BAR["bodies"]
    | {name: {"mass": 1.0, "inertia": 0.01} for name in ("rod", "slider")},
    "joints": FOUR_BAR["joints"]
    | {
        "D": {"bore": ["rod", 0, 0], "pin": ["rocker", 0.1, 0.05]},
        "E": {"bore": ["rod", 0.12, 0], "pin": ["slider", 0, 0]},
    },
    "slides": {"guide": {"body": "slider", "along": [1, 0], "through": [0, 0.06]}},
}
CLEARANCES = {"O": 1e-3, "A": 2e-3, "B": 1.5e-3, "C": 0.5e-3, "D": 1e-3, "E": 2e-3}


def levers_by_random_eccentricities(scene, clearances, count=200):
    """The least sine of each dyad by pins at the rims of their bores, at every third degree."""
    held, angles = scene.linkage, jnp.radians(jnp.arange(0.0, 360.0, 3.0))
    radius = jnp.array(list(clearances.values()))

    def one(angle, turned):
        places = [
            Vector(r * jnp.cos(t), r * jnp.sin(t)) for r, t in zip(radius, turned, strict=True)
        ]
        e = Named(dict(zip(clearances, places, strict=True)))
        motion = moving(held, Crank(angle, jnp.zeros(())), e, Named())
        found = []
        for dyad in held.dyads:
            ends = [(dyad.first, dyad.meeting), (dyad.first, dyad.first_joint)]
            ends += [(dyad.second, dyad.meeting), (dyad.second, dyad.second_joint)]
            spots = [
                motion.position(Point(body, held.side_of(joint, body)))
                for body, joint in ends
                if joint not in held.slides
            ]
            u = spots[0] - spots[1]
            upright = dyad.second_joint in held.slides
            v = held.slides.at("guide").direction.perp() if upright else spots[2] - spots[3]
            found.append(jnp.abs(u.cross(v)) / jnp.sqrt(u.dot(u) * v.dot(v)))
        return jnp.stack(found)

    turned = 2 * jnp.pi * jax.random.uniform(jax.random.key(0), (count, len(clearances)))
    every = jax.jit(jax.vmap(jax.vmap(one, (None, 0)), (0, None)))(angles, turned)
    return angles, np.asarray(every).min(axis=1)


@pytest.mark.parametrize(("drawing", "off"), [(FOUR_BAR, 0.7), (SIX_BAR, 0.3)])
def test_levers_with_all_clearances_are_bounds(drawing, off):
    """No pins go beyond them; of one dyad those at the rims come near, of two the bound is wide."""
    clearances = {name: c for name, c in CLEARANCES.items() if name in drawing["joints"]}
    loose = drawing | {"joints": loosened(drawing["joints"], **clearances)}
    scene = linkage(**loose)
    angles, seen = levers_by_random_eccentricities(scene, clearances)
    bounds = _levers(scene.linkage, clearances, angles)
    for i, (ideal, least) in enumerate(bounds):
        assert np.isfinite(seen[:, i]).all() and (seen[:, i] >= least - 1e-12).all()
        assert (np.asarray(least) < ideal).all()
        # Two hundred draws of four to six directions come to half of the way, of one dyad.
        nearest = np.max((ideal - seen[:, i]) / (ideal - least))
        assert nearest > off


def test_links_close_with_all_clearances_at_once():
    """As `require_crusher` says of the same crusher, to the least lever that is taken."""

    def crusher(toggle):
        require_crusher(build_linkage({"toggle.length": toggle}), 4e-3)

    def drawn(toggle):
        joints = {
            "O": {"bore": ["frame", *bearing], "pin": ["shaft", 0, 0]},
            "A": {"bore": ["jaw", 0, 0], "pin": ["shaft", 0.01, 0]},
            "B": {"bore": ["jaw", 0.695, 0], "pin": ["toggle", toggle, 0]},
            "C": {"bore": ["frame", 0, 0], "pin": ["toggle", 0, 0]},
        }
        bodies = {name: {"mass": 9.0, "inertia": 1.0} for name in ("shaft", "jaw", "toggle")}
        joints = loosened(joints, **dict.fromkeys("OABC", 1e-3))
        linkage(crank="shaft", speed=30.0, bodies=bodies, joints=joints)

    bearing = 0.64 * np.sin(np.pi / 8), 0.64 * np.cos(np.pi / 8)
    nearest = 0.64 - 0.01 - 4e-3  # of C and A
    for bad, limit in ((0.04, 0.695 - nearest), (1.5, 0.695 + nearest)):
        found = []
        for make in (crusher, drawn):
            low, high = bad, 0.3
            for _ in range(25):
                middle = (low + high) / 2
                try:
                    make(middle)
                except ValueError as error:
                    assert re.search("let the links close|let jaw and toggle meet", str(error))
                    low = middle
                else:
                    high = middle
            found.append(low)
        with pytest.raises(ValueError, match="with all clearances, but is at a dead point"):
            drawn(found[1])
        assert found[0] == pytest.approx(limit, abs=1e-7)  # twenty-five halves of a metre
        # At a sine s of the links' angle they are s^2 l2 l3 / (2 nearest) off their dead point, and
        # a degree of the crank away from the nearest distance less than 2e-6 m.
        early = LEAST_LEVER**2 * 0.695 * limit / (2 * nearest)
        assert abs(found[1] - found[0]) == pytest.approx(early, rel=0.02, abs=2e-6)


def test_a_joint_may_have_rollers():
    """Their numbers are keys of the joint; what they lack is the main bearing's of a crusher."""
    scene = linkage(**with_pin(**ROLLERS))
    bearing = scene.joints["B"]
    assert isinstance(bearing, RollerBearing) and float(bearing.roller_diameter) == 5e-3
    assert float(bearing.normal.count) == 2 * 20.0  # of two bearings
    motion = jc.simulate(scene, np.linspace(0, 0.02, 5), outputs=("B_reaction",))
    assert np.isfinite(np.asarray(motion.B_reaction)).all()


@pytest.mark.parametrize(
    ("description", "words"),
    [
        (with_pin(clearance=1e-6 * 0.9), "clearance / joints.B.bore_radius"),
        (with_pin(young=207e6), "joints.B.young is 0.207 GPa, usually 40"),
        (changed(gravity=98.1), "gravity is 98.1 m/s2, usually 9.76 m/s2 to 9.84"),
    ],
)
def test_what_may_be_a_slip_is_told_of_a_linkage_too(description, words):
    """Gravity may be zero: a mechanism that lies feels none."""
    assert jc.linkage_machine(**with_pin()).unusual() == []
    (line,) = jc.linkage_machine(**description).unusual()
    assert words in line and line.endswith("meant?")


def test_what_cannot_be_is_refused_of_a_linkage_too():
    frame = SUPPORTS | {"vertical_stiffness": 3e-7}
    with pytest.raises(ValueError, match=r"foundation\.vertical_stiffness` must be possible"):
        jc.linkage_machine(**changed(foundation=frame)).unusual()
    with pytest.raises(ValueError, match=r"joints\.B\.clearance` must be possible"):
        jc.linkage_machine(**with_pin(clearance=4e-3)).unusual()


def test_a_machine_is_not_made_of_links_that_do_not_close():
    """Nor is one of other numbers, in Python as on a command line."""
    machine = jc.linkage_machine(**PLAIN)
    with pytest.raises(ValueError, match="meet at every angle of the crank"):
        machine.scene(**{"joints.A.pin.x": 0.13})
    many = jax.vmap(lambda throw: machine.scene(**{"joints.A.pin.x": throw}).linkage.gravity)
    assert many(jnp.array([0.05, 0.13])).shape == (2,)  # what is traced passes


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('mass = "0.30 kg"', "mass = 0.30", r"bodies\.crank\.mass` must have a unit"),
        ('speed = "900 rpm"', "", "speed` must be given"),
        ('clearance = "0.05 mm"', "bore_diameter = 0.02", "bore_radius` must not stand beside"),
        ('clearance = "0.05 mm"', "diametral_clearance = 1", "diametral_clearance` must have a un"),
        ("[joints.B]", "[joints.A]", "is not TOML: Cannot declare"),
        ('kind = "linkage"', 'kind = "crane"', r"mine\.toml: `kind` must be one of"),
        ("[joints.B]", "[joint.B]", r"`joint` must be a known .* did you mean joints\?$"),
        ("[joints.B]", "[[joints.B]]", r"`joints\.B` must be a table \[joints\.B\] with keys such"),
        (
            "[bodies.rod]",
            "[bodies]\nrod = 1\n[points]",
            r"`bodies\.rod` must be a table \[bod",
        ),
        ("restitution", "restituton", r"`joints\.B\.restituton` .* mean joints\.B\.restitution\?$"),
        ("body = ", "bodi = ", r"`slides\.guide\.bodi` .* did you mean slides\.guide\.body\?$"),
        ("force = ", "fource = ", r"`forces\.pressure\.fource` .* mean forces\.pressure\.force\?$"),
        ("speed = ", "sped = ", r"`sped` must be a known key, but is not; did you mean speed\?$"),
        ('"0.21 kg"', '"0,21 kg"', r"`bodies\.rod\.mass` .* has a decimal comma: write '0\.21 kg'"),
        ('["60 mm", "0 mm"]', '["60", "0 mm"]', r"`bodies\.rod\.mass_centre\.x` .* has no unit"),
        ('["60 mm", "0 mm"]', '[60, "0 mm"]', r"`bodies\.rod\.mass_centre\.x` must have a unit"),
        ('"-300 N"', '"-300 kg"', r"`forces\.pressure\.force\.x` must have a unit of the kind N"),
        ('"207 GPa"', '"\u201e207 GPa\u201c"', r"`joints\.B\.young` must have no typographic"),
    ],
)
def test_refusals_of_a_file(old, new, words, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text((EXAMPLES / "pump.toml").read_text().replace(old, new), encoding="utf-8")
    with pytest.raises(ValueError, match=words) as error:
        read_machine(path)
    assert str(error.value).startswith(f"{path}: ") and "\n" not in str(error.value)


def test_a_force_may_be_that_of_a_rough_feed():
    """Its mean is the force; the wave is that of `rough_feed` with the numbers of the table."""
    force = {"body": "slider", "force": [-300.0, 0.0]}
    rough = force | {"scatter": "20 %", "seed": 3}
    plain, feed = (linkage(**changed(forces={"gas": one})).pushes[0] for one in (force, rough))
    assert isinstance(feed, RoughFeed) and isinstance(feed.steady(), type(plain))
    expected = rough_feed(plain, 0.2, 10.0, 3)
    for angle in (0.0, 1.0, 8.0):
        assert float(feed.wave(angle)) == float(expected.wave(angle))
    assert (float(feed.scatter), float(feed.bandwidth)) == (0.2, 10.0)
    seen = jax.vmap(lambda seed: linkage_of(seed).pushes[0].wave(1.0))(jnp.array([3.0, 3.5]))
    assert np.isfinite(seen[0]) and np.isnan(seen[1])


def linkage_of(seed):
    """The plain slider-crank with a rough force of a seed."""
    machine = jc.linkage_machine(**with_gas(force=[-300.0, 0.0], scatter=0.2))
    return machine.scene(**{"forces.gas.seed": seed})


def test_a_seed_of_a_linkage_is_a_whole_number_for_every_verb():
    """Also between the ends of an axis, whose limits they speak for."""
    rough = {"push": {"body": "slider", "force": [-300.0, 0.0], "scatter": 0.1, "seed": 1.0}}
    machine = jc.linkage_machine(**changed(forces=rough))
    with pytest.raises(ValueError, match=r"`forces\.push\.seed` must be a whole number"):
        jc.sweep(machine, {"forces.push.seed": [1.0, 1.5, 2.0]}, 0, 1)
    with pytest.raises(ValueError, match="`free` must name numbers that may vary continuously"):
        jc.identify(machine, [], ["forces.push.seed"])
    assert "forces.push.scatter" in machine.numbers and machine.numbers["forces.push.seed"].whole
