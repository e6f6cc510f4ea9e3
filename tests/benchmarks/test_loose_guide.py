"""Guides with a gap and with friction, against free bodies by SciPy that share no equation."""

from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from benchmarks.peers.loose_guide import GuidedSlider

EXAMPLE = jc.read_machine(Path(__file__).parents[2] / "examples" / "loose_guide.toml")
TIMES = np.linspace(0, 0.03, 301)  # 2.5 turns
HALF, GAP = 0.025, 5e-4  # m
# Nothing is at rest, or along an axis: an inclined slide off the crank, and a wrist off the middle.
ASKEW = {
    "slides.guide.along.y": 0.3,
    "slides.guide.through.y": 0.01,
    "gravity": 9.81,
    "joints.B.pin.y": 0.003,
    "bodies.slider.mass_centre.x": 0.002,
}


def largest(found, expected):
    """The largest difference over the largest value."""
    return float(np.abs(np.asarray(found) - expected).max() / np.abs(expected).max())


@pytest.mark.parametrize("rubs", [False, True], ids=["smooth", "rubbing askew"])
def test_a_slider_in_its_gap_moves_as_free_bodies(rubs):
    """With laws that are hardly smoothed; no, one and two corners touch meanwhile.

    Both programs are as far from themselves at a tenth of their tolerance: 6e-10 clearances after
    5 ms and 1e-5 after 30 ms, torn apart by impacts. With friction, whose ramp has corners that
    SciPy steps over, some ten times as far.
    """
    more = ASKEW | {"slides.guide.friction": 0.1} if rubs else {}
    machine = EXAMPLE.replace(**{"slides.guide.impact_law": "constant"} | more)
    scene = machine.scene()
    scene = eqx.tree_at(lambda s: s.joints.at("guide").normal.width, scene, jnp.asarray(1e-10))
    names = "guide_eccentricity", "guide_force", "guide_moment", "B_reaction", "slider_position"
    ours = jc.simulate(scene, TIMES, outputs=names, rtol=1e-12)
    peer = GuidedSlider(machine.values).motion(TIMES)
    play = np.stack([peer["off"], peer["tilt"] * HALF], axis=1)
    apart = np.abs(np.asarray(ours["guide_eccentricity"]) - play).max(axis=1) / GAP
    assert apart[:50].max() < (1e-6 if rubs else 1e-8)
    assert apart.max() < 1e-3
    for name, of in (("guide_force", "force"), ("guide_moment", "moment"), ("B_reaction", "B")):
        assert largest(ours[name], peer[of]) < 2e-3
    assert {0, 1, 2} <= {*peer["touching"].tolist()}


@pytest.mark.parametrize("length", [None, 0.04], ids=["middle", "ends"])
def test_a_slider_that_rubs_moves_as_free_bodies(length):
    """Reactions, friction and the torque that follows from them, to rounding of 1e4 N."""
    given = {n: v for n, v in EXAMPLE.given.items() if not n.startswith("slides.guide.")}
    kept = ("slides.guide.along.x", "slides.guide.along.y")
    given |= {name: EXAMPLE.given[name] for name in kept if name in EXAMPLE.given}
    more = ASKEW | {"slides.guide.friction": 0.2, "joints.B.pin.y": 0.01}
    more |= {} if length is None else {"slides.guide.length": length}
    machine = jc.Machine(EXAMPLE.structure, given | more)
    names = "guide_force", "guide_moment", "guide_friction", "B_reaction"
    ours = jc.simulate(machine.scene(), TIMES, outputs=names, rtol=1e-12)
    peer = GuidedSlider(machine.values).motion(TIMES)
    for name, of in zip(names, ("force", "moment", "friction", "B"), strict=True):
        assert largest(ours[name], peer[of]) < 1e-10
