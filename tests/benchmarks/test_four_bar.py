"""Linkages against free bodies by numba and SciPy: those of impacts, and where drawn ones begin."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import jaxcrusher as jc
from benchmarks.peers import scipy_peer
from benchmarks.peers.any_linkage import AnyLinkage
from benchmarks.stability.mechanisms import FAMILIES, mechanism

EXAMPLES = Path(__file__).parents[2] / "examples"
TIMES = np.linspace(0, 0.024, 481)
# The loose joint, and angles some 10 deg off those at which the bars stand at the crank's angle 0.
ABOUT = {"four_bar": ("B", [0.0, 1.0, 1.8]), "six_bar": ("C", [0.0, 0.1, 0.1, 1.4, -1.4])}


# The peer takes numba some seconds to compile; single laws and ledgers have cheaper tests.
@pytest.mark.slow
@pytest.mark.parametrize("name", ABOUT)
@pytest.mark.parametrize("formulation", ["eccentricity", "multiplier"])
def test_impacts_by_free_bodies(name, formulation):
    """Eight impacts and more in 24 ms, pointwise, of two bars and of a triad."""
    loose, about = ABOUT[name]
    # The peer's contact law has its speeds of friction fixed at these. Nothing presses the pin.
    changed = {f"joints.{loose}.static_speed": 0.1, f"joints.{loose}.full_speed": 1.0}
    changed |= {"forces.load.force.x": 0.0} if name == "six_bar" else {}
    machine = jc.read_machine(EXAMPLES / f"{name}.toml")
    machine = machine.replace(**changed, start="centred", formulation=formulation)
    drawing = machine.structure
    bodies = AnyLinkage(machine.values, drawing.bodies, drawing.joints, (), (), np.array(about), {})
    hand = bodies.observe(TIMES, scipy_peer.integrate(bodies, TIMES, rtol=1e-13))
    force = hand[f"{loose}_normal_force"]
    motion = jc.simulate(machine.scene(), TIMES, outputs=tuple(hand), rtol=1e-12)
    assert bool(motion.success), motion.failure
    assert np.sum(np.diff((force > 0).astype(int)) > 0) >= 5
    # Corners of contact and friction are sharp by hand, and rounding of 1e-16 m of 0.3 m is 1e-12
    # clearances; both grow a hundred times and more over the impacts. After 30 ms processors of two
    # makers are 5e-6 and 1.6e-5 clearances off.
    off = np.abs(motion[f"{loose}_eccentricity"] - hand[f"{loose}_eccentricity"]).max()
    assert off < 1e-5 * 1e-4
    for joint in hand:
        if not joint.endswith("eccentricity"):
            off = np.abs(motion[joint] - hand[joint]).max()
            assert off < 1e-4 * np.abs(hand[joint]).max(), joint


@pytest.mark.slow
def test_free_bodies_begin_where_they_are_put():
    """The frame of a drawn linkage moves, and e turns with it."""
    drawn = mechanism(FAMILIES[2], "1 0")
    e, rates = {"O": 1e-5 - 2e-5j, "B": 3e-5j}, {"A": 0.01 + 0.02j, "B": -0.03j}
    frame = np.array([1e-4, -2e-4, 3e-3, 0.01, 0.02, 0.5])
    peer = replace(drawn.peer(e), rates=rates, frame=frame)
    found = peer.relative(peer.start)
    turn, names = np.exp(1j * frame[2]), [name for name, *_ in peer.joints]
    place = [turn * e.get(name, 0j) for name in names]
    swept = [
        turn * rates.get(n, 0j) + 1j * frame[5] * at for n, at in zip(names, place, strict=True)
    ]
    nominal = [drawn.machine.values["foundation.x"], drawn.machine.values["foundation.y"], 0.0]
    known = [*_parts(place), *(frame[:3] + nominal), *_parts(swept), *frame[3:]]
    # Rounding of positions of some metres.
    np.testing.assert_allclose(found, known, atol=1e-13)


def _parts(vectors):
    return np.array(vectors).view(float)
