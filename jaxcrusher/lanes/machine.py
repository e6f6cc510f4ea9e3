"""Machine code of LLVM's text, kept on disk for the next process.

A folder that cannot be written costs the time to compile, and is no error.
"""

import hashlib
import threading
from functools import cache
from importlib.metadata import version
from pathlib import Path

import llvmlite.binding as llvm
import platformdirs

from jaxcrusher.files.durable import replace

# A function that threads ask for at once is compiled by one of them.
_LOCK = threading.Lock()


class Machine:
    """Functions in machine code, by name -> address; they live as long as this."""

    def __init__(self, code: bytes) -> None:
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target())
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self._engine.finalize_object()
        self._addresses: dict[str, int] = {}

    def __getitem__(self, name: str) -> int:
        # LLVM takes a third of a millisecond to find one.
        if name not in self._addresses:
            self._addresses[name] = self._engine.get_function_address(name)
        return self._addresses[name]


def cache_folder() -> Path:
    """Return the user's folder in which machine code is kept."""
    return platformdirs.user_cache_path("jaxcrusher") / "lanes"


def load(text: str) -> Machine:
    """Load the functions of a text, compiled unless an earlier process on such a processor did."""
    with _LOCK:
        return _load(text)


@cache
def _load(text: str) -> Machine:
    key = "\0".join((text, *_processor(), version("llvmlite")))
    file = cache_folder() / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.code"
    try:
        return Machine(_checked(file.read_bytes()))
    except (OSError, ValueError):  # There is none, or it is broken.
        code = _target().emit_object(optimised(text, _target()))
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        replace(file, hashlib.sha256(code).digest() + code)
    except OSError:
        pass
    return Machine(code)


def _checked(content: bytes) -> bytes:
    """Return the machine code of a file, behind its checksum; LLVM crashes on a broken one."""
    checksum, code = content[:32], content[32:]
    if hashlib.sha256(code).digest() != checksum:
        raise ValueError("The machine code does not match its checksum.")
    return code


def _processor() -> tuple[str, str]:
    """Return the processor's name and what it knows."""
    return llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


def _target() -> llvm.TargetMachine:
    """Make this machine; a new one each time, for an engine takes it as its own."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(
        *_processor(), opt=3, jit=True
    )


def optimised(text: str, target: llvm.TargetMachine) -> llvm.ModuleRef:
    """Return the module after LLVM's passes."""
    module, tuning = llvm.parse_assembly(text), llvm.create_pipeline_tuning_options(3)
    builder = llvm.create_pass_builder(target, tuning)
    builder.getModulePassManager().run(module, builder)
    return module


def assembly(text: str) -> str:
    """Return what the processor is told, in words."""
    return _target().emit_assembly(optimised(text, _target()))
