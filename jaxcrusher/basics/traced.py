"""Functions of a user as keys of compiled programs: by what they compute, not by their names.

A function may read a global that changes, and JAX keeps the program of a function for good. Each
call of the package therefore traces such a function anew, in some milliseconds; the program that
was compiled for an equal trace serves it.
"""

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any
from weakref import WeakKeyDictionary, WeakValueDictionary

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, Literal, Var
from jaxtyping import Array, PyTree


class _Program:
    """Stands for one content of a trace; compared by identity, which is fast."""


@dataclass(frozen=True)
class _Itself:
    """A value that equals nothing else, for what cannot be compared."""

    value: Any = field(compare=False)
    identity: int


@dataclass(frozen=True)
class _Rest:
    """A function without its numbers, equal to another one of the same trace."""

    function: Callable[..., Any] = field(compare=False)
    program: _Program


class Traced(eqx.Module):
    """A function that equals another one, for JAX's caches, if both had the same trace."""

    numbers: tuple[Array | np.ndarray, ...]
    rest: _Rest = eqx.field(static=True)

    def __call__(self, *operands: PyTree) -> PyTree:
        """The function's result."""
        return self.rest.function(self.numbers, *operands)


def traced(function: Callable[..., PyTree], *operands: PyTree) -> Traced:
    """Trace `function` now, for arrays (or `jax.ShapeDtypeStruct`s) like `operands`.

    The result computes the same. Arrays in a function that is a PyTree, such as `equinox.Partial`,
    remain numbers of the program; all other values that the function reads are compared.
    """
    arrays, others = eqx.partition(function, eqx.is_array)
    numbers, tree = jax.tree.flatten(arrays)

    def apply(numbers: tuple, *operands: PyTree) -> PyTree:
        return eqx.combine(jax.tree.unflatten(tree, numbers), others)(*operands)

    jaxpr, shapes, fixed = eqx.filter_make_jaxpr(apply)(tuple(numbers), *operands)
    leaves, structure = jax.tree.flatten(fixed)
    content = (jax.tree.structure(shapes), structure, *map(_content, (jaxpr, *leaves)))
    return Traced(tuple(numbers), _Rest(apply, _interned(content)))


_PROGRAMS: WeakValueDictionary[Hashable, _Program] = WeakValueDictionary()
# A jaxpr never changes, and calls that JAX traced before are the same objects in a later trace.
_KNOWN: WeakKeyDictionary[Jaxpr, _Program] = WeakKeyDictionary()


def _interned(content: Hashable) -> _Program:
    return _PROGRAMS.setdefault(content, _Program())


def _content(value: Any) -> Hashable:
    """Return what two values share if a program of one serves the other."""
    # Since JAX 0.12 both are one class, and `jaxpr` is the value itself.
    if isinstance(value, ClosedJaxpr):
        return ClosedJaxpr, _known(value.jaxpr), *map(_content, value.consts)
    if isinstance(value, Jaxpr):
        return _known(value)
    if isinstance(value, tuple | list):
        return type(value), *map(_content, value)
    if isinstance(value, dict):
        return dict, *((key, _content(one)) for key, one in value.items())
    if isinstance(value, bool | int | float | complex):
        # 1 equals True and 1.0, and 0.0 equals -0.0; a program tells them apart.
        return type(value), repr(value)
    if isinstance(value, np.ndarray | np.generic | jax.Array):
        if not jnp.issubdtype(value.dtype, jax.dtypes.extended):
            array = np.asarray(value)
            return array.shape, array.dtype.str, array.tobytes()
    try:
        hash(value)
    except TypeError:
        return _Itself(value, id(value))
    return value  # pyright: ignore


def _known(jaxpr: Jaxpr) -> _Program:
    """Return what jaxprs of the same equations share, whatever the values of their constants."""
    if jaxpr not in _KNOWN:
        _KNOWN[jaxpr] = _interned(_equations(jaxpr))
    return _KNOWN[jaxpr]


def _equations(jaxpr: Jaxpr) -> Hashable:
    """The equations of a jaxpr, with numbers for the names of its variables."""
    places: dict[Var, int] = {}

    def named(variables: list[Var]) -> tuple[Hashable, ...]:
        places.update((one, len(places) + i) for i, one in enumerate(variables))
        return tuple(one.aval for one in variables)

    def read(operand: Var | Literal) -> Hashable:
        if isinstance(operand, Literal):
            return operand.aval, _content(operand.val)
        return places[operand]

    found: list[Hashable] = [named(jaxpr.constvars), named(jaxpr.invars)]
    for one in jaxpr.eqns:
        operands, how = tuple(map(read, one.invars)), _content(one.params)
        found.append((one.primitive, operands, how, named(one.outvars)))
    return (*found, tuple(map(read, jaxpr.outvars)))
