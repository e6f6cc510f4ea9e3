"""What is traced and compiled once, for it is what a first computation waits for."""

import diffrax
import equinox.internal as eqxi
import jax
import jax.numpy as jnp
import numpy as np

import jaxcrusher as jc
from jaxcrusher.motion.last_step import earlier

steps = []


class Counted(diffrax.Tsit5):
    def step(self, *args, **kwargs):
        steps.append(args)
        return super().step(*args, **kwargs)


def programs(settle_turns, turns):
    """Traced only: a motion, and its slope."""

    def rms(speed):
        scene, method = jc.paper_scene(speed, 6e-5), jc.Method(Counted())
        names = ("foundation_rms",)
        return jc.statistics(scene, settle_turns, turns, outputs=names, method=method)[names[0]]

    return jax.make_jaxpr(rms)(30.0), jax.make_jaxpr(jax.grad(rms))(30.0)


def test_programs_of_other_counts_share_a_trace():
    steps.clear()
    programs(0, 1)
    once = len(steps)
    assert once > 0
    programs(1, 3)
    assert len(steps) == once


def test_diffrax_counts_a_hundred_floats_back_from_the_end_at_once():
    ends = jnp.array([2 * np.pi, 1.0, 1e-3, 123.456, np.nextafter(2.0, 3.0), -0.7])
    floor = ends
    for _ in range(100):
        floor = eqxi.prevbefore(floor)
    assert earlier(ends, 100).tolist() == floor.tolist()
    assert earlier(jnp.zeros(()), 100) == 0
    for program in programs(0, 1):
        assert str(program).count("nextafter") < 10
