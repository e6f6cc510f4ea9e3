"""What JAX computes between integrations, compiled in a hurry and kept on disk."""

import pickle
from collections.abc import Callable, Sequence
from importlib.metadata import version
from typing import Any

import jax
from jax.experimental.serialize_executable import deserialize_and_load, serialize

from jaxcrusher.batch.lanes.module import cache_folder, digest, processor, write

# For XLA: there is little to compute.
IN_A_HURRY: dict[str, Any] = {"xla_backend_optimization_level": 0}


def compiled(function: Callable, operands: Sequence[Any]) -> Callable[..., Any]:
    """The function for operands of these shapes, compiled unless an earlier process did.

    A folder that cannot be written costs the time to compile, and is no error.
    """
    # Operands that are not used are kept: the text names all that it is to be called with.
    jitted = jax.jit(function, compiler_options=IN_A_HURRY, keep_unused=True)
    lowered = jitted.lower(*operands)
    devices = str(jax.devices())
    key = digest(lowered.as_text(), devices, version("jaxlib"), version("jax"), *processor())
    file = cache_folder() / f"{key}.xla"
    try:
        return deserialize_and_load(
            *pickle.loads(file.read_bytes()), execution_devices=jax.devices()[:1]
        )
    except OSError:
        found = lowered.compile()
    try:
        write(file, pickle.dumps(serialize(found)))
    except OSError:
        pass
    return found
