"""What decides the bits of a result besides its parameters, and what computed it."""

import os
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax

# Packages whose version can change the last bit of a result.
PACKAGES = ("jaxcrusher", "jax", "jaxlib", "diffrax", "equinox")


def environment() -> dict[str, Any]:
    """Versions, backend and XLA's flags: the same ones give the same bits on one processor.

    The number of devices is left out, because no result depends on it.
    """
    flags = os.environ.get("XLA_FLAGS", "").split()
    deciding = [flag for flag in flags if "host_platform_device_count" not in flag]
    return {
        "versions": {name: version(name) for name in PACKAGES},
        "backend": jax.default_backend(),
        "XLA_FLAGS": " ".join(sorted(deciding)),
        # A program that may raise an error while it runs is compiled differently.
        "EQX_ON_ERROR": os.environ.get("EQX_ON_ERROR", "raise"),
    }


def machine() -> str:
    """Processor, devices, system and host name, for the record."""
    model = platform.processor()
    if Path("/proc/cpuinfo").exists():
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next((line.split(":")[1].strip() for line in lines if "model name" in line), model)
    return f"{model}, {jax.device_count()} devices, {platform.platform()}, {platform.node()}"
