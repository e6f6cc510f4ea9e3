"""The machine and the versions behind a benchmark's figures, and processes on chosen cores."""

import json
import os
import platform
import subprocess
import sys
from collections.abc import Iterator

from jaxcrusher.basics.setup import set_up
from jaxcrusher.files.provenance import processor, versions

# For a process that times compilation: programs compiled before do not count.
NOTHING_KEPT = {"JAX_ENABLE_COMPILATION_CACHE": "0"}


def set_up_to_time() -> None:
    """Set JAX up for a program that times compilation."""
    os.environ |= NOTHING_KEPT
    set_up()


def setting(*packages: str) -> str:
    """Name the processor, cores, system and versions of Python, our tools and `packages`."""
    known = versions("numpy", *packages)
    listed = ", ".join(f"{name} {number}" for name, number in known.items())
    return (
        f"{processor()}, {os.cpu_count()} cores, {platform.system()}; "
        f"Python {platform.python_version()}, {listed}"
    )


def run_apart(
    module: str, *arguments: str, cores: int | None = None, flags: str = ""
) -> Iterator[dict]:
    """Run `module` in a process of its own with XLA's `flags`; yield its lines of JSON.

    It runs on the first `cores` cores; where the system cannot pin it (other than Linux) XLA has
    that many devices. RuntimeError with the process's message if it fails.
    """
    environment = os.environ | NOTHING_KEPT
    environment.pop("XLA_FLAGS", None)
    command = [sys.executable, "-m", module, *arguments]
    if cores is not None and hasattr(os, "sched_setaffinity"):
        first = sorted(os.sched_getaffinity(0))[:cores]
        pin = (
            f"import os, sys; os.sched_setaffinity(0, {first}); os.execv(sys.argv[1], sys.argv[1:])"
        )
        command = [sys.executable, "-c", pin, *command]
    elif cores is not None:
        flags = f"--xla_force_host_platform_device_count={cores} {flags}"
    if flags:
        environment["XLA_FLAGS"] = flags
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None and process.stderr is not None
        try:
            for line in process.stdout:
                yield json.loads(line)
            said = process.stderr.read()
            process.wait()
        finally:
            # A listener that stops early ends the process.
            process.terminate()
    if process.returncode != 0:
        raise RuntimeError(f"{module} {' '.join(arguments)} failed: {said.strip()[-2000:]}")
