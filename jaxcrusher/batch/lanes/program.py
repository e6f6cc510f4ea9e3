"""A function of one design, run for many: lanes do its integrations, JAX the rest.

The function is traced once, each integration a single equation of the trace. What stands between
them JAX computes for all designs side by side. Loops that integrate again and again, such as a
section's over turns, are run here.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np
from jax.extend.core import (
    ClosedJaxpr,
    DebugInfo,
    Jaxpr,
    JaxprEqn,
    Literal,
    Var,
    jaxpr_as_fun,
)
from jaxtyping import PyTree

from jaxcrusher.batch.lanes.emit import Unsupported
from jaxcrusher.batch.lanes.engine import Device, run
from jaxcrusher.batch.lanes.layout import Designs
from jaxcrusher.batch.lanes.recorded import Recorded, integration_p, record
from jaxcrusher.batch.lanes.tableau import IN_A_HURRY
from jaxcrusher.motion.integrate import integrator

# Primitives that call a jaxpr, and where it stands.
_CALLS = {
    "jit": "jaxpr",
    "pjit": "jaxpr",
    "closed_call": "call_jaxpr",
    "custom_jvp_call": "call_jaxpr",
}


class Value(NamedTuple):
    """An array; if `batched`, its first axis is that of the designs."""

    array: Any
    batched: bool


# Exponents that are products and roots.
PLAIN = (1.0, 1.5, 2.0)


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
        if not any(_integrates(equation) for equation in jaxpr.jaxpr.eqns):
            raise NoIntegration
        self._results = jax.tree.structure(shapes)
        self._block = _Block(jaxpr, _batched(numbers, False) + _batched(scene, True), device)

    def __call__(self, function: Callable[[Any], PyTree], scenes: PyTree) -> PyTree:
        """The results for scenes stacked along the first axis of every leaf, stacked alike."""
        alike = jax.tree.leaves(eqx.filter(function, _is_array))
        leaves = [Value(np.asarray(leaf), True) for leaf in jax.tree.leaves(scenes)]
        count = len(leaves[0].array)
        operands = [*(Value(leaf, False) for leaf in alike), *leaves]
        results = [_stacked(value, count) for value in self._block.run(operands, count)]
        return jax.tree.unflatten(self._results, results)


def _is_array(leaf: Any) -> bool:
    return isinstance(leaf, jax.Array | np.ndarray)


def _batched(tree: PyTree, batched: bool) -> list[bool]:
    return [batched] * len(jax.tree.leaves(tree))


# Key -> program, or why there is none; the newest last.
_PROGRAMS: dict[Any, Program | Unsupported] = {}
_MOST_PROGRAMS = 64


def program(function: Callable[[Any], PyTree], scenes: PyTree, device: Device) -> Program:
    """The program of a function for stacked scenes, from an earlier call if there was one like it.

    Raises `Unsupported` for what lanes cannot do.
    """
    scene = jax.tree.map(lambda leaf: np.asarray(leaf)[0], scenes)
    numbers, rest = eqx.partition(function, _is_array)
    fixed, tree = jax.tree.flatten(rest)
    shapes = [(leaf.shape, leaf.dtype) for leaf in jax.tree.leaves((numbers, scene))]
    key = (device, *fixed, tree, jax.tree.structure((numbers, scene)), *shapes)
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


class _Block:
    """A jaxpr cut at its integrations, for a device; `batched` says it of each operand."""

    def __init__(self, jaxpr: ClosedJaxpr, batched: Sequence[bool], device: Device) -> None:
        self._device = device
        self._constants: dict[Var, Any] = {}
        self._operands = [Var(variable.aval) for variable in jaxpr.jaxpr.invars]
        equations, self._outputs = _inlined(jaxpr, self._operands, self._constants)
        self._batched = dict(zip(self._operands, batched, strict=True))
        alike, pieces = [], [[]]
        for equation in equations:
            differs = any(self._differs(operand) for operand in equation.invars)
            flags: Sequence[bool] = [differs] * len(equation.outvars)
            if _integrates(equation):
                piece = self._special(equation)
                flags = piece.batched
                pieces += [piece, []]
            else:
                (pieces[-1] if differs else alike).append(equation)
            self._batched |= zip(equation.outvars, flags, strict=True)
        self._steps = [
            piece if isinstance(piece, _Integration | _Loop) else self._group(piece, equations)
            for piece in (alike, *pieces)
            if piece != []
        ]

    def _differs(self, operand: Any) -> bool:
        return not isinstance(operand, Literal) and self._batched.get(operand, False)

    def _special(self, equation: JaxprEqn) -> "_Integration | _Loop":
        flags = [self._differs(operand) for operand in equation.invars]
        kind = _Integration if equation.primitive is integration_p else _Loop
        return kind(equation, flags, self._device)

    def _group(self, group: list[JaxprEqn], equations: list[JaxprEqn]) -> "_Group":
        """What of a group of equations is read elsewhere is its result."""
        inside = {id(equation) for equation in group}
        made = {variable: None for equation in group for variable in equation.outvars}
        read = {variable: None for equation in group for variable in _variables(equation.invars)}
        elsewhere = set(_variables(self._outputs))
        for equation in equations:
            if id(equation) not in inside:
                elsewhere |= set(_variables(equation.invars))
        operands = [variable for variable in read if variable not in made]
        results = [variable for variable in made if variable in elsewhere]
        return _Group(group, operands, results, [self._differs(v) for v in operands])

    def run(self, operands: Sequence[Value], count: int) -> list[Value]:
        """The results for `count` designs."""
        values = {variable: Value(array, False) for variable, array in self._constants.items()}
        values |= zip(self._operands, operands, strict=True)

        def read(operand: Any) -> Value:
            literal = isinstance(operand, Literal)
            return Value(operand.val, False) if literal else values[operand]

        for step in self._steps:
            results = step.run([read(operand) for operand in step.operands], count)
            values |= zip(step.results, results, strict=True)
        return [read(output) for output in self._outputs]


# Designs that JAX computes side by side: always as many, so that one program, with one rounding, is
# compiled for batches of any size.
TILE = 64


class _Group:
    """Equations that JAX computes for all designs, a tile after the other."""

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
        together = jax.vmap(function, axes) if self._batched else function
        self._function = jax.jit(together, compiler_options=IN_A_HURRY)

    def run(self, operands: list[Value], count: int) -> list[Value]:
        """One value for each result."""
        if not self._batched:
            return [Value(array, False) for array in self._function(*(v.array for v in operands))]
        tiles = []
        for first in range(0, count, TILE):
            # The last one is filled up with its last design.
            rows = np.minimum(np.arange(first, first + TILE), count - 1)
            part = (np.asarray(v.array)[rows] if v.batched else v.array for v in operands)
            tiles.append(map(np.asarray, self._function(*part)))
        columns = (np.concatenate(parts)[:count] for parts in zip(*tiles, strict=True))
        return [Value(column, True) for column in columns]


class _Integration:
    """Integrations of all designs, by lanes."""

    def __init__(self, equation: JaxprEqn, batched: list[bool], device: Device) -> None:
        self._device = device
        self.operands, self.results = equation.invars, equation.outvars
        self.batched = [True] * len(self.results)
        self._what: Recorded = equation.params["what"]
        # Raises `Unsupported` for what cannot be written out.
        self._exponents = self._what.exponents

    def run(self, operands: list[Value], count: int) -> list[Value]:
        """Summaries, codes, times and steps."""
        times = np.asarray(operands[0].array, float)
        schedule = np.arange(count) if operands[0].batched else np.zeros(count, int)
        times = times if operands[0].batched else times[None]
        columns = [np.asarray(_stacked(value, count), float) for value in operands[1:]]
        states = 2 + self._what.equations.states
        numbers, starts = _table(columns[states:], count), _table(columns[2:states], count)
        tolerances = _table(columns[:2], count)
        # As diffrax: within 100 units in the last place of the end is at the end.
        floors = times[..., -1] - 100 * np.spacing(times[..., -1])
        found: list[np.ndarray] = []
        for known, rows in self._kinds(numbers):
            of_each = starts[rows], numbers[rows], tolerances[rows]
            designs = Designs(*of_each, times.ravel(), floors, schedule[rows])
            what, device = self._what, self._device
            shapes = [shape.shape[1:] for shape in what.shapes[:-3]]
            kernels = what.kernels(known, device.shape)
            summaries, ends = run(kernels, what.control, designs, shapes, device)
            parts = [*summaries, *ends]
            if not found:
                found = [np.empty((count, *part.shape[1:]), part.dtype) for part in parts]
            for whole, part in zip(found, parts, strict=True):
                whole[rows] = part
        return [Value(array, True) for array in found]

    def _kinds(self, numbers: np.ndarray) -> Iterator[tuple[dict[int, float], np.ndarray]]:
        """Designs with the same exponents, as far as these are written into the source.

        By its own numbers only, so that what a design comes to does not depend on the others.
        """
        exponents = numbers[:, self._exponents]
        plain = np.where(np.isin(exponents, PLAIN), exponents, np.nan)
        kinds = [tuple(row) for row in plain.astype(str)]
        for kind in dict.fromkeys(kinds):
            rows = np.flatnonzero([other == kind for other in kinds])
            pairs = zip(self._exponents, map(float, kind), strict=True)
            yield {i: value for i, value in pairs if value in PLAIN}, rows


class _Loop:
    """A `lax.scan` over integrations."""

    def __init__(self, equation: JaxprEqn, batched: list[bool], device: Device) -> None:
        params = equation.params
        if equation.primitive.name != "scan":
            raise Unsupported(f"an integration inside `{equation.primitive.name}`")
        self.operands, self.results = equation.invars, equation.outvars
        self._constants, self._carried = params["num_consts"], params["num_carry"]
        self._order = range(params["length"])
        if params["reverse"]:
            self._order = self._order[::-1]
        first = self._constants + self._carried
        flags = [*batched[: self._constants], *[True] * self._carried, *batched[first:]]
        self._block = _Block(params["jaxpr"], flags, device)
        self.batched = [True] * len(self.results)

    def run(self, operands: list[Value], count: int) -> list[Value]:
        """What is carried, and what each turn of the loop gives, stacked."""
        first = self._constants + self._carried
        constants, sliced = operands[: self._constants], operands[first:]
        carried = [Value(_stacked(v, count), True) for v in operands[self._constants : first]]
        given: list = [None] * len(self._order)
        for i in self._order:
            now = [Value(v.array[:, i] if v.batched else v.array[i], v.batched) for v in sliced]
            found = self._block.run([*constants, *carried, *now], count)
            found = [Value(_stacked(value, count), True) for value in found]
            carried, given[i] = found[: self._carried], found[self._carried :]
        columns = [np.stack([v.array for v in column], 1) for column in zip(*given, strict=True)]
        return [*carried, *(Value(column, True) for column in columns)]


def _inlined(
    jaxpr: ClosedJaxpr, operands: Sequence[Any], constants: dict[Var, Any]
) -> tuple[list[JaxprEqn], list[Any]]:
    """Its equations, calls that integrate opened, with variables of their own; its outputs."""
    names: dict[Var, Any] = dict(zip(jaxpr.jaxpr.invars, operands, strict=True))
    for variable, constant in zip(jaxpr.jaxpr.constvars, jaxpr.consts, strict=True):
        names[variable] = Var(variable.aval)
        constants[names[variable]] = constant

    def named(operands: Sequence[Any]) -> list[Any]:
        return [v if isinstance(v, Literal) else names[v] for v in operands]

    equations = []
    for equation in jaxpr.jaxpr.eqns:
        name = equation.primitive.name
        if name in _CALLS and _integrates(equation):
            inside, results = _inlined(
                equation.params[_CALLS[name]], named(equation.invars), constants
            )
            equations += inside
        else:
            results = [Var(variable.aval) for variable in equation.outvars]
            equations.append(equation.replace(invars=named(equation.invars), outvars=results))
        names |= zip(equation.outvars, results, strict=True)
    return equations, named(jaxpr.jaxpr.outvars)


def _integrates(equation: JaxprEqn) -> bool:
    """Whether an equation is an integration or has one inside."""
    if equation.primitive is integration_p:
        return True
    inside = [
        getattr(part, "jaxpr", part)
        for value in equation.params.values()
        for part in (value if isinstance(value, tuple | list) else [value])
    ]
    return any(
        _integrates(inner) for part in inside if isinstance(part, Jaxpr) for inner in part.eqns
    )


def _variables(operands: Sequence[Any]) -> list[Var]:
    return [operand for operand in operands if not isinstance(operand, Literal)]


def _stacked(value: Value, count: int) -> np.ndarray:
    """With an axis of the designs."""
    array = np.asarray(value.array)
    return array if value.batched else np.broadcast_to(array, (count, *array.shape))


def _table(columns: Sequence[np.ndarray], count: int) -> np.ndarray:
    return np.stack(columns, 1) if columns else np.zeros((count, 0))
