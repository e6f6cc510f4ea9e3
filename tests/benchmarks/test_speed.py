"""Regression guard: ratios of CPU time between programs run in turn in one process.

What else the machine does meets all of them; a bound is at least twice the ratio measured on a
quiet machine, which stands beside it. Without XLA's loop flag the second and third fail.
"""

import equinox as eqx
import jax
import pytest

import jaxcrusher as jc
from tests.benchmarks import step_programs as programs

# A guard of speed needs a machine that does little else, and programs as users have them.
pytestmark = [pytest.mark.slow, pytest.mark.optimised]

TURNS = 2


@pytest.fixture(scope="module")
def costs():
    designs = programs.designs("contact", TURNS, side=4)

    def ideal(speed):
        found = jc.statistics(jc.ideal_scene(speed), 0, TURNS, outputs=("foundation_rms",))
        return programs.Found(found.foundation_rms, found.outcome.steps)

    compiled = eqx.filter_jit(lambda speeds: jax.lax.map(ideal, speeds))
    asked = {
        "turn": programs.in_turn(designs),
        "vmap": programs.vmap(designs),
        "numba": programs.numba(designs),
        "ideal": lambda: jax.block_until_ready(compiled(designs.scenes.drive.speed)),
    }
    return programs.costs(asked, repeats=7)


def test_a_step_in_lanes_beside_numba():
    # Fewer designs leave the lanes empty, and a batch costs milliseconds besides.
    designs = programs.designs("contact", TURNS)
    pair = {"lanes": programs.in_lanes(designs), "numba": programs.numba(designs)}
    costs = programs.costs(pair, repeats=7)
    assert costs["lanes"].cpu / costs["numba"].cpu < 0.45  # 0.22


def test_a_step_beside_numba(costs):
    assert costs["turn"].cpu / costs["numba"].cpu < 5  # 1.5 to 2.2


def test_a_step_one_after_the_other_beside_vmap(costs):
    assert costs["turn"].cpu / costs["vmap"].cpu < 2.5  # 0.8 to 1.2


def test_a_turn_without_clearance_beside_the_full_one(costs):
    def total(name):
        return costs[name].cpu * int(costs[name].found.steps.sum())

    assert total("ideal") / total("turn") < 0.5  # 0.1 to 0.2
