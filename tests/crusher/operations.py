"""The number of operations of a program, before XLA, without those whose results nobody uses."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.extend.core import Jaxpr
from jax.interpreters.partial_eval import dce_jaxpr

import jaxcrusher as jc


def operations(program: Jaxpr) -> int:
    """Count the equations of a traced program on which its results depend."""
    used, _ = dce_jaxpr(program, [True] * len(program.outvars))
    return _equations(used)


def _equations(program: Jaxpr) -> int:
    """Count the equations of a program, with those of its inner programs."""
    total = 0
    for equation in program.eqns:
        inner = [
            leaf
            for value in equation.params.values()
            for leaf in jax.tree.leaves(value, is_leaf=lambda x: hasattr(x, "jaxpr"))
        ]
        programs = [getattr(leaf, "jaxpr", leaf) for leaf in inner]
        programs = [program for program in programs if hasattr(program, "eqns")]
        total += sum(map(_equations, programs)) if programs else 1
    return total


def traced(function, scene: jc.Scene):
    """Return the program of `function(scene)`, its numbers as arguments."""
    numbers, rest = eqx.partition(scene, eqx.is_array)
    return jax.jit(lambda numbers: jax.tree.leaves(function(eqx.combine(numbers, rest)))), numbers


def field_operations(scene: jc.Scene) -> int:
    """Count the operations of one evaluation of the equations of motion."""
    state = scene.formulation.initial(scene)

    def rate(scene):
        snapshot = scene.formulation.snapshot(jnp.array(0.1), state, scene)
        return scene.formulation.rate(snapshot, state, scene), snapshot.accelerations.forces["main"]

    program, numbers = traced(rate, scene)
    return operations(jax.make_jaxpr(program)(numbers).jaxpr)
