"""The judges of several loose joints: free bodies by SciPy, and by EXUDYN."""

import numpy as np
import pytest

import jaxcrusher as jc
from benchmarks.peers import crusher_bodies, exudyn_free_bodies, motion, scipy_peer, sundials_peer
from benchmarks.peers.any_linkage import AnyLinkage, instant
from benchmarks.peers.crusher_bodies import PREFIXES, crusher
from benchmarks.peers.equations import Crusher, dot
from benchmarks.peers.free_bodies_numba import CompiledBodies
from benchmarks.peers.motion import Motion
from jaxcrusher.scenes.parameters import PE250X400
from tests.pairs import crossed, slow

OTHERS = (PREFIXES["B"], PREFIXES["C"])
FORCES = ("bearing_reaction", "elbow_reaction", "toggle_reaction", "normal_force")
CLEARANCES = {"A": 6e-5, "B": 1e-4, "C": 8e-5, "O": 7e-5}
JOINTS = ("B", "centre"), ("ABCO", "surface"), ("AC", "centre"), ("O", "centre")
TIGHT = (("clearance", 1e-6), ("friction", 0.0))


def described(loose: str, slip="surface", friction=0.1) -> dict:
    """With the joints named in `loose`, all of one friction; the others are ideal."""
    of_a = {name: value for name, value in PE250X400.items() if not name.startswith(OTHERS)}
    numbers = of_a | {"slip": slip, "friction": friction}
    for joint in loose:
        prefix = PREFIXES[joint]
        numbers |= {prefix + "clearance": CLEARANCES[joint], prefix + "friction": friction}
    return numbers if "A" in loose else numbers | {"joint": "ideal"}


def free_bodies(loose: str, slip="surface", friction=0.1, **start) -> AnyLinkage:
    return crusher(described(loose, slip, friction), **start)


def run(bodies: AnyLinkage, times, rtol=1e-11):
    states = scipy_peer.integrate(bodies, times, rtol=rtol)
    return crusher_bodies.observe(bodies, times, states)


def largest(values) -> float:
    return float(abs(values).max())


def apart(loose: str, mine, other) -> float:
    """The largest difference of eccentricities, in clearances."""
    return max(
        largest(mine[name] - other[name]) / CLEARANCES[joint]
        for joint in loose
        for name in [PREFIXES[joint] + "eccentricity"]
    )


@pytest.mark.parametrize("friction", [None, 0.1])
def test_a_alone_is_the_chain_in_angles(friction):
    times, e, rate = 2e-5 * np.arange(300), (2 + 3j) * 1e-5, 0.02 - 0.01j
    mine = run(free_bodies("A", friction=friction or 0.0, e={"A": e}, rates={"A": rate}), times)
    chain = Motion(Crusher(friction=friction), e=e, rate=rate)
    other = chain.observe(times, scipy_peer.integrate(chain, times))
    assert other["normal_force"].max() > 1e5
    # Both at rtol 1e-11 of 1 m, that is 1e-7 clearances; the force is some ten times as sensitive.
    assert apart("A", mine, other) < 1e-7
    for name in FORCES:
        assert largest(mine[name] - other[name]) < 1e-6 * largest(other[name])


@pytest.mark.slow
@pytest.mark.parametrize("loose", ["ABC", "AC", "B", "C"])
def test_compiled_moves_as_free_bodies(loose):
    times = 1e-5 * np.arange(151)
    thrown = {"A": -1 + 0j, "B": 1 + 2j, "C": 1 - 1j}
    bodies = free_bodies(loose, rates={joint: thrown[joint] for joint in loose})
    compiled = CompiledBodies(bodies)
    mine = compiled.observe(times, sundials_peer.cvode(compiled, times))
    theirs = run(bodies, times, rtol=1e-12)
    assert all(theirs[f"{PREFIXES[joint]}normal_force"].max() > 1e3 for joint in loose)
    # 1e-12 of 1 m or of a clearance a step, over some hundred steps of an impact; 8e-9 was seen.
    assert apart(loose, mine, theirs) < 1e-7
    forces = sum(np.hypot(*theirs[name].T) for name in FORCES[:3:2])
    assert largest(mine["foundation_force"] - forces) < 1e-6 * largest(forces)


def test_ideal_joints_are_the_closed_form():
    times = 1e-4 * np.arange(200)
    mine, other = run(free_bodies(""), times), motion.ideal(Crusher(), times)
    # Accelerations fit positions that have drifted by rtol 1e-11 a step.
    for name in ("bearing_reaction", "elbow_reaction", "toggle_reaction"):
        assert largest(mine[name] - other[name]) < 1e-8 * largest(other[name])


@pytest.mark.parametrize("slip", ["surface", "centre"])
@pytest.mark.parametrize(("loose", "law"), [("ABC", "along_jaw"), ("B", "normal_to_jaw")])
def test_power(loose, law, slip):
    """Jaw and toggle gain what load, weight and joints do, at random states in contact."""
    random, numbers = np.random.default_rng(0), described(loose, slip) | {"load_law": law}
    for _ in range(40):
        depths, turns = 10 ** random.uniform(-2, 0.5, 3), random.uniform(0, 2 * np.pi, 3)
        ways = dict(zip("ABC", (1 + depths) * np.exp(1j * turns), strict=True))
        e = {joint: complex(CLEARANCES[joint] * ways[joint]) for joint in loose}
        rates = {joint: complex(*random.uniform(-5, 5, 2)) for joint in loose}
        bodies = crusher(numbers, e, rates)
        y, spins = bodies.start, bodies.start[14::3]
        found, at_bores, _, normals, *_ = instant(0.0, y, bodies.numbers)
        places, moving = (half[0::3] + 1j * half[1::3] for half in (y[:12], y[12:]))
        gained = 0.0
        for body in (2, 3):
            mass, inertia = bodies.numbers[2][body]
            speed_up = complex(*found[3 * body : 3 * body + 2]) + 1j * numbers["gravity"]
            gained += mass * dot(moving[body], speed_up)
            gained += inertia * spins[body] * found[3 * body + 2]
        jaw = np.exp(1j * y[8])
        way = -jaw if law == "along_jaw" else 1j * jaw
        works = [dot(numbers["load"] * way, moving[2])]
        for j, (joint, *_) in enumerate(bodies.joints[:3]):
            (bore, pin), (arm, _) = bodies.numbers[3][j], bodies.numbers[4][j]
            centre = places[bore] + arm * np.exp(1j * y[3 * bore + 2])
            # A loose joint's force is on the surface of the bore.
            radius = bodies.numbers[5][j, 1]
            n = e[joint] / abs(e[joint]) if joint in loose else 0j
            of_bore, of_pin = (
                moving[i] + 1j * spins[i] * (centre + radius * n - places[i]) for i in (bore, pin)
            )
            works.append(dot(at_bores[j], of_bore) * (bore != 0))
            works.append(-dot(at_bores[j], of_pin) * (pin != 1))
            if joint in loose and slip == "surface":
                speed = abs(dot(of_bore - of_pin, 1j * n))
                rubbed = 0.1 * min(max((speed - 0.1) / 0.9, 0.0), 1.0) * normals[j] * speed
                lost = -dot(at_bores[j], of_bore - of_pin) - normals[j] * dot(rates[joint], n)
                assert lost == pytest.approx(rubbed, rel=1e-9, abs=1e-9 * abs(normals[j]))
        # Rounding of forces of 1e6 N at some m/s.
        assert gained == pytest.approx(sum(works), abs=1e-11 * np.abs(works).max())


def test_given_start():
    e = {"A": (2 + 3j) * 1e-5, "B": (-4 + 1j) * 1e-5, "C": (1 - 5j) * 1e-5, "O": (3 + 2j) * 1e-5}
    rates = {"A": 0.03 - 0.01j, "B": 0.02 + 0.04j, "C": -0.05 + 0.01j, "O": -0.04 - 0.02j}
    step = 1e-6
    known = run(free_bodies("ABCO", e=e, rates=rates), step * np.arange(3))
    for joint in e:
        prefix = PREFIXES[joint]
        assert known[prefix + "normal_force"].max() == 0
        here, soon, later = known[prefix + "eccentricity"].view(complex)[:, 0]
        # Rounding of positions of 1 m.
        assert abs(here - e[joint]) < 1e-15
        # Second order: 1e-12 of third derivatives, below 1e5 m/s3; rounding, 1e-16 over 1e-6.
        assert abs((4 * soon - later - 3 * here) / (2 * step) - rates[joint]) < 1e-8


@pytest.mark.parametrize(("loose", "most"), [("ABCO", 5e-4), *slow(("ABC", 5e-5))])
def test_exudyn_agrees_to_second_order(loose, most):
    """The difference falls with the square of EXUDYN's step."""
    bodies = free_bodies(loose, friction=0.0)
    known = run(bodies, 1e-5 * np.arange(1001))
    found = {h: exudyn_free_bodies.Model(bodies).run(0.01, h) for h in (1e-6, 5e-7)}
    coarse, fine = (apart(loose, other, known) for other in found.values())
    # (2 pi 740 Hz 1e-6 s)^2 / 12 of the phase of a contact, 2e-6, grown by exp(200 t), 7. With the
    # shaft loose too a force passes two contacts in a row, and the error grows ten times as much.
    assert coarse < most
    assert coarse / fine == pytest.approx(4, rel=0.05)
    for name in ("joint_force", "elbow_reaction", "toggle_reaction"):
        assert largest(found[1e-6][name] - known[name]) < 5e-4 * largest(known[name])


@pytest.mark.slow
@pytest.mark.parametrize("slip", ["centre", "surface"])
def test_exudyn_agrees_with_friction(slip):
    """From a start in which all three joints touch and slide."""
    angles, ways = dict(zip("ABC", (0.5, 2.5, 4.5), strict=True)), {"A": 1, "B": -1, "C": 1}
    e = {j: complex(1.01 * CLEARANCES[j] * np.exp(1j * turn)) for j, turn in angles.items()}
    # Impacts stay below 0.5 m/s, from which on EXUDYN takes their own speeds.
    rates = {j: 0.3j * ways[j] * at / abs(at) for j, at in e.items()}
    bodies, free = (free_bodies("ABC", slip, mu, e=e, rates=rates) for mu in (0.1, 0.0))
    times = 1e-5 * np.arange(201)
    known, without = run(bodies, times), run(free, times)
    found = exudyn_free_bodies.Model(bodies).run(0.002, 2e-6)
    # 3e-4 was measured, of second order in the step. Friction moves each joint by far more.
    for joint in "ABC":
        assert apart(joint, found, known) < 6e-4 < 0.1 * apart(joint, without, known)
    # EXUDYN's contacts have no force yet at time 0.
    for name in ("joint_force", "elbow_reaction", "toggle_reaction"):
        assert largest((found[name] - known[name])[1:]) < 2e-3 * largest(known[name])


@pytest.mark.parametrize("name", ["load_law", "contact_law", "elbow.contact_law"])
def test_other_laws_are_refused(name):
    with pytest.raises(ValueError, match=name):
        crusher(PE250X400 | {name: "none"})


@pytest.mark.parametrize(
    ("formulation", "joints"),
    crossed(("eccentricity", "multiplier"), JOINTS, later=JOINTS[2:]),
)
def test_the_package_moves_as_free_bodies(formulation, joints):
    loose, slip = joints
    bodies, times = free_bodies(loose, slip), 1e-5 * np.arange(501)
    numbers = described(loose, slip) | {"formulation": formulation}
    numbers |= {f"{PREFIXES[joint]}slip": slip for joint in loose}
    scene = jc.build_scene({name: v for name, v in numbers.items() if name != "start"})
    names = [name for name in scene.observables if "eccentricity" in name]
    assert f"{PREFIXES[loose[-1]]}eccentricity".replace(".", "_") in names
    forces = ("joint_force", "elbow_reaction", "toggle_reaction", "bearing_reaction")
    ours = jc.simulate(scene, times, outputs=(*names, *forces))
    theirs = run(bodies, times)
    # Unsmoothed contacts are 5e-8 clearances off by then; nine coordinates know a position of
    # 0.6 m to 2e-14 m a step, or 3e-10 clearances, which a thousand steps of impacts add to 1e-6.
    close = 2e-7 if formulation == "eccentricity" else 2e-6
    for joint in loose:
        name = PREFIXES[joint] + "eccentricity"
        apart = largest(np.asarray(ours[name.replace(".", "_")]) - theirs[name])
        assert apart < close * CLEARANCES[joint], (joint, apart / CLEARANCES[joint])
    for name in forces:
        # A force is some ten times as sensitive: depths are hundredths of a clearance.
        apart = largest(np.asarray(ours[name]) - theirs[name])
        assert apart <= 10 * close * largest(theirs[name]), name  # none in flight


@pytest.mark.slow
def test_tight_seats_soften_the_first_impact():
    """Two seats as stiff as the bearing itself, however tight, take a sixth off the impact at A.

    153 906 N by free bodies at a play of 1 um in B and C, 181 152 N with ideal ones.
    """
    times = 1e-6 * np.arange(4000)
    tight = {f"{joint}.{name}": value for joint in ("elbow", "pivot") for name, value in TIGHT}
    peaks = [
        float(
            jc.simulate(
                jc.build_scene({"friction": 0.0, **values}), times, outputs=("normal_force",)
            ).normal_force.max()
        )
        for values in ({}, tight)
    ]
    # Looked at every microsecond of an impact of 1 ms: 1e-6 of its peak.
    assert peaks == pytest.approx([181_152, 153_906], rel=1e-5)
