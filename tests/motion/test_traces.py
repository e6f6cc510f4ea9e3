"""What is traced and compiled once, for it is what a first computation waits for."""

import diffrax
import equinox.internal as eqxi
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.last_step import earlier, floats_counted_at_once
from tests.processes import python

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
    usual = eqxi.prevbefore, eqxi.error_if
    with floats_counted_at_once():
        assert eqxi.prevbefore(eqxi.prevbefore(ends)).tolist() == earlier(ends, 2).tolist()
    assert (eqxi.prevbefore, eqxi.error_if) == usual
    for program in programs(0, 1):
        assert str(program).count("nextafter") < 10


LEAKS = """
import jaxcrusher as jc
jc.set_up()
import diffrax, jax, jax.numpy as jnp
from jaxcrusher.basics.integrate import Carried, Integration, InitialValueProblem, integrate
from jaxcrusher.basics.integrate import pi_controller
problem = InitialValueProblem(
    lambda start: Carried(start, {"sum": jnp.zeros(())}),
    lambda time, y, start: Carried(-y.motion, {"sum": y.motion}),
    lambda time, y, start: y.motion,
    lambda seen, end, kept: seen[-1],
)
method = Integration(diffrax.Tsit5(), pi_controller(1e-9), 1000, 1e-3, None)
def end(start):
    return integrate(start, jnp.array([[0.5, 1.0]]), problem=problem, method=method)[0][0]
with jax.checking_leaks():
    print(*jax.jit(jax.value_and_grad(end))(2.0))
"""


@pytest.mark.slow
def test_no_tracer_outlives_its_trace():
    """In a process of its own: JAX looks through all objects after each trace."""
    value, slope = map(float, python(LEAKS).stdout.split())
    # At a tolerance of 1e-9.
    np.testing.assert_allclose([value, slope], [2 / np.e, 1 / np.e], rtol=1e-8)
