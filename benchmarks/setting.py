"""The machine and the versions behind a benchmark's figures, and processes on chosen cores."""

import json
import os
import platform
import subprocess
import sys
from collections.abc import Iterator

from jaxcrusher.basics.setup import set_up
from jaxcrusher.files.provenance import processor, versions

# Of a process that times compilation: programs compiled before do not count.
NOTHING_KEPT = {"JAX_ENABLE_COMPILATION_CACHE": "0"}


def set_up_to_time() -> None:
    """`jaxcrusher.set_up` of a program that times compilation."""
    os.environ |= NOTHING_KEPT
    set_up()


def setting(*packages: str) -> str:
    """Processor, cores, system, and the versions of Python, jaxcrusher's tools and `packages`."""
    known = versions("numpy", *packages)
    listed = ", ".join(f"{name} {number}" for name, number in known.items())
    return (
        f"{processor()}, {os.cpu_count()} cores, {platform.system()}; "
        f"Python {platform.python_version()}, {listed}"
    )


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
            # Who stops listening ends it.
            process.terminate()
    if process.returncode != 0:
        raise RuntimeError(f"{module} {' '.join(arguments)} failed: {said.strip()[-2000:]}")
