"""Replacements of two operations of diffrax, while it is traced.

To tell that a step is the last, diffrax counts a hundred floats back from the end, one after the
other. These 2000 operations were a quarter of what XLA compiled for a motion. Here the hundredth
float is found at once; results keep their bits.

Diffrax's check that times increase reads the local variables of each function that is being called.
Up to Python 3.12 each frame then keeps a copy of them. The copies in frames of JAX hold tracers
that JAX has released, which `jax.checking_leaks` takes for leaks. Here the copies are emptied.
"""

import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from weakref import ref

import equinox.internal as eqxi
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array

_one_at_a_time = threading.RLock()


@contextmanager
def floats_counted_at_once() -> Iterator[None]:
    """Let diffrax, while it is traced, find any earlier float directly from a time.

    Neither this replacement nor diffrax's checks keep a tracer.
    """
    made = {"prevbefore": _counting, "error_if": _forgetting}
    with _one_at_a_time:
        # A diffrax that does not count or check like this has nothing to be spared.
        usual = {name: getattr(eqxi, name) for name in made if hasattr(eqxi, name)}
        for name, function in usual.items():
            setattr(eqxi, name, made[name](function))
        try:
            yield
        finally:
            for name, function in usual.items():
                setattr(eqxi, name, function)


def _counting(usual: Callable[[Array], Array]) -> Callable[[Array], Array]:
    # The float that was found last, of what it was counted, and how many before that it is.
    found: Callable[[], Array | None] = lambda: None  # noqa: E731
    start, count = found, 0

    def before(time: Array) -> Array:
        nonlocal found, start, count
        known = start() if found() is time else None
        if known is None:
            result, start, count = usual(time), ref(time), 1
        else:
            result, count = earlier(known, count + 1), count + 1
        found = ref(result)
        return result

    return before


def _forgetting(usual: Callable[..., Any]) -> Callable[..., Any]:
    def checked(*operands: Any, **settings: Any) -> Any:
        result = usual(*operands, **settings)
        for frame, _ in traceback.walk_stack(None):
            if frame.f_globals.get("__name__", "").startswith("jax."):
                frame.f_locals.clear()
        return result

    return usual if sys.version_info >= (3, 13) else checked


def earlier(time: Array, count: int) -> Array:
    """Return the float that lies `count` floats before a time, without zero between them.

    Floats are ordered as their bits are, negative ones backwards.
    """
    bits = lax.bitcast_convert_type(time, jnp.dtype(f"int{8 * time.dtype.itemsize}"))
    return lax.bitcast_convert_type(bits - count * jnp.sign(bits), time.dtype)
