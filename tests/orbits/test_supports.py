"""Periodic orbits of a frame on supports: closed form, limits, long integrations."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.motion.flow import flat
from jaxcrusher.orbits.shot import shoot
from jaxcrusher.periodic.multipliers import UNSURE
from jaxcrusher.periodic.trigonometric import resample
from tests.identification.by_hand import BLOCK as BLOCK_BY_HAND
from tests.pairs import slow

BLOCK = {"foundation.mass": 6000.0, "foundation.x": 0.3, "foundation.y": 0.2}
ANGLES = 2 * np.pi * np.arange(1024) / 1024


def springs(stiffness, damping=0.0):
    names = ("horizontal_stiffness", "vertical_stiffness")
    values = {f"foundation.{name}": stiffness for name in names}
    values |= {f"foundation.{side}_damping": damping for side in ("horizontal", "vertical")}
    return values


def orbit_of(nodes=None, **values):
    found = jc.periodic_orbit(jc.build_scene({**BLOCK, **values}), nodes=nodes)
    assert bool(found.success), found.failure
    return found


def test_one_rotating_unbalance():
    """The closed form of the forced system of three degrees of freedom, on either side of it.

    Without gravity, and an unbalance so small that what is not linear in it does not count.
    """
    radius, lead = 1e-6, BLOCK_BY_HAND["shaft.mass_centre_angle"]
    numbers = BLOCK_BY_HAND | {"shaft.mass_centre_radius": radius}
    hub = 0.64 * np.array([np.sin(np.pi / 8), np.cos(np.pi / 8)]) - [0.1, 0.3]
    mass = np.diag([5095.0, 5095.0, 2000.0 + 0.2 + 95 * hub @ hub])
    mass[0, 2] = mass[2, 0] = -95 * hub[1]
    mass[1, 2] = mass[2, 1] = 95 * hub[0]

    def over(horizontal, vertical):
        total = np.zeros((3, 3))
        for x in (-0.6, 0.8):
            at = np.array([[1, 0, 0.7], [0, 1, x]])
            total += at.T @ np.diag([horizontal, vertical]) @ at
        return total

    for speed in (20.0, 33.0, 60.0):
        orbit = jc.periodic_orbit(jc.build_scene(numbers | {"speed": speed}))
        assert bool(orbit.stable)
        push = 95 * radius * speed**2 * np.exp(1j * lead) * np.array([1, -1j, 0])
        push[2] = hub[0] * push[1] - hub[1] * push[0]
        stiffness = over(2e6, 3e6) + 1j * speed * over(1e4, 2e4)
        moved = np.linalg.solve(stiffness - speed**2 * mass, push)
        names = ("frame_displacement", "frame_rotation", "right_force", "transmitted_force")
        first = jc.harmonics(orbit, 1, outputs=names).isel(order=1)
        found = first.amplitude.values * np.exp(1j * first.phase.values)
        right = moved[0] + 0.7 * moved[2], moved[1] + 0.8 * moved[2]
        right = np.array(right) * ([2e6, 3e6] + 1j * speed * np.array([1e4, 2e4]))
        sent = 95 * radius * speed**2 * np.exp(1j * lead) * np.array([1, -1j])
        sent = sent + speed**2 * (mass @ moved)[:2]
        expected = np.concatenate([moved, right, sent])
        # Links of 1e-9 kg at 10 mm count 1e-7 of 95 kg at 1 um, and what is not linear 1e-6.
        np.testing.assert_allclose(found, expected, rtol=2e-5, atol=2e-5 * np.abs(found).min())
        rms = np.sqrt(np.sum(np.abs(sent) ** 2) / 2)
        assert float(orbit.transmitted_rms) == pytest.approx(rms, rel=2e-5)
        rms = speed * np.sqrt(np.sum(np.abs(moved[:2]) ** 2) / 2)
        assert float(orbit.frame_velocity_rms) == pytest.approx(rms, rel=2e-5)


@pytest.mark.parametrize("joint", ["ideal", *slow("clearance")])
def test_stiff_springs_or_a_heavy_frame_clamp_it(joint):
    still = {"foundation.x": 0.3, "foundation.y": 0.2, "joint": joint}
    clamped = jc.periodic_orbit(jc.build_scene(still))
    stiff = orbit_of(joint=joint, **springs(1e12, 1e5))
    # A block on soft springs would fall over: these hold it, and it does not follow.
    heavy = {"foundation.mass": 1e9, "foundation.inertia": 1e9, "foundation.x": 0.1}
    heavy = orbit_of(joint=joint, **heavy, **springs(3e10, 1e5))
    for name in ("foundation_rms", "foundation_mean", "foundation_peak", "shaking_rms"):
        # At 18 000 rad/s the block follows 30 to the square of their ratio, 3e-6; 641 kg move 1e9.
        for frame in (stiff, heavy):
            assert float(frame[name]) == pytest.approx(float(clamped[name]), rel=5e-6), name
    assert float(stiff.transmitted_rms) == pytest.approx(float(clamped.shaking_rms), rel=2e-5)
    moment = float(clamped.shaking_moment_rms)
    assert float(stiff.shaking_moment_rms) == pytest.approx(moment, rel=5e-6)
    assert bool(stiff.stable) and bool(heavy.stable)
    if joint == "clearance":
        apart = stiff.eccentricity[:, :2] - clamped.eccentricity
        # In clearances: the joint's force is 1e-7 another one, and its depth 0.04 clearances.
        assert float(jnp.abs(apart).max()) < 1e-6
        slow = np.sort(np.abs(clamped.multipliers))
        np.testing.assert_allclose(np.sort(np.abs(stiff.multipliers))[-4:], slow, rtol=1e-2)


def test_slowly_turned_the_springs_carry_the_weight():
    """Reactions by the lever rule, and the sag that they make in each spring."""
    orbit = orbit_of(joint="ideal", speed=2.0)
    names = ("left_force", "right_force", "frame_displacement", "frame_rotation", "jaw_mass_centre")
    mean = jc.harmonics(orbit, 1, outputs=(*names, "ground_moment")).amplitude.sel(order=0)
    left, right = (float(mean.sel(quantity=f"{side}_force_y")) for side in ("left", "right"))
    weight = 9.81 * (6000 + 641)
    assert left + right == pytest.approx(-weight, rel=1e-12)
    # About the left support, in the mean place: it moves by 0.2 mm in a metre.
    moment = float(mean.sel(quantity="ground_moment")) - 9.81 * 641 * 1.0 - 9.81 * 6000 * 1.0
    assert right * 1.6 == pytest.approx(moment, rel=1e-3)
    sag = float(mean.sel(quantity="frame_displacement_y"))
    turned = float(mean.sel(quantity="frame_rotation"))
    # 1.5e8 N/m each, 1.0 m left and 0.6 m right of G.
    assert sag - 1.0 * turned == pytest.approx(left / 1.5e8, rel=1e-4)
    assert sag + 0.6 * turned == pytest.approx(right / 1.5e8, rel=1e-4)


@pytest.mark.parametrize("joint", ["ideal", *slow("clearance")])
def test_orbit_is_where_a_long_integration_ends(joint):
    orbit = orbit_of(joint=joint)
    names = ("transmitted_rms", "frame_velocity_rms", "frame_displacement_peak", "left_peak")
    names = (*names, "transmitted_peak", "right_peak", "shaking_moment_rms", "foundation_rms")
    run = jc.poincare_section(orbit.scene, 60, 1, outputs=names)
    # The slowest disturbance keeps 0.45 of itself a turn; integration has steps of 1e-9.
    np.testing.assert_allclose(run.states[-1], orbit.section, rtol=0, atol=1e-6)
    for name in names:
        # Peaks are tops of parabolas through 1024 samples a turn, or of a polynomial.
        allowed = 1e-5 if name.endswith("peak") else 1e-7
        np.testing.assert_allclose(run.values[name][0], orbit[name], rtol=allowed, err_msg=name)


@pytest.mark.slow
def test_multipliers_against_the_section():
    orbit = orbit_of(**springs(2e6, 2e3))
    section = jc.poincare_section(orbit.scene, 0, 1, slices=8, state=orbit.section, rtol=1e-11)
    product = np.linalg.multi_dot([np.asarray(m) for m in section.jacobians[::-1]])
    assert product.shape == (10, 10)
    found, expected = (
        np.sort_complex(np.asarray(values))
        for values in (orbit.multipliers, np.linalg.eigvals(product))
    )
    # Both err by some 1e-8; a matrix far from normal doubles digits lost.
    np.testing.assert_allclose(found, expected, atol=1e-6)
    # Five pairs: two of the pin, three of the block, which no contact damps.
    assert orbit.multipliers.shape == (10,) and orbit.stable


@pytest.mark.slow
def test_multipliers_of_very_stiff_springs():
    """Springs of 1e14 N/m swing at 1.1e5 rad/s, which only the shortest steps resolve."""
    orbit = orbit_of(joint="ideal", **springs(1e14, 1e5))
    clamped = jc.periodic_orbit(jc.ideal_scene(30.0))
    # (30 / 1.1e5)^2
    assert float(orbit.transmitted_rms) == pytest.approx(float(clamped.shaking_rms), rel=1e-7)
    assert orbit.stable and orbit.multipliers_error < UNSURE
    # A mode of the standing machine decays by exp(-zeta omega T); the linkage changes it by 1e-3.
    modes = jc.natural_modes(orbit.scene)
    decay = modes.damping_ratio.values * 2 * np.pi * modes.frequency.values
    expected = np.exp(-np.min(decay) * 2 * np.pi / 30)
    assert float(orbit.largest_multiplier) == pytest.approx(expected, rel=2e-3)


@pytest.mark.slow
def test_multipliers_that_overflow_are_not_trusted():
    """Those of springs of 1e16 N/m are known; without them the stability is unknown."""
    orbit = orbit_of(joint="ideal", **springs(1e16, 1e5))
    assert orbit.stable and orbit.multipliers_error < 1e-6
    unknown = dataclasses.replace(orbit, multipliers_error=jnp.asarray(jnp.inf))
    assert unknown.undecided and not unknown.stable
    assert unknown.instability.startswith("Its multipliers are not known")


@pytest.mark.slow
def test_power_over_a_period():
    """The drive gives what load, contact and dampers take: energies come back to themselves."""
    works = []
    # As many nodes as the load's steps need: fewer are not tried.
    ideal = {"joint": "ideal", "load_law": "closing_stroke", "nodes": 384}
    for values in (ideal, {"slip": "surface", "nodes": 96}):
        orbit, turn = orbit_of(**values, **springs(5e7, 1e5)), 2 * np.pi / 30
        run = jc.simulate(orbit.scene, [0.0, turn], state=orbit.section, outputs=("energy",))
        ledger = run.energy
        given = float(ledger.drive_work[1] + ledger.load_work[1])
        lost = ledger.contact_loss + ledger.friction_loss + ledger.support_loss
        # Work of up to 1e3 J over a turn that closes to 1e-6 of a clearance.
        assert given == pytest.approx(float(lost[1]), abs=1e-5)
        work = float(orbit.drive_power) * turn
        # Friction feels how well the orbit closes.
        assert work == pytest.approx(float(ledger.drive_work[1]), rel=2e-6)
        works.append(ledger)
    ideal, sliding = works
    assert float(ideal.support_loss[1]) > 0.1 and abs(float(ideal.load_work[1])) > 10
    assert float(sliding.friction_loss[1]) > 10


@pytest.mark.slow
def test_an_orbit_that_is_shot_for_is_the_same():
    orbit = orbit_of(**springs(5e7, 1e5))
    found = shoot(orbit.scene, orbit.section, 1)
    assert bool(found.success), found.failure
    count = len(orbit.eccentricity)
    # Newton's last step is 1e-7; a frame's displacement counts from its sag in both.
    apart = np.abs(resample(found.eccentricity, count) - orbit.eccentricity).max()
    assert float(apart) < 1e-6
    # Peaks of a turn are seen at 1024 instants, and those of nodes between them too.
    for name, share in (
        ("transmitted_rms", 1e-7),
        ("shaking_moment_rms", 1e-7),
        ("frame_displacement_peak", 1e-5),
    ):
        assert float(found[name]) == pytest.approx(float(orbit[name]), rel=share), name


@pytest.mark.parametrize(("joint", "size"), [("ideal", 3), *slow(("clearance", 5))])
def test_a_state_of_the_orbit_and_harmonics_of_supports(joint, size):
    orbit = orbit_of(joint=joint)
    assert orbit.eccentricity.shape[1] == size
    np.testing.assert_allclose(flat(orbit.state()), orbit.section, rtol=1e-12)
    seen = {name: np.asarray(value) for name, value in orbit.motion(ANGLES).items()}
    np.testing.assert_allclose(
        seen["left_force"] + seen["right_force"], seen["transmitted_force"], rtol=1e-12
    )
    moving = seen["transmitted_force"] - seen["transmitted_force"].mean(axis=0)
    rms = np.sqrt(np.mean(np.sum(moving**2, axis=1)))
    assert float(orbit.transmitted_rms) == pytest.approx(rms, rel=1e-9)
    moved = seen["frame_displacement"] - seen["frame_displacement"].mean(axis=0)
    top = np.linalg.norm(moved, axis=1).max()
    # 1024 instants of a turn see the top of a smooth peak to 1e-5.
    assert top <= float(orbit.frame_displacement_peak) < top * (1 + 1e-5)
    found = jc.harmonics(orbit, outputs=("left_force", "right_force"))
    names = ["left_force_x", "left_force_y", "right_force_x", "right_force_y"]
    assert list(found["quantity"].values) == names and found.sizes["order"] == 7
