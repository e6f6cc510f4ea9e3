"""A function of one design, run for many: lanes do its integrations, JAX the rest.

The function is traced once, each integration a single equation of the trace, and the trace of one
design serves all that are like it. The trace is cut at its integrations, and JAX computes the parts
between them for all designs.
"""

import threading
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr, DebugInfo, Jaxpr, JaxprEqn, Literal, Var, jaxpr_as_fun
from jaxtyping import PyTree

from jaxcrusher.basics.devices import processor
from jaxcrusher.lanes.layout import Designs
from jaxcrusher.lanes.machine import Target, run
from jaxcrusher.lanes.record import IN_A_HURRY, Recorded, integrates, integration_p
from jaxcrusher.lanes.verify import Unsupported, inlined

# Designs that JAX computes side by side: always as many, so that one program, with one rounding,
# computes batches of any size; and how many times as many there is room for.
TILE, ROOMS = 64, tuple(16 * 4**i for i in range(12))


class NoIntegration(Unsupported):
    """The function has no integration for lanes."""


class Value(NamedTuple):
    """An array; if `batched`, its first axis is that of the designs."""

    array: Any
    batched: bool

    def stacked(self, count: int) -> np.ndarray:
        """Return it with an axis of the designs."""
        array = np.asarray(self.array)
        return array if self.batched else np.broadcast_to(array, (count, *array.shape))


class Program:
    """A function traced for one design like `scene`, and cut at its integrations.

    Its own arrays are the same for all designs. Raises `Unsupported` for what lanes cannot do.
    """

    def __init__(self, function: Callable[[Any], PyTree], scene: PyTree, target: Target) -> None:
        numbers, rest = eqx.partition(function, _is_array)
        jaxpr, shapes = jax.make_jaxpr(
            lambda numbers, scene: eqx.combine(numbers, rest)(scene), return_shape=True
        )(numbers, scene)
        if not any(integrates(equation) for equation in jaxpr.jaxpr.eqns):
            raise NoIntegration
        self._results = jax.tree.structure(shapes)
        self._constants: dict[Var, Any] = {}
        self._operands = [Var(variable.aval) for variable in jaxpr.jaxpr.invars]
        equations, self._outputs = inlined(jaxpr, self._operands, self._constants, integrates)
        self._constants = {variable: np.asarray(c) for variable, c in self._constants.items()}
        alike = len(jax.tree.leaves(numbers))
        self._batched = {variable: i >= alike for i, variable in enumerate(self._operands)}
        self._steps = self._cut(equations, target)

    def _cut(self, equations: list[JaxprEqn], target: Target) -> "list[_Integration | _Group]":
        """Cut equations at integrations; what is the same for all designs comes first."""
        alike, pieces = [], [[]]
        for equation in equations:
            flags = self._flags(equation.invars)
            differs = any(flags)
            if equation.primitive is integration_p:
                pieces += [_Integration(equation, target), []]
                differs = True
            elif integrates(equation):
                raise Unsupported(f"an integration inside `{equation.primitive.name}`")
            else:
                (pieces[-1] if differs else alike).append(equation)
            self._batched |= dict.fromkeys(equation.outvars, differs)
        return [
            self._group(piece, equations) if isinstance(piece, list) else piece
            for piece in (alike, *pieces)
            if piece != []
        ]

    def _flags(self, operands: Sequence[Any]) -> list[bool]:
        """Say which operands differ between the designs."""
        return [not isinstance(v, Literal) and self._batched.get(v, False) for v in operands]

    def _group(self, group: list[JaxprEqn], equations: list[JaxprEqn]) -> "_Group":
        """Join equations; those results that are read elsewhere are those of the group."""
        inside = {id(equation) for equation in group}
        made = {variable: None for equation in group for variable in equation.outvars}
        read = {variable: None for equation in group for variable in _variables(equation.invars)}
        elsewhere = set(_variables(self._outputs))
        for equation in equations:
            if id(equation) not in inside:
                elsewhere |= set(_variables(equation.invars))
        operands = [variable for variable in read if variable not in made]
        results = [variable for variable in made if variable in elsewhere]
        return _Group(group, operands, results, self._flags(operands))

    def __call__(self, function: Callable[[Any], PyTree], scenes: PyTree) -> PyTree:
        """Return the results for scenes stacked along the first axis of every leaf."""
        alike = jax.tree.leaves(eqx.filter(function, _is_array))
        leaves = [Value(np.asarray(leaf), True) for leaf in jax.tree.leaves(scenes)]
        count = len(leaves[0].array)
        operands = [*(Value(leaf, False) for leaf in alike), *leaves]
        values = {variable: Value(array, False) for variable, array in self._constants.items()}
        values |= zip(self._operands, operands, strict=True)

        def read(operand: Any) -> Value:
            literal = isinstance(operand, Literal)
            return Value(operand.val, False) if literal else values[operand]

        for step in self._steps:
            results = step.run([read(operand) for operand in step.operands], count)
            values |= zip(step.results, results, strict=True)
        outputs = [read(output).stacked(count) for output in self._outputs]
        return jax.tree.unflatten(self._results, outputs)


def _is_array(leaf: Any) -> bool:
    return isinstance(leaf, jax.Array | np.ndarray)


# Key -> program, or why there is none; the newest last.
_PROGRAMS: dict[Any, Program | Unsupported] = {}
_MOST_PROGRAMS = 64
# A function that is traced may itself run a batch.
_LOCK = threading.RLock()


def program(function: Callable[[Any], PyTree], scenes: PyTree, target: Target) -> Program:
    """Return the program of a function for stacked scenes, or that of an earlier, similar call.

    Its integrations are those that `record` puts into the trace. Raises `Unsupported` for what
    lanes cannot do.
    """
    scene = jax.tree.map(lambda leaf: np.asarray(leaf)[0], scenes)
    numbers, rest = eqx.partition(function, _is_array)
    fixed, tree = jax.tree.flatten(rest)
    shapes = [(leaf.shape, leaf.dtype) for leaf in jax.tree.leaves((numbers, scene))]
    key = (target, *fixed, tree, jax.tree.structure((numbers, scene)), *shapes)
    with _LOCK:
        if key not in _PROGRAMS:
            try:
                _PROGRAMS[key] = Program(function, scene, target)
            except Unsupported as error:
                _PROGRAMS[key] = error
            if len(_PROGRAMS) > _MOST_PROGRAMS:
                del _PROGRAMS[next(iter(_PROGRAMS))]
        found = _PROGRAMS[key]
    if isinstance(found, Unsupported):
        raise found
    return found


class _Integration:
    """Integrations of all designs, by lanes."""

    def __init__(self, equation: JaxprEqn, target: Target) -> None:
        self.operands, self.results = equation.invars, equation.outvars
        self._what: Recorded = equation.params["what"]
        self._target = target

    def run(self, operands: list[Value], count: int) -> list[Value]:
        """Return summaries, codes, times and steps."""
        what = self._what
        times = np.asarray(operands[0].array, float)
        schedule = np.arange(count) if operands[0].batched else np.zeros(count, int)
        times = times if operands[0].batched else times[None]
        columns = [_doubles(value.stacked(count)) for value in operands[1:]]
        states = 2 + what.equations.states
        numbers, starts = _table(columns[states:], count), _table(columns[2:states], count)
        tolerances = _table(columns[:2], count)
        # As diffrax: within 100 units in the last place of the end is at the end.
        floors = times[..., -1] - 100 * np.spacing(times[..., -1])
        shapes = [shape.shape[1:] for shape in what.shapes[:-3]]
        designs = Designs(starts, numbers, tolerances, times.ravel(), floors, schedule)
        kernels = what.kernels(self._target.shape)
        found = run(kernels, what.control, designs, shapes, self._target)
        return [Value(array, True) for array in found]


def _doubles(array: np.ndarray) -> np.ndarray:
    """Return numbers as they stand in the memory of lanes: whole ones by their bits."""
    if np.issubdtype(array.dtype, np.integer):
        return array.astype(np.int64).view(np.float64)
    return np.asarray(array, float)


def _table(columns: Sequence[np.ndarray], count: int) -> np.ndarray:
    return np.stack(columns, 1) if columns else np.zeros((count, 0))


class _Group:
    """Equations that JAX computes for all designs in one call, tile after tile.

    It does so on the processor, where lanes' arrays are, also if it sees a GPU: there a batch of
    65 536 designs would make 32 000 transfers.
    """

    def __init__(
        self,
        equations: list[JaxprEqn],
        operands: list[Var],
        results: list[Var],
        batched: list[bool],
    ) -> None:
        self.operands, self.results = operands, results
        self._batched = any(batched)
        names = tuple("" for _ in operands), tuple("" for _ in results)
        about = DebugInfo("jit", "between integrations", *names)
        jaxpr = Jaxpr([], operands, results, equations, debug_info=about)
        function = jaxpr_as_fun(ClosedJaxpr(jaxpr, []))
        axes = tuple(0 if flag else None for flag in batched)
        tile = jax.vmap(function, axes)

        def tiles(count: Any, alike: dict[int, Any], stacked: dict[int, Any]) -> Any:
            def one(part: dict[int, Any]) -> Any:
                both = alike | part
                return tile(*(both[i] for i in range(len(both))))

            def advance(i: Any, found: Any) -> Any:
                result = one(jax.tree.map(lambda array: array[i], stacked))
                return jax.tree.map(lambda all_, of_one: all_.at[i].set(of_one), found, result)

            like = jax.eval_shape(jax.vmap(one), stacked)
            found = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), like)
            # Their number is not known before: only the room for them is compiled.
            return jax.lax.fori_loop(0, count, advance, found)

        together = tiles if self._batched else function
        self._function = jax.jit(together, compiler_options=IN_A_HURRY)

    def run(self, operands: list[Value], count: int) -> list[Value]:
        """Return one value for each result."""
        arrays = [np.asarray(value.array) for value in operands]
        if not self._batched:
            return [Value(array, False) for array in self._computed(*arrays)]
        tiles = -(-count // TILE)
        alike = {i: arrays[i] for i, value in enumerate(operands) if not value.batched}
        stacked = {i: _tiled(arrays[i]) for i, value in enumerate(operands) if value.batched}
        columns = self._computed(tiles, alike, stacked)
        return [Value(c.reshape(-1, *c.shape[2:])[:count], True) for c in columns]

    def _computed(self, *operands: Any) -> list[np.ndarray]:
        """Call the function on the processor: of operands in NumPy JAX takes its default device."""
        with jax.default_device(processor()):
            return [np.asarray(array) for array in self._function(*operands)]


def _tiled(array: np.ndarray) -> np.ndarray:
    """Return the designs' numbers in tiles, the last one filled up with the last design.

    There is room for more, so that one program serves batches of any size up to the next room.
    """
    count, room = len(array), next(room for room in ROOMS if len(array) <= room * TILE)
    if count < room * TILE:
        filled = np.zeros((room * TILE, *array.shape[1:]), array.dtype)
        filled[:count] = array
        filled[count : -(-count // TILE) * TILE] = array[-1]
        array = filled
    return array.reshape(room, TILE, *array.shape[1:])


def _variables(operands: Sequence[Any]) -> list[Var]:
    return [operand for operand in operands if not isinstance(operand, Literal)]
