"""How diffrax tells that a step ends close enough to the end to be the last.

It counts a hundred floats back from the end, one after the other, in some 2000 operations: a
quarter of what XLA compiled of a motion. Here the hundredth is found at once; results keep their
bits.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import equinox.internal as eqxi
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array

_one_at_a_time = threading.RLock()


@contextmanager
def floats_counted_at_once() -> Iterator[None]:
    """While diffrax is traced: the float before the float before a time is found from the time."""
    with _one_at_a_time:
        usual = getattr(eqxi, "prevbefore", None)
        if usual is None:
            # A diffrax that does not count like this has nothing to be spared.
            yield
            return
        eqxi.prevbefore = _counting(usual)
        try:
            yield
        finally:
            eqxi.prevbefore = usual


def _counting(usual: Callable[[Array], Array]) -> Callable[[Array], Array]:
    counted: dict[int, tuple[Array, Array, int]] = {}  # id -> itself, of what, how many before it

    def before(time: Array) -> Array:
        _, start, count = counted.get(id(time), (time, time, 0))
        found = earlier(start, count + 1) if count else usual(time)
        counted[id(found)] = found, start, count + 1
        return found

    return before


def earlier(time: Array, count: int) -> Array:
    """The float so many before a time, which zero does not lie between.

    Floats are ordered as their bits are, negative ones backwards.
    """
    bits = lax.bitcast_convert_type(time, jnp.dtype(f"int{8 * time.dtype.itemsize}"))
    return lax.bitcast_convert_type(bits - count * jnp.sign(bits), time.dtype)
