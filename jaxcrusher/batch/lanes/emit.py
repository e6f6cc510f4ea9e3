"""A jaxpr of scalars written out as numba source.

Every primitive is one line of a table. Numbers known beforehand are folded into the source; what
depends on a design's own numbers only is computed once a design, in front; the rest is the body of
a loop over lanes. Small arrays, such as the two components of a force, are taken apart.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, Literal

# Primitive -> the expression of its operands. A NaN of any operand is a NaN of the result.
ELEMENTWISE = {
    "abs": "abs({0})",
    "add": "{0} + {1}",
    "add_any": "{0} + {1}",
    "and": "({0} and {1})",
    "clamp": "({0} if {1} < {0} else ({2} if {1} > {2} else {1}))",
    "cos": "cosine({0})",
    "div": "{0} / {1}",
    "eq": "{0} == {1}",
    "exp": "exponential({0})",
    "ge": "{0} >= {1}",
    "gt": "{0} > {1}",
    "is_finite": "abs({0}) < inf",
    "le": "{0} <= {1}",
    "log": "logarithm({0})",
    "lt": "{0} < {1}",
    "max": "({0} if {0} > {1} or {0} != {0} else {1})",
    "min": "({0} if {0} < {1} or {0} != {0} else {1})",
    "mul": "{0} * {1}",
    "ne": "{0} != {1}",
    "neg": "-{0}",
    "not": "(not {0})",
    "or": "({0} or {1})",
    "pow": "power({0}, {1})",
    "select_n": "({2} if {0} else {1})",
    "sign": "({0} if {0} == 0.0 or {0} != {0} else (1.0 if {0} > 0.0 else -1.0))",
    "sin": "sine({0})",
    "sqrt": "sqrt({0})",
    "square": "{0} * {0}",
    "sub": "{0} - {1}",
}
_TRUTHS = {"and", "eq", "ge", "gt", "is_finite", "le", "lt", "ne", "not", "or"}
# The powers that are products and roots.
_POWERS = {
    0.5: "sqrt({0})",
    1.0: "{0}",
    1.5: "{0} * sqrt({0})",
    2.0: "{0} * {0}",
    2.5: "{0} * {0} * sqrt({0})",
}
# Primitives that move the elements of arrays about.
STRUCTURAL: dict[str, Callable[..., np.ndarray]] = {
    "broadcast_in_dim": lambda x, shape, **_: np.broadcast_to(x, shape),
    "concatenate": lambda *parts, dimension, **_: np.concatenate(parts, dimension),
    "copy": lambda x, **_: x,
    "reshape": lambda x, new_sizes, **_: x.reshape(new_sizes),
    "stack": lambda *parts, axis, **_: np.stack(parts, axis),
    "squeeze": lambda x, dimensions, **_: x.squeeze(dimensions),
}


class Unsupported(Exception):
    """What lanes cannot do and another engine can; the text names it."""


@dataclass(frozen=True)
class Atom:
    """A scalar in the source: a number, a name, or one of its truth values."""

    text: str
    of_design: bool  # does not vary along a motion
    known: bool = False  # a number
    truth: bool = False
    made_of: frozenset[str] = frozenset()  # the design's numbers, if it does not vary


def number(value: float) -> Atom:
    """A number, written so that not a bit is lost."""
    return Atom(repr(float(value)), True, known=True)


class Emitter:
    """Writes functions that share what is computed once a design."""

    def __init__(self) -> None:
        self.prepared: list[str] = []
        self.rows: dict[str, int] = {}  # of what the bodies read: name -> row
        self.exponents: set[str] = set()  # the design's numbers that powers depend on
        self._names: dict[tuple[str, bool], str] = {}  # expression, of a design -> name
        self._lines: list[str] = []

    def body(self, function: ClosedJaxpr, operands: Sequence[Atom]) -> tuple[list[str], list[str]]:
        """Lines that compute a function of scalars, and its results, arrays taken apart.

        Raises `Unsupported` for a primitive that is not in the tables.
        """
        self._lines = []
        self._names = {key: name for key, name in self._names.items() if key[1]}
        inputs = [np.array(atom, object) for atom in operands]
        results = self._walk(function.jaxpr, function.consts, inputs)
        atoms = [self._read(atom) for result in results for atom in result.ravel()]
        return self._lines, [atom.text for atom in atoms]

    def _walk(self, jaxpr: Jaxpr, consts: Sequence[Any], inputs: list) -> list[np.ndarray]:
        values = dict(zip(jaxpr.constvars, map(_numbers, consts), strict=True))
        values |= zip(jaxpr.invars, inputs, strict=True)

        def read(variable) -> np.ndarray:
            is_number = isinstance(variable, Literal)
            return _numbers(variable.val) if is_number else values[variable]

        for equation in jaxpr.eqns:
            operands = [read(variable) for variable in equation.invars]
            name, params = equation.primitive.name, equation.params
            inner = params.get("jaxpr", params.get("call_jaxpr"))
            if name in STRUCTURAL:
                results = [STRUCTURAL[name](*operands, **params)]
            elif inner is not None and name in ("jit", "pjit", "closed_call", "custom_jvp_call"):
                results = self._walk(inner.jaxpr, inner.consts, operands)
            else:
                scalars = np.broadcast(*operands)
                results = [np.empty(scalars.shape, object)]
                for i, atoms in enumerate(scalars):
                    results[0].flat[i] = self._scalar(name, params, atoms)
            values |= zip(equation.outvars, results, strict=True)
        return [read(variable) for variable in jaxpr.outvars]

    def _scalar(self, name: str, params: dict[str, Any], operands: tuple[Atom, ...]) -> Atom:
        """One primitive of scalars."""
        first, last = operands[0], operands[-1]
        if name == "convert_element_type":
            return self._line("(1.0 if {0} else 0.0)", operands) if first.truth else first
        if name == "integer_pow":
            return self._whole_power(first, params["y"])
        if name == "pow":
            self.exponents |= last.made_of
            if last.known and float(last.text) in _POWERS:
                return self._line(_POWERS[float(last.text)], operands)
        if name == "div" and last.of_design and not last.known and not first.of_design:
            return self._line("{0} * {1}", (first, self._line("1.0 / {0}", (last,))))
        if name not in ELEMENTWISE:
            raise Unsupported(f"the primitive `{name}`")
        return self._line(ELEMENTWISE[name], operands, truth=name in _TRUTHS)

    def _whole_power(self, base: Atom, exponent: int) -> Atom:
        if exponent < 0:
            return self._line("1.0 / {0}", (self._whole_power(base, -exponent),))
        if exponent < 2:
            return base if exponent else number(1.0)
        half = self._whole_power(base, exponent // 2)
        square = self._line("{0} * {0}", (half,))
        return square if exponent % 2 == 0 else self._line("{0} * {1}", (square, base))

    def _line(
        self,
        template: str,
        operands: tuple[Atom, ...],
        truth: bool = False,
        varies: bool = False,
    ) -> Atom:
        """The name of an expression; a number if it is one."""
        # Truth values stay in the body that asks for them: rows hold numbers.
        varies = varies or truth
        if all(atom.known for atom in operands) and not varies:
            with np.errstate(all="ignore"):
                values = [f"float64({atom.text})" for atom in operands]
                return number(eval(template.format(*values), _FOLDING))
        of_design = not varies and all(atom.of_design for atom in operands)
        if not of_design:
            operands = tuple(map(self._read, operands))
        text = template.format(*(atom.text for atom in operands))
        key = (text, of_design)
        if key not in self._names:
            lines = self.prepared if of_design else self._lines
            self._names[key] = f"{'p' if of_design else 'v'}{len(lines)}"
            lines.append(f"{self._names[key]} = {text}")
        made_of = frozenset().union(*(atom.made_of for atom in operands)) if of_design else None
        return Atom(self._names[key], of_design, truth=truth, made_of=made_of or frozenset())

    def _read(self, atom: Atom) -> Atom:
        """In a body, what was computed once a design is read from a row."""
        if atom.of_design and not atom.known:
            row = self.rows.setdefault(atom.text, len(self.rows))
            return self._line(f"kept[{row} * LANES + lane]", (), varies=True)
        return atom


def _numbers(value: Any) -> np.ndarray:
    """A constant array as atoms."""
    array = np.asarray(value)
    atoms = np.empty(array.shape, object)
    for i, entry in enumerate(array.flat):
        if array.dtype == bool:
            atoms.flat[i] = Atom(repr(bool(entry)), True, known=True, truth=True)
        else:
            atoms.flat[i] = number(entry)
    return atoms


_FOLDING = {
    "float64": np.float64,
    "inf": np.inf,
    "nan": np.nan,
    "cosine": np.cos,
    "exponential": np.exp,
    "logarithm": np.log,
    "power": np.power,
    "sine": np.sin,
    "sqrt": np.sqrt,
}
