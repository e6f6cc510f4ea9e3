"""Linkages against free bodies by numba and SciPy: the four-bar, and where drawn ones begin."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import jaxcrusher as jc
from benchmarks.peers import scipy_peer
from benchmarks.peers.any_linkage import AnyLinkage
from benchmarks.stability.mechanisms import FAMILIES, mechanism

FILE = Path(__file__).parents[2] / "examples" / "four_bar.toml"
# The peer's contact law has its speeds of friction fixed at these.
CHANGED = {"start": "centred", "joints.B.static_speed": 0.1, "joints.B.full_speed": 1.0}
TIMES = np.linspace(0, 0.03, 601)
# Some 10 deg off those at which the bars stand at the crank's angle 0.
ABOUT = np.array([0.0, 1.0, 1.8])


# The peer takes numba some seconds to compile; single laws and ledgers have cheaper tests.
@pytest.mark.slow
@pytest.mark.parametrize("formulation", ["eccentricity", "multiplier"])
def test_impacts_of_a_four_bar_by_free_bodies(formulation):
    """Some ten impacts in 30 ms, pointwise."""
    machine = jc.read_machine(FILE).replace(**CHANGED, formulation=formulation)
    drawing = machine.structure
    bodies = AnyLinkage(machine.values, drawing.bodies, drawing.joints, (), (), ABOUT, {})
    hand = bodies.observe(TIMES, scipy_peer.integrate(bodies, TIMES, rtol=1e-13))
    force = hand["B_normal_force"]
    motion = jc.simulate(machine.scene(), TIMES, outputs=tuple(hand), rtol=1e-12)
    assert bool(motion.success), motion.failure
    assert np.sum(np.diff((force > 0).astype(int)) > 0) >= 5
    # Corners of contact and friction are sharp by hand, and rounding of 1e-16 m of 0.3 m is 1e-12
    # clearances; both grow a hundred times and more over the impacts.
    assert np.abs(motion.B_eccentricity - hand["B_eccentricity"]).max() < 1e-5 * 1e-4
    for name in ("B_normal_force", "O_reaction", "A_reaction", "D_reaction"):
        off = np.abs(motion[name] - hand[name]).max()
        assert off < 1e-4 * np.abs(hand[name]).max(), name


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
