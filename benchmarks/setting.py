"""The machine and the versions behind a benchmark's figures, and processes that are timed."""

import os
import platform

from jaxcrusher.basics.setup import set_up
from jaxcrusher.files.provenance import processor, versions


def set_up_to_time() -> None:
    """Set JAX up for a program that times compilation: programs compiled before do not count."""
    os.environ["JAX_ENABLE_COMPILATION_CACHE"] = "0"
    set_up()


def setting(*packages: str) -> str:
    """Name the processor, cores, system and versions of Python, our tools and `packages`."""
    known = versions("numpy", *packages)
    listed = ", ".join(f"{name} {number}" for name, number in known.items())
    return (
        f"{processor()}, {os.cpu_count()} cores, {platform.system()}; "
        f"Python {platform.python_version()}, {listed}"
    )
