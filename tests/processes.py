"""Processes of this interpreter."""

import subprocess
import sys
from pathlib import Path


def ended(
    *words: str, cwd: Path | None = None, env: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Return a process of Python with these words, once it has ended, and what it wrote."""
    command = [sys.executable, *words]
    return subprocess.run(
        command, cwd=cwd, env=env, capture_output=True, text=True, timeout=1800, check=False
    )
