"""The machine and the versions behind a benchmark's figures, and processes on chosen cores."""

import json
import os
import platform
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

# Of a process that times compilation: programs compiled before do not count.
NOTHING_KEPT = {"JAX_ENABLE_COMPILATION_CACHE": "0"}


def setting(*packages: str) -> str:
    """Processor, cores, system, and the versions of Python, jaxcrusher's tools and `packages`."""
    model = platform.processor() or platform.machine()
    if Path("/proc/cpuinfo").exists():
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next((line.split(":")[1].strip() for line in lines if "model name" in line), model)
    names = ("jax", "jaxlib", "diffrax", "numpy", *packages)
    versions = [f"Python {platform.python_version()}", *(f"{n} {version(n)}" for n in names)]
    return f"{model}, {os.cpu_count()} cores, {platform.system()}; {', '.join(versions)}"


def run_apart(module: str, *arguments: str, cores: int) -> Iterator[dict]:
    """Run `module` in a process of its own on the first `cores` cores; yields its lines of JSON.

    Not pinned where the system cannot (other than Linux): XLA then has that many devices only.
    Raises RuntimeError with what the process said if it fails.
    """
    # The process asks XLA for its own flags.
    environment = {name: value for name, value in os.environ.items() if name != "XLA_FLAGS"}
    environment |= NOTHING_KEPT
    command = [sys.executable, "-m", module, *arguments]
    if hasattr(os, "sched_setaffinity"):
        first = sorted(os.sched_getaffinity(0))[:cores]
        pin = (
            f"import os, sys; os.sched_setaffinity(0, {first}); os.execv(sys.argv[1], sys.argv[1:])"
        )
        command = [sys.executable, "-c", pin, *command]
    else:
        environment["XLA_FLAGS"] = f"--xla_force_host_platform_device_count={cores}"
    process = subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stderr is not None
    for line in process.stdout:
        yield json.loads(line)
    said = process.stderr.read()
    if process.wait() != 0:
        raise RuntimeError(f"{module} {' '.join(arguments)} failed: {said.strip()[-2000:]}")
