"""The devices that computations run on: the processor's, unless the user names others.

One orbit takes 2.5 times as long on an H100 as on a core beside it, and four times as long to
compile, so `jaxcrusher.set_up` prefers the processor. Batches of integrations find their GPU by
CuPy, without JAX. Nothing here imports either of them before it has to.
"""

import importlib.util
from typing import Any


def setting(name: str) -> Any:
    """Return a setting of JAX; its type checker's view of them is not complete."""
    import jax

    return getattr(jax.config, name)


def prefer_processor() -> None:
    """Let JAX compute on the processor, unless the user named a device. Starts no backend.

    The user names one by `JAX_PLATFORMS`, `JAX_PLATFORM_NAME` or `JAX_DEFAULT_DEVICE` in the
    environment, or by the setting of JAX of the same name. A later `jax.default_device` wins too.
    """
    import jax

    if not device_is_named():
        jax.config.update("jax_default_device", "cpu")


def device_is_named() -> bool:
    """Tell whether a device or a platform was chosen already."""
    import jax

    older = jax.config.read("jax_platform_name")
    return bool(setting("jax_default_device") or setting("jax_platforms") or older)


def devices() -> list[Any]:
    """Return all devices of the platform that computations run on. Starts JAX's backends."""
    import jax

    chosen = setting("jax_default_device")
    if chosen is None:
        return jax.devices()
    return jax.devices(chosen) if isinstance(chosen, str) else chosen.client.devices()


def computes_on() -> str:
    """Return the name of the platform that computations run on, such as "cpu" or "gpu"."""
    return devices()[0].platform


def processor() -> Any:
    """Return JAX's first device on the processor; None where `JAX_PLATFORMS` leaves it none."""
    import jax

    try:
        return jax.local_devices(backend="cpu")[0]
    except RuntimeError:
        return None


def finds_card() -> bool:
    """Tell whether CuPy is installed and finds a GPU of NVIDIA's.

    An empty `CUDA_VISIBLE_DEVICES` hides all GPUs.
    """
    if importlib.util.find_spec("cupy") is None:
        return False
    try:
        from cupy.cuda import runtime  # pyright: ignore[reportMissingImports]
    except ImportError:  # made for another CUDA
        return False
    try:
        return runtime.getDeviceCount() > 0
    except runtime.CUDARuntimeError:  # no card, or no driver
        return False
