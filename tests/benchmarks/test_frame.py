"""The frame on supports against EXUDYN: a rigid body on spring-dampers from its own library."""

import numpy as np
import pytest

import jaxcrusher as jc
from benchmarks.peers.crusher_bodies import PREFIXES, crusher
from benchmarks.peers.exudyn_free_bodies import Model
from jaxcrusher.scenes.parameters import PE250X400
from tests.pairs import crossed

OTHERS = (PREFIXES["B"], PREFIXES["C"])
ONE_JOINT = {name: value for name, value in PE250X400.items() if not name.startswith(OTHERS)}
SEEN = ("frame_displacement", "frame_rotation", "left_force", "right_force")
# Stiffness and damping as shares of those of a block on soil: natural frequencies of 20, 33 and
# 60 Hz; of 4.9, 8.2 and 14.7 Hz, the first of them the running frequency of 30 rad/s; and below.
BLOCKS = {"stiff": (1.0, 1.0), "near resonance": (0.06, 0.2), "isolated": (0.005, 0.05)}


def on_block(kind: str, **numbers: float | str) -> dict:
    stiffness, damping = BLOCKS[kind]
    block = {"mass": 6e3, "inertia": 2.5e3, "x": 0.3, "y": 0.2, "left": -0.7, "right": 0.9}
    block |= {"base": -0.6}
    for way, spring, damper in (("horizontal", 1e8, 1.5e5), ("vertical", 1.5e8, 2.5e5)):
        block[f"{way}_stiffness"] = stiffness * spring
        block[f"{way}_damping"] = damping * damper
    return ONE_JOINT | {f"foundation.{name}": value for name, value in block.items()} | numbers


def ours(numbers: dict, times: np.ndarray) -> dict[str, np.ndarray]:
    motion = jc.simulate(jc.build_scene(numbers), times, outputs=SEEN, rtol=1e-10)
    return {name: np.asarray(motion[name]) for name in SEEN}


def theirs(numbers: dict, known: dict, end: float, steps: int, kept: int) -> dict:
    """Return the same from where ours starts; a connector's force is on its first marker."""
    frame = np.array([*known["frame_displacement"][0], known["frame_rotation"][0], 0, 0, 0])
    model = Model(crusher(numbers, frame=frame))
    raw = model.parts.run(end, end / steps, end / kept, 0.9)
    return {
        "frame_displacement": known["frame_displacement"][0] + raw["displacement"][:, 1:3],
        "frame_rotation": raw["rotation"][:, -1],
        "left_force": raw["left"][:, 1:3],
        "right_force": raw["right"][:, 1:3],
    }


def apart(mine: dict, other: dict, name: str) -> float:
    """Return the largest difference, as a share of what moves of the quantity.

    Generalised-alpha begins without accelerations. The dampers feel that for some steps, so that
    the first ten instants are left out.
    """
    moves = np.abs(mine[name] - mine[name].mean(axis=0)).max()
    return float(np.abs(other[name] - mine[name])[10:].max() / moves)


@pytest.mark.parametrize(("kind", "speed"), crossed(BLOCKS, (25.0, 30.0, 40.0)))
def test_exudyn_agrees_to_second_order(kind, speed):
    """With ideal joints over a turn from rest: the difference falls with the step's square.

    At 1000 steps a turn T a mode of 60 Hz that rings is off by (2 pi 60 Hz T / 1000)^2 / 12 of its
    phase, 8e-4 a radian, until its damping ratio of 0.3 has ended it some 3 radians later.
    """
    numbers = on_block(kind, speed=speed, joint="ideal")
    turn, kept = 2 * np.pi / speed, 200
    mine = ours(numbers, np.linspace(0, turn, kept + 1))
    coarse, fine = (theirs(numbers, mine, turn, steps, kept) for steps in (1000, 2000))
    for name in SEEN:
        without = {name: (4 * fine[name] - coarse[name]) / 3}
        assert apart(mine, coarse, name) < 1e-3, name
        # Of fourth order: a step is 0.095 radians of the fastest mode, and 0.095^4 / 720 is 1e-7.
        assert apart(mine, without, name) < 2e-7, name


@pytest.mark.slow
def test_exudyn_agrees_with_clearance():
    """The loose main bearing on the block near resonance, without friction, over 10 ms."""
    numbers = on_block("near resonance", friction=0.0)
    end, kept = 0.01, 500
    mine = ours(numbers, np.linspace(0, end, kept + 1))
    other = theirs(numbers, mine, end, 20_000, kept)
    # As on the clamped frame: 2e-6 of a contact's phase, grown by exp(200 t).
    for name in SEEN:
        assert apart(mine, other, name) < 5e-5, name
