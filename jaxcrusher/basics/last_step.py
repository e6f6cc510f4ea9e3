"""Two things that diffrax does while it is traced, done otherwise.

It counts a hundred floats back from the end of an integration, to tell that a step ends close
enough to be the last, one after the other and in some 2000 operations: a quarter of what XLA
compiled of a motion. Here the hundredth is found at once; results keep their bits.

Its check that times increase asks each function that is being called for its local variables. Up to
Python 3.12 each then keeps a copy of them, and those of JAX hold tracers that JAX has let go, which
`jax.checking_leaks` takes for leaks. Here the copies are emptied.
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
    """While diffrax is traced: the float before the float before a time is found from the time.

    No tracer is kept by what is done to that end, nor by diffrax's checks.
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
    """The float so many before a time, which zero does not lie between.

    Floats are ordered as their bits are, negative ones backwards.
    """
    bits = lax.bitcast_convert_type(time, jnp.dtype(f"int{8 * time.dtype.itemsize}"))
    return lax.bitcast_convert_type(bits - count * jnp.sign(bits), time.dtype)
