"""Source as a compiled module, kept on disk for the next process."""

import hashlib
import importlib.util
import linecache
import os
import sys
from functools import cache
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

import platformdirs

from jaxcrusher.batch.lanes import elementary, instructions, layout


def cache_folder() -> Path:
    """Where compiled modules are kept, per user; numba tells processors apart in it."""
    versions = f"lanes-{version('jaxcrusher')}-numba-{version('numba')}"
    return platformdirs.user_cache_path("jaxcrusher") / versions


@cache
def load(text: str) -> ModuleType:
    """The module with this text; numba compiles it unless an earlier process did.

    It is kept by its content and that of the functions that are compiled into it: numba by itself
    looks at the date of the one file only. A folder that cannot be written costs the time to
    compile, and is no error.
    """
    inlined = [Path(str(part.__file__)) for part in (elementary, instructions, layout)]
    parts = chr(0).join([text, *(file.read_text("utf-8") for file in inlined)])
    name = f"jaxcrusher_lanes_{hashlib.sha256(parts.encode()).hexdigest()[:32]}"
    try:
        file = cache_folder() / f"{name}.py"
        if not file.exists():
            file.parent.mkdir(parents=True, exist_ok=True)
            aside = file.with_suffix(f".{os.getpid()}")
            aside.write_text(text, "utf-8")
            os.replace(aside, file)
        specification = importlib.util.spec_from_file_location(name, file)
        assert specification is not None and specification.loader is not None
        module = importlib.util.module_from_spec(specification)
        # numba finds a function's module by name.
        sys.modules[name] = module
        specification.loader.exec_module(module)
    # No home, no permission; numba's own error is a RuntimeError.
    except (OSError, RuntimeError):
        module = sys.modules[name] = ModuleType(name)
        text = text.replace("cache=True", "cache=False")
        linecache.cache[name] = (len(text), None, text.splitlines(keepends=True), name)
        exec(compile(text, name, "exec"), module.__dict__)
    return module
