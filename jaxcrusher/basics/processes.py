"""Processes made by fork from one in which JAX had computed: in them JAX waits for ever.

The child has the parent's memory, but none of the threads by which XLA computes.
"""

import os

from jaxcrusher.basics.loop_kernels import jax_has_started

_started = False
_stuck = False


def watch_forks() -> None:
    """Have each later fork tell the child whether JAX had computed."""
    if hasattr(os, "register_at_fork"):  # Windows has no fork
        os.register_at_fork(before=_look, after_in_child=_keep)


def _look() -> None:
    global _started
    _started = jax_has_started()


def _keep() -> None:
    global _stuck
    _stuck = _stuck or _started


def jax_is_stuck() -> bool:
    """Tell whether JAX would wait for ever in this process."""
    return _stuck
