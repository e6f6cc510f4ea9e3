"""Provenance: what besides its parameters decides the bits of a result."""

import json
import os
import platform
import shlex
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from jaxcrusher.basics.devices import computes_on, devices
from jaxcrusher.version import __version__, version_of

# Packages whose version can change the last bit of a result.
PACKAGES = ("jax", "jaxlib", "diffrax", "equinox", "llvmlite")


def provenance(
    title: str, program: Mapping[str, Any] | None = None, **further: Any
) -> dict[str, Any]:
    """Return the attributes of a result: its command, versions, machine, and `further` ones.

    `program` is the `environment` that computed it, that of this process if None. Mappings become
    JSON, since a file's attributes have no parts.
    """
    program = environment() if program is None else program
    kept = {
        "title": title,
        "source": f"jaxcrusher {program['versions']['jaxcrusher']}",
        "history": f"{now()}: {command()}",
        "environment": program,
        "machine": machine(),
        **further,
    }
    return {
        name: json.dumps(dict(value)) if isinstance(value, Mapping) else value
        for name, value in kept.items()
    }


def now() -> str:
    """Return the time in UTC, to a second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def command() -> str:
    """Return the command line of this process, as a shell takes it."""
    return shlex.join([*program_words(), *sys.argv[1:]])


def program_words() -> list[str]:
    """Return the command line without its arguments: `python -m jaxcrusher`."""
    given, words = sys.argv[1:], sys.orig_argv
    before, after = words[: len(words) - len(given)], words[len(words) - len(given) :]
    # A script that an installer put beside the interpreter is on the user's path, as that is.
    script = Path(sys.argv[0]).absolute()
    if after != given or (len(before) == 2 and script.parent == Path(sys.executable).parent):
        return [Path(sys.argv[0]).name]
    return ["python", *before[1:]]


def environment() -> dict[str, Any]:
    """Return versions, backend and XLA's flags: the same give the same bits on one processor.

    The number of devices is left out, because no result depends on it.
    """
    flags = os.environ.get("XLA_FLAGS", "").split()
    deciding = [flag for flag in flags if "host_platform_device_count" not in flag]
    return {
        "versions": versions(),
        "backend": computes_on(),
        "XLA_FLAGS": " ".join(sorted(deciding)),
        # A program that may raise an error while it runs is compiled differently.
        "EQX_ON_ERROR": os.environ.get("EQX_ON_ERROR", "raise"),
    }


def versions(*further: str) -> dict[str, str]:
    """Return the versions of the packages that decide bits, and of `further` ones."""
    return {"jaxcrusher": __version__, **{name: version_of(name) for name in (*PACKAGES, *further)}}


def machine() -> str:
    """Return processor, devices, system and host name, for the record."""
    return f"{processor()}, {len(devices())} devices, {platform.platform()}, {platform.node()}"


def processor() -> str:
    """Return the processor's name, as far as the system tells."""
    model = platform.processor() or platform.machine()
    if Path("/proc/cpuinfo").exists():
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        model = next((line.split(":")[1].strip() for line in lines if "model name" in line), model)
    return model
