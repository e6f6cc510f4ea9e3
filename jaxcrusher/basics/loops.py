"""Loops over instants and over designs: in turn on a processor, side by side on a GPU.

It also holds the function that integrates in place of diffrax during a trace.
"""

from collections.abc import Callable
from typing import Any

import jax
from jax.custom_batching import sequential_vmap
from jax.extend.core import Primitive
from jaxtyping import PyTree

from jaxcrusher.basics.devices import computes_on


def one_by_one(function: Callable, instants: PyTree, args: PyTree) -> PyTree:
    """Return `function(*instant, args)` at each of n instants, the leading axis of their arrays.

    On a CPU XLA makes one kernel of the loop, but fifty of derivatives side by side, which took 13
    times as long. On a GPU a loop that writes an array row by row took 5 times as long as all else.
    In reverse mode an instant is computed again, and only its slow operations are stored.
    """
    again = jax.checkpoint(
        lambda instant: function(*instant, args), prevent_cse=False, policy=_is_slow
    )
    return jax.vmap(again)(instants) if on_a_gpu() else jax.lax.map(again, instants)


def _is_slow(primitive: Primitive, *_, **__) -> bool:
    """Whether its result is sooner kept than found again; slopes of a sum take a fifth less."""
    return primitive.name in ("sin", "cos", "pow")


def design_by_design(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return `function`, which under `jax.vmap` computes one design after the other on a CPU.

    A batch costs its slowest design there at each step. A GPU has room for all of them.
    """

    def chosen(*operands: Any) -> Any:
        return function(*operands) if on_a_gpu() else sequential_vmap(function)(*operands)

    return chosen


def on_a_gpu() -> bool:
    """Tell whether JAX computes on a GPU or TPU."""
    return computes_on() != "cpu"


# None, or a function of args, times, the state at the start, problem and method. JAX compares
# programs by it too, and forgets all of them when it is made: so before the first is traced.
integrator = jax.make_user_context(None)
