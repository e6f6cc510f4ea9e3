"""Equinox modules that print their contents, and values for writing equations."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree
from typing_extensions import override

from jaxcrusher.basics.checks import concrete


class Printed(eqx.Module):
    """An Equinox module that prints its numbers, with ten digits, and the shapes of its arrays."""

    @override
    def __repr__(self) -> str:
        """Return it as Equinox does, which prints the type of each number."""
        return eqx.tree_pformat(jax.tree.map(_shown, self, is_leaf=_prints_itself))


def _prints_itself(part: Any) -> bool:
    return isinstance(part, eqx.Module) and hasattr(type(part), "__pdoc__")


def _shown(leaf: Any) -> Any:
    """Return a known number as one of Python's, and all else as it is."""
    known = concrete(leaf)
    if known is None or known.ndim > 0:
        return leaf
    number = known.item()
    return float(f"{number:.10g}") if isinstance(number, float) else number


def words(kind: Any, item: PyTree) -> str:
    """Say in one line what an entry of an enumeration means (concrete values only)."""
    # Equinox reads the codes of JAX's arrays only, not of NumPy's.
    return " ".join(str(kind[jax.tree.map(jnp.asarray, item)]).split())


class Record(Printed):
    """A value of several parts, such as a vector or a joint, whose methods are Python's own.

    Equinox makes a PyTree of each method that is looked up, with all data of its object, so that
    the method may be passed to JAX. Methods of a vector are never passed, and to trace the
    equations of motion took twice as long with these PyTrees.
    """

    __getattribute__ = object.__getattribute__
