"""Loads by the angle at a point of the jaw, and the tension rod, against EXUDYN."""

import numpy as np
import pytest

import jaxcrusher as jc
from benchmarks.peers.crusher_bodies import PREFIXES, crusher
from benchmarks.peers.exudyn_free_bodies import JawLoad, Model
from jaxcrusher.scenes.parameters import PE250X400
from tests.pairs import slow

OTHERS = (PREFIXES["B"], PREFIXES["C"])
ONE_JOINT = {name: value for name, value in PE250X400.items() if not name.startswith(OTHERS)}
FORCES = ("joint_force", "elbow_reaction", "toggle_reaction")
# Instants at the start in which the multipliers of generalised-alpha ring: 0.9 a step is left.
RINGS = 60
ROD = {
    "rod.stiffness": 1e5,
    "rod.preload": 3e3,
    "rod.damping": 800.0,
    "rod.jaw_along": 0.62,
    "rod.jaw_across": -0.04,
    "rod.x": -0.35,
    "rod.y": -0.2,
}
SPEED, POINT = 30.0, 0.42


def force(angle):
    """Return a smooth force over the shaft's angle, N."""
    return 1e4 * np.exp(2 * (np.cos(angle - 2.5) - 1))


# The series through 90 points of a curve so smooth is the curve, to rounding.
ANGLES = 2 * np.pi * np.arange(91) / 90
BY_ANGLE = {
    "load_law": "by_angle",
    "load_curve": np.stack([ANGLES, force(ANGLES)], axis=1),
    "load_direction": "normal_to_jaw",
    "load_point": POINT,
}
# Away from the fixed jaw, in axes whose x points from B to A.
THEIRS = JawLoad(POINT, lambda time: 1j * force(SPEED * time))
CASES = {
    "curve at a point": (BY_ANGLE, THEIRS),
    "rod": (ROD, None),
    "both": (BY_ANGLE | ROD, THEIRS),
}


def compared(
    case: str, names: tuple[str, ...], end: float, steps: int, kept: int, **more
) -> dict[str, np.ndarray]:
    """Return the difference of each quantity, as a share of what moves of it, over time."""
    ours, load = CASES[case]
    numbers = ONE_JOINT | {"speed": SPEED} | more
    times = np.linspace(0, end, kept + 1)
    mine = jc.simulate(jc.build_scene(numbers | ours), times, outputs=names, rtol=1e-10)
    model = Model(crusher(numbers | (ROD if "rod.x" in ours else {})), load)
    found = model.run(end, end / steps, end / kept)
    shares = {}
    for name in names:
        known = np.asarray(mine[name])
        shares[name] = (found[name] - known) / np.abs(known - known.mean(axis=0)).max()
    return shares


@pytest.mark.parametrize("case", ["both", *slow("curve at a point", "rod")])
def test_exudyn_agrees_over_a_turn(case):
    """With ideal joints; a load or an end of the rod 1 mm off would be seen."""
    apart = compared(case, FORCES, 2 * np.pi / SPEED, 1000, 200, joint="ideal")
    for name in FORCES:
        # Measured: 7e-6, of second order in the step, and 1.5e-6 by extrapolation, which the
        # tolerance of EXUDYN's own iteration leaves.
        assert np.abs(apart[name][RINGS:]).max() < 2e-5, name


@pytest.mark.slow
def test_exudyn_agrees_with_clearance():
    """The loose main bearing under curve and rod, without friction, over 10 ms."""
    apart = compared("both", ("eccentricity", "joint_force"), 0.01, 20_000, 500, friction=0.0)
    # Measured: 2.3e-7 and 7e-7. Rounding of EXUDYN's contact grows by exp(200 t), 7.
    assert np.abs(apart["eccentricity"]).max() < 1e-6
    assert np.abs(apart["joint_force"]).max() < 3e-6
