"""A function of one design, run for many: lanes do its integrations, JAX the rest.

The function is traced once, each integration a single equation of the trace, and the trace of
one design serves all that are like it.
"""

import threading
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import PyTree

from jaxcrusher.batch.lanes.block import Block
from jaxcrusher.batch.lanes.engine import Device
from jaxcrusher.batch.lanes.integration import Value, stacked
from jaxcrusher.batch.lanes.known import Unsupported
from jaxcrusher.batch.lanes.recorded import integrates, record
from jaxcrusher.motion.integrate import integrator


class NoIntegration(Unsupported):
    """There is nothing to do for lanes."""


class Program:
    """A function traced for one design like `scene`; its own arrays are the same for all designs.

    Raises `Unsupported` for what lanes cannot do.
    """

    def __init__(self, function: Callable[[Any], PyTree], scene: PyTree, device: Device) -> None:
        numbers, rest = eqx.partition(function, _is_array)
        with integrator(record):
            jaxpr, shapes = jax.make_jaxpr(
                lambda numbers, scene: eqx.combine(numbers, rest)(scene), return_shape=True
            )(numbers, scene)
        if not any(integrates(equation) for equation in jaxpr.jaxpr.eqns):
            raise NoIntegration
        self._results = jax.tree.structure(shapes)
        self._block = Block(jaxpr, _batched(numbers, False) + _batched(scene, True), device)

    def __call__(self, function: Callable[[Any], PyTree], scenes: PyTree) -> PyTree:
        """The results for scenes stacked along the first axis of every leaf, stacked alike."""
        alike = jax.tree.leaves(eqx.filter(function, _is_array))
        leaves = [Value(np.asarray(leaf), True) for leaf in jax.tree.leaves(scenes)]
        count = len(leaves[0].array)
        operands = [*(Value(leaf, False) for leaf in alike), *leaves]
        results = [stacked(value, count) for value in self._block.run(operands, count)]
        return jax.tree.unflatten(self._results, results)


def _is_array(leaf: Any) -> bool:
    return isinstance(leaf, jax.Array | np.ndarray)


def _batched(tree: PyTree, batched: bool) -> list[bool]:
    return [batched] * len(jax.tree.leaves(tree))


# Key -> program, or why there is none; the newest last.
_PROGRAMS: dict[Any, Program | Unsupported] = {}
_MOST_PROGRAMS = 64
# A function that is traced may itself run a batch.
_LOCK = threading.RLock()


def program(function: Callable[[Any], PyTree], scenes: PyTree, device: Device) -> Program:
    """The program of a function for stacked scenes, from an earlier call if there was one like it.

    Raises `Unsupported` for what lanes cannot do.
    """
    scene = jax.tree.map(lambda leaf: np.asarray(leaf)[0], scenes)
    numbers, rest = eqx.partition(function, _is_array)
    fixed, tree = jax.tree.flatten(rest)
    shapes = [(leaf.shape, leaf.dtype) for leaf in jax.tree.leaves((numbers, scene))]
    key = (device, *fixed, tree, jax.tree.structure((numbers, scene)), *shapes)
    with _LOCK:
        if key not in _PROGRAMS:
            try:
                _PROGRAMS[key] = Program(function, scene, device)
            except Unsupported as error:
                _PROGRAMS[key] = error
            if len(_PROGRAMS) > _MOST_PROGRAMS:
                del _PROGRAMS[next(iter(_PROGRAMS))]
        found = _PROGRAMS[key]
    if isinstance(found, Unsupported):
        raise found
    return found
