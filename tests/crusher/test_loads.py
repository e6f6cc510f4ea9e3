"""Loads: power, momentum and moments of each, wherever it acts; and their slopes."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

import jaxcrusher as jc
from jaxcrusher.basics.plane import Arm, Vector
from jaxcrusher.crusher import template as ob
from jaxcrusher.crusher.loads import (
    AbstractLoad,
    ClosingStroke,
    JawForce,
    JawMotion,
    NormalToJaw,
)
from jaxcrusher.crusher.machine import crusher_linkage, lengths_of
from jaxcrusher.mechanism.acting import push_power
from jaxcrusher.mechanism.motion import Crank, moving
from jaxcrusher.mechanism.named import Named
from tests.crusher.kinds import KINDS, at_start, check_laws, sliding
from tests.differences import assert_slopes
from tests.pairs import crossed

ANGLES = np.radians(np.arange(0, 360, 30.0))
# Of angle (rad) and force (N): it acts at every angle.
CURVE = np.stack([ANGLES, 3e3 + 6e3 * np.cos(ANGLES - 2.0) ** 2], 1)
LOADS = {
    "along": {"load_point": 0.45},
    "normal": {"load_law": "normal_to_jaw", "load_point": 0.1},
    "closing": {"load_law": "closing_stroke", "load_point": 0.6},
    "edged": {"load_law": "closing_stroke", "load_edge": 0.4, "load_point": 0.6},
    "curve": {"load_law": "by_angle", "load_curve": CURVE, "load_factor": 1.5},
    "curve along": {
        "load_law": "by_angle",
        "load_curve": CURVE,
        "load_direction": "along_jaw",
        "load_point": 0.5,
    },
    "bed": {"load_law": "chamber", "chamber.bed_exponent": 1.5},
    "none": {"load_law": "none"},
    "of one's own": {},
}


class Drag(AbstractLoad):
    """Against the velocity of a point, and turning with the shaft."""

    damping: jax.Array

    def force(self, jaw):
        shaft = 100.0 * jaw.motion.axis("shaft")
        return JawForce(shaft - self.damping * jaw.velocity(0.5), 0.5)


def scene_of(load, kind, **values):
    place = {"foundation.x": 0.2, "foundation.y": -0.1}
    scene = sliding(kind, **(place | LOADS[load] | values))
    own = load == "of one's own"
    return eqx.tree_at(lambda s: s.pushes[0], scene, Drag(jnp.asarray(3e3))) if own else scene


@pytest.mark.parametrize(("load", "kind"), crossed(LOADS, KINDS, later=["all by multipliers"]))
def test_power_and_the_reaction_on_the_fixed_jaw(load, kind):
    """A load that acts off S2 turns the jaw too; the fixed jaw carries it in the same line."""
    scene = scene_of(load, kind)
    check_laws(scene)
    # At this instant the jaws of loose joints open.
    power = float(push_power(at_start(scene), scene))
    opens = load == "none" or (load in ("closing", "bed") and kind != "ideal")
    assert power == 0 if opens else abs(power) > 1e-3


def test_the_moment_of_a_load_off_the_mass_centre():
    """By statics: of a machine that stands and weighs nothing, moments about B give the drive's.

    A force F normal to the jaw at s from A needs F (l2 - s) / l2 normal at A and the rest at B.
    """
    scene = jc.build_scene(
        {"joint": "ideal", "speed": 1e-6, "gravity": 0.0, "load_law": "normal_to_jaw"}
        | {"load_point": 0.2, "load": 1000.0}
    )
    s = at_start(scene)
    across = s.motion.axis("jaw").perp()
    share = (0.695 - 0.2) / 0.695
    assert float(ob.joint_force(s, scene).dot(across)) == pytest.approx(-1000.0 * share, rel=1e-10)
    at_elbow = ob.elbow_reaction(s, scene)
    assert float(at_elbow.dot(across)) == pytest.approx(-1000.0 * (1 - share), rel=1e-10)


def test_a_load_of_the_closing_stroke_acts_while_its_point_closes():
    """It is the normal load, times a smooth step of the speed that differences of places give."""
    times = np.linspace(0, 2 * np.pi / 30, 3601)
    described = {"joint": "ideal", "speed": 30.0, "load_point": 0.6}
    seen = ("crushing_load", "load_position")
    always, closing = (
        jc.simulate(jc.build_scene({**described, "load_law": law}), times, outputs=seen)
        for law in ("normal_to_jaw", "closing_stroke")
    )
    across = np.asarray(always.crushing_load) / 8.8e3
    velocity = np.gradient(np.asarray(always.load_position), times, axis=0)
    speed = -np.sum(velocity * across, axis=1)
    fraction = np.clip((speed + 0.01) / 0.02, 0, 1)
    share = 3 * fraction**2 - 2 * fraction**3
    assert 0.3 < np.mean(share == 0) < 0.7 and 0.3 < np.mean(share == 1) < 0.7
    # Differences leave 1e-6 m/s of the speed inside, of a step that is 0.02 m/s wide.
    np.testing.assert_allclose(
        np.asarray(closing.crushing_load)[1:-1],
        (8.8e3 * share[:, None] * across)[1:-1],
        atol=2e-4 * 8.8e3,
    )


def test_edges_of_a_closing_load_are_half_sines():
    """Inside the stroke of the sharp load, with the edges' shape over their angle; nothing else."""
    angles = np.linspace(0, 2 * np.pi, 3601)
    described = {"joint": "ideal", "load_law": "closing_stroke", "load_point": 0.6}
    sharp, edged = (
        np.linalg.norm(
            jc.simulate(
                jc.build_scene(described | more), angles / 30.0, outputs=("crushing_load",)
            ).crushing_load,
            axis=1,
        )
        / 8.8e3
        for more in ({}, {"load_edge": 0.5})
    )
    closes = sharp > 0.5
    begin = angles[np.flatnonzero(closes & ~np.roll(closes, 1))[0]]
    since = np.mod(angles - begin, 2 * np.pi)
    span = closes[:-1].mean() * 2 * np.pi
    inside = np.clip(np.minimum(since, span - since) / 0.5, 0, 1)
    # The stroke is known to a step of 0.0017 rad, where the edge rises by 0.0055 at most.
    np.testing.assert_allclose(edged, (1 - np.cos(np.pi * inside)) / 2, atol=0.012)
    with pytest.raises(ValueError, match="come with `load_law=closing_stroke`"):
        jc.build_scene({"load_law": "normal_to_jaw", "load_edge": 0.2})


def test_an_edged_load_is_refused_where_its_stroke_has_no_room_for_it():
    """B of a jaw that stands across its toggle closes twice a turn; a traced edge becomes NaN."""
    described = {"joint": "ideal", "load_law": "closing_stroke"}
    twice = described | {"bearing.distance": 0.75, "load_point": 0.695, "load_edge": 0.2}
    with pytest.raises(ValueError, match="must come with a point of the jaw that closes once"):
        jc.build_scene(twice)

    def edge(value):
        short = {"bearing.distance": 0.75, "load_point": 0.65, "load_edge": value}
        return jc.build_scene(described | short).pushes[0].edge

    with pytest.raises(ValueError, match="be at most half of the closing stroke, 72"):
        edge(1.4)
    np.testing.assert_array_equal(jax.vmap(edge)(jnp.array([1.2, 1.4])), [1.2, np.nan])


def test_a_mirrored_crusher_has_mirrored_loads():
    """With its elbow to the left of C-A a crusher has its fixed jaw to the left of its jaw."""
    one = jc.build_scene({"joint": "ideal"}).linkage

    def mirrored(body):
        arm = body.mass_centre
        return eqx.tree_at(lambda s: s.mass_centre, body, Arm(arm.x, -arm.y))

    throw, jaw, toggle = lengths_of(one).values()
    at = one.joints.at("shaft_bearing").bore.arm
    other = crusher_linkage(
        mirrored(one.bodies.at("shaft")),
        mirrored(one.bodies.at("jaw")),
        one.bodies.at("toggle"),
        eccentricity=throw,
        jaw_length=jaw,
        toggle_length=toggle,
        bearing=Vector(-at.x, at.y),
        elbow_side=1,
    )
    for angle in (0.3, 5.6):
        crank, back = Crank(jnp.asarray(angle), 30.0), Crank(jnp.asarray(np.pi - angle), -30.0)
        for load in (NormalToJaw(8e3, 0.5), ClosingStroke(8e3, 0.5)):
            here, there = (
                load.force(JawMotion(moving(linkage, turn, Named(), Named()))).force.array()
                for linkage, turn in ((one, crank), (other, back))
            )
            np.testing.assert_allclose(there, here * np.array([-1.0, 1.0]), rtol=1e-9, atol=1e-6)


def test_a_bed_is_not_pressed_to_nothing():
    """An opening that the jaw's stroke closes is refused, and NaN where it is traced."""
    described = {"joint": "ideal", "load_law": "chamber"}

    def narrowest(discharge):
        return jc.build_scene(described | {"chamber.discharge": discharge}).pushes[0].widths[-1]

    with pytest.raises(ValueError, match="presses the bed at each depth, but is 5 mm"):
        narrowest(0.005)
    widths = jax.vmap(narrowest)(jnp.array([0.005, 0.01]))
    np.testing.assert_allclose(widths, [np.nan, 0.01], rtol=0.2)


def test_a_curve_acts_at_its_angle():
    """Its points are met where the shaft is there, away from the fixed jaw."""
    scene = scene_of("curve", "ideal")
    motion = jc.simulate(scene, ANGLES / 30.0, outputs=("crushing_load", "load_position"))
    size = np.linalg.norm(motion.crushing_load, axis=1)
    np.testing.assert_allclose(size, 1.5 * CURVE[:, 1], rtol=1e-12)
    assert (np.asarray(motion.crushing_load)[:, 0] < 0).all()
    plain = jc.simulate(scene, ANGLES / 30.0, outputs=("jaw_mass_centre",))
    np.testing.assert_array_equal(motion.load_position, plain.jaw_mass_centre)


def test_slopes_by_curve_factor_and_point():
    """Of an orbit's RMS, against central differences."""
    values = {"joint": "ideal", "load_law": "by_angle", "speed": 27.0}
    curve = np.stack([ANGLES, 6e3 + 3e3 * np.cos(ANGLES - 2.0)], 1)

    def rms(numbers):
        given = jnp.stack([jnp.asarray(curve[:, 0]), numbers[:12]], 1)
        described = {"load_curve": given, "load_factor": numbers[12], "load_point": numbers[13]}
        return jc.periodic_orbit(jc.build_scene(values | described)).foundation_rms

    at = np.append(curve[:, 1], [1.1, 0.35])
    # Differences over a thousandth are right to its square.
    slopes = assert_slopes(rms, at, [20.0] * 12 + [1e-3] * 2, rtol=2e-5)
    # The force is linear in values times factor: Euler's theorem.
    assert float(slopes[:12] @ at[:12]) == pytest.approx(float(1.1 * slopes[12]), rel=1e-9)


def test_a_bed_is_pressed_as_the_jaw_moves():
    """The resultant against SciPy's quadrature over the depth, of positions by hand.

    At these instants every depth closes: no jump lies between the points.
    """
    values = {"joint": "ideal", "load_law": "chamber"}
    scene, times = jc.build_scene(values), np.arange(64) / 64 * 2 * np.pi / 30.0
    names = ("crushing_load", "load_position", "pin_position", "jaw_position")
    motion = jc.simulate(scene, times, outputs=names)
    motion = {name: np.asarray(motion[name]) for name in names}
    pin, end = motion["pin_position"], motion["jaw_position"]
    axis = (pin - end) / 0.695
    towards = np.array([axis[0, 1], -axis[0, 0]])

    fine = jc.simulate(scene, np.arange(4096) / 4096 * 2 * np.pi / 30.0, outputs=names[2:])
    ends = [np.asarray(fine[name]) for name in names[2:]]

    def pressure(s, i):
        reach = (ends[0] + (ends[1] - ends[0]) * s / 0.695) @ towards
        now = (pin + (end - pin) * s / 0.695) @ towards
        closes = now[(i + 1) % 64] > now[i - 1]
        width = 0.0340246 + (0.695 - s) * np.tan(np.radians(20))
        return closes * 2e7 * 0.4 * ((now[i] - reach.min()) / width) ** 2

    for i in (56, 59, 62):
        total = quad(pressure, 0.095, 0.695, (i,))[0]
        turned = quad(lambda s, i=i: s * pressure(s, i), 0.095, 0.695)[0]
        # Gauss's points, and the least of 4096 instants for the furthest place.
        assert np.linalg.norm(motion["crushing_load"][i]) == pytest.approx(total, rel=1e-3)
        along = np.linalg.norm(pin[i] - motion["load_position"][i])
        assert along == pytest.approx(turned / total, abs=1e-4)
    assert np.linalg.norm(motion["crushing_load"][24]) == 0
    plain = jax.jit(lambda load: jc.build_scene(values | {"load": load}).pushes)(1.0)
    assert eqx.tree_equal(plain, scene.pushes, rtol=1e-12, atol=1e-15)


def test_a_bed_has_depths_enough_for_a_peak(monkeypatch):
    """They stop closing one after the other: the peak lies there, and few depths make steps."""
    times = np.arange(720) / 720 * 2 * np.pi / 30.0

    def peak():
        scene = jc.build_scene({"joint": "ideal", "load_law": "chamber"})
        return jc.simulate(scene, times, outputs=("foundation_force",)).foundation_force.max()

    usual = float(peak())
    places, weights = np.polynomial.legendre.leggauss(100)
    monkeypatch.setattr("jaxcrusher.crusher.loads._PLACES", places)
    monkeypatch.setattr("jaxcrusher.crusher.loads._WEIGHTS", weights)
    assert usual == pytest.approx(float(peak()), rel=2e-3)


@pytest.mark.slow
def test_slopes_by_the_bed():
    """Through the furthest place too, which the links move."""

    def rms(numbers):
        described = {"joint": "ideal", "load_law": "chamber", "jaw.length": numbers[1]}
        scene = jc.build_scene(described | {"chamber.bed_modulus": numbers[0]})
        return jc.periodic_orbit(scene).foundation_rms

    # The corners of 1024 nodes, differenced over 1e-6 to 1e-3 of a number.
    assert_slopes(rms, [2e7, 0.695], [1e4, 1e-6], rtol=1e-3)
