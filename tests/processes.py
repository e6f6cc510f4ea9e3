"""Processes of this interpreter."""

import os
import subprocess
import sys
from pathlib import Path

# What a process of the package sets for those that it starts, and JAX reads as it starts.
OURS = ("XLA_FLAGS", "EQX_ON_ERROR", "JAX_COMPILATION_CACHE_DIR", "JAX_ENABLE_X64")
OURS += ("JAX_PLATFORMS", "JAX_PLATFORM_NAME", "JAX_DEFAULT_DEVICE")


def ended(
    *words: str, cwd: Path | None = None, env: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Return a process of Python with these words, once it has ended, and what it wrote."""
    command = [sys.executable, *words]
    return subprocess.run(
        command, cwd=cwd, env=env, capture_output=True, text=True, timeout=1800, check=False
    )


def python(program: str, **environment: str) -> subprocess.CompletedProcess:
    """Run a program in a fresh process, which this one's settings do not reach."""
    inherited = {name: value for name, value in os.environ.items() if name not in OURS}
    done = ended("-c", program, env=inherited | environment)
    assert done.returncode == 0, done.stderr
    return done
