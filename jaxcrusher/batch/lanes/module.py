"""Machine code of LLVM's text, kept on disk for the next process.

A folder that cannot be written costs the time to compile, and is no error.
"""

import hashlib
from functools import cache
from importlib.metadata import version
from pathlib import Path

import llvmlite.binding as llvm
import platformdirs

from jaxcrusher.files.durable import replace


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
    """Where machine code is kept, per user."""
    return platformdirs.user_cache_path("jaxcrusher") / "lanes"


@cache
def load(text: str) -> Machine:
    """The functions of a text, compiled unless an earlier process on such a processor did."""
    key = _digest(text, *_processor(), version("llvmlite"))
    file = cache_folder() / f"{key}.o"
    try:
        return Machine(file.read_bytes())
    except OSError:
        code = _target().emit_object(optimised(text, _target()))
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        replace(file, code)
    except OSError:
        pass
    return Machine(code)


def _processor() -> tuple[str, str]:
    """Its name and what it knows."""
    return llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


def _digest(*parts: str) -> str:
    """A name for what has this content."""
    return hashlib.sha256(chr(0).join(parts).encode()).hexdigest()[:32]


def optimised(text: str, target: llvm.TargetMachine) -> llvm.ModuleRef:
    """The module after LLVM's passes."""
    module, tuning = llvm.parse_assembly(text), llvm.create_pipeline_tuning_options(3)
    builder = llvm.create_pass_builder(target, tuning)
    builder.getModulePassManager().run(module, builder)
    return module


def assembly(text: str) -> str:
    """What the processor is told, in words."""
    return _target().emit_assembly(optimised(text, _target()))


def _target() -> llvm.TargetMachine:
    """This machine; a new one each time, for an engine takes it as its own."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(
        *_processor(), opt=3, jit=True
    )
