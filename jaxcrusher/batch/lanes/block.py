"""A trace cut at its integrations: what stands between them JAX computes for all designs.

Loops that integrate again and again, such as a section's over turns, are run here.
"""

from collections.abc import Sequence
from typing import Any

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

from jaxcrusher.batch.lanes.engine import Device
from jaxcrusher.batch.lanes.inlined import inlined
from jaxcrusher.batch.lanes.integration import Integration, Value, stacked
from jaxcrusher.batch.lanes.known import Unsupported
from jaxcrusher.batch.lanes.recorded import integrates, integration_p
from jaxcrusher.batch.lanes.tableau import IN_A_HURRY

# Designs that JAX computes side by side: always as many, so that one program, with one rounding, is
# compiled for batches of any size.
TILE = 64


class Block:
    """A jaxpr cut at its integrations, for a device; `batched` says it of each operand."""

    def __init__(self, jaxpr: ClosedJaxpr, batched: Sequence[bool], device: Device) -> None:
        self._device = device
        self._constants: dict[Var, Any] = {}
        self._operands = [Var(variable.aval) for variable in jaxpr.jaxpr.invars]
        equations, self._outputs = inlined(jaxpr, self._operands, self._constants, integrates)
        self._batched = dict(zip(self._operands, batched, strict=True))
        alike, pieces = [], [[]]
        for equation in equations:
            differs = any(self._differs(operand) for operand in equation.invars)
            flags: Sequence[bool] = [differs] * len(equation.outvars)
            if integrates(equation):
                piece = self._special(equation)
                flags = piece.batched
                pieces += [piece, []]
            else:
                (pieces[-1] if differs else alike).append(equation)
            self._batched |= zip(equation.outvars, flags, strict=True)
        self._steps = [
            piece if isinstance(piece, Integration | _Loop) else self._group(piece, equations)
            for piece in (alike, *pieces)
            if piece != []
        ]

    def _differs(self, operand: Any) -> bool:
        return not isinstance(operand, Literal) and self._batched.get(operand, False)

    def _special(self, equation: JaxprEqn) -> "Integration | _Loop":
        flags = [self._differs(operand) for operand in equation.invars]
        kind = Integration if equation.primitive is integration_p else _Loop
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
        self._block = Block(params["jaxpr"], flags, device)
        self.batched = [True] * len(self.results)

    def run(self, operands: list[Value], count: int) -> list[Value]:
        """What is carried, and what each turn of the loop gives, stacked."""
        first = self._constants + self._carried
        constants, sliced = operands[: self._constants], operands[first:]
        carried = [Value(stacked(v, count), True) for v in operands[self._constants : first]]
        given: list = [None] * len(self._order)
        for i in self._order:
            now = [Value(v.array[:, i] if v.batched else v.array[i], v.batched) for v in sliced]
            found = self._block.run([*constants, *carried, *now], count)
            found = [Value(stacked(value, count), True) for value in found]
            carried, given[i] = found[: self._carried], found[self._carried :]
        columns = [np.stack([v.array for v in column], 1) for column in zip(*given, strict=True)]
        return [*carried, *(Value(column, True) for column in columns)]


def _variables(operands: Sequence[Any]) -> list[Var]:
    return [operand for operand in operands if not isinstance(operand, Literal)]
