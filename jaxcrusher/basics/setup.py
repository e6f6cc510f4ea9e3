"""Set up a process before its first computation.

JAX reads all of this when it starts its backend, so it cannot be changed afterwards. Nothing here
imports JAX before it has to: Equinox reads its own setting when it is imported.
"""

import contextlib
import ctypes
import gc
import hashlib
import os
import platform
import sys
import warnings
from pathlib import Path
from time import perf_counter

import platformdirs

from jaxcrusher.basics.devices import computes_on, device_is_named, prefer_processor, setting
from jaxcrusher.basics.loop_kernels import (
    OPTION,
    SLOWER,
    ask_for_loop_kernels,
    asked_for,
    jax_has_started,
    loops_are_slow,
)
from jaxcrusher.version import __version__, version_of

# What XLA fuses it can write in two ways. The newer one took a quarter longer to compile an orbit
# or a gradient, and its programs ran no faster. Versions that do not know the option ignore it.
_FUSION_FLAG = "xla_cpu_disable_new_fusion_emitters"
_DEVICE_FLAG = "xla_force_host_platform_device_count"
_OBJECTS = 50_000
# What a call takes at most to look at kept programs that it has not seen, s.
_CHECK = 1.0
# What the user was told of already, or need not be: "loops" and "cores".
_told: set[str] = set()


def set_up() -> None:
    """Set JAX up: 64-bit floats, all cores, and programs that are compiled once.

    Call it before the first computation, best right after `import jaxcrusher`; a second call does
    nothing. After that computation it can only warn (UserWarning) and say how to start Python.

    - JAX computes in 64-bit floats.
    - JAX computes on the processor, also where it sees a GPU, unless you name a device: by
      `JAX_PLATFORMS`, or by JAX's settings `jax_platforms` and `jax_default_device`.
    - Each core is a device of JAX, and XLA takes the emitters that compile fastest. Such
      settings that `XLA_FLAGS` already holds stay as they are.
    - SciPy's OpenBLAS, in which JAX solves linear systems, takes one thread unless
      `OPENBLAS_NUM_THREADS` says otherwise: its threads wait for each other where every core has
      work, and a system of 200 unknowns then takes 100 ms instead of 0.5 ms. The first
      computation sets this without this call too.
    - Compiled programs are kept in the user's cache folder (or `JAX_COMPILATION_CACHE_DIR`), for
      this version of the package, of XLA and of the processor; a folder that cannot be written is
      only read, or not used. Files that a full disk or a killed process cut short are removed.
      `JAX_ENABLE_COMPILATION_CACHE=0` turns all of that off.
    - A program is kept only if it raises no errors while it runs, so Equinox is told to return
      NaN in place of them: a solve of your own by diffrax that fails is then NaN and raises
      nothing. With `EQX_ON_ERROR=raise` in the environment it raises, and nothing is kept.
    - Python's garbage collector runs after 50 000 new objects, if it ran more often: most
      objects of a trace stay alive, and scanning them took an eighth of a program's time.
    """
    if 0 < gc.get_threshold()[0] < _OBJECTS:
        gc.set_threshold(_OBJECTS)
    if "equinox" not in sys.modules:
        os.environ.setdefault("EQX_ON_ERROR", "nan")
    _one_thread()
    import jax

    # Made before a program is traced, which would be compiled again otherwise.
    import jaxcrusher.basics.loops  # noqa: F401

    jax.config.update("jax_enable_x64", True)
    prefer_processor()
    _keep_programs()
    ask_for_loop_kernels()
    _told.add("cores")
    given = os.environ.get("XLA_FLAGS", "")
    faster = "" if _FUSION_FLAG in given else f" --xla_backend_extra_options={_FUSION_FLAG}"
    count = None if _DEVICE_FLAG in given or setting("jax_num_cpu_devices") > 0 else cores()
    if not faster and count is None:
        return
    if jax_has_started():
        loops = "" if asked_for() else f" {OPTION}"
        devices = "" if count is None else f" --{_DEVICE_FLAG}={count}"
        flags = (given + loops + faster + devices).strip()
        _told.add("loops")
        warnings.warn(
            "set_up() came after JAX had started and has no effect on cores and loops. Call it "
            f"earlier, or start Python with XLA_FLAGS='{flags}'.",
            stacklevel=2,
        )
        return
    os.environ["XLA_FLAGS"] = (given + faster).strip()
    if count is not None:
        jax.config.update("jax_num_cpu_devices", count)


def _one_thread() -> None:
    """Let SciPy's OpenBLAS, in which JAX solves linear systems, take one thread.

    It reads the environment when it is loaded; from then on it must be told.
    """
    if "OPENBLAS_NUM_THREADS" in os.environ:
        return
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    if "scipy.linalg" not in sys.modules:
        return
    folder = Path(sys.modules["scipy"].__path__[0])
    for file in (*folder.parent.glob("scipy.libs/*openblas*"), *folder.glob(".dylibs/*openblas*")):
        with contextlib.suppress(OSError, AttributeError):  # another library than SciPy's wheels'
            ctypes.CDLL(str(file)).scipy_openblas_set_num_threads(1)


def require_set_up() -> None:
    """Check that JAX computes in 64-bit floats; warn, once in a process, of slow loops.

    Before JAX 0.12 loops are slow where the package was imported after JAX had started. Nothing is
    said to a user who named a device that is not the processor.
    """
    from jaxcrusher.basics.checks import require_x64

    require_x64()
    _one_thread()
    if not loops_are_slow() or (device_is_named() and computes_on() != "cpu"):
        return
    warn_once(
        "loops",
        "JAX had started before jaxcrusher was imported, so orbits and simulations take "
        f"{SLOWER} times as long. Import it before the first computation of the process.",
    )


def remind_of_idle_cores() -> None:
    """Warn, once in a process, where JAX computes on one core of the processor alone."""
    if _DEVICE_FLAG in os.environ.get("XLA_FLAGS", "") or setting("jax_num_cpu_devices") > 0:
        return
    if computes_on() != "cpu" or cores() == 1:
        return
    warn_once(
        "cores",
        f"Only one of {cores()} cores computes: jaxcrusher.set_up() was not called before the "
        "first computation of the process.",
    )


class UnusualNumbers(UserWarning):
    """Numbers of a crusher that are unlikely together."""


def warn_once(of: str, text: str, category: type[UserWarning] = UserWarning) -> None:
    """Warn of a matter, once in a process, at the user's line that entered the package."""
    if of not in _told:
        _told.add(of)
        warnings.warn(text, category=category, stacklevel=_level_of_the_user())


def _level_of_the_user() -> int:
    """Return how many frames above the caller of this function the package was entered."""
    frame, level = sys._getframe(1), 1
    while frame.f_back and frame.f_globals.get("__name__", "").startswith("jaxcrusher."):
        frame, level = frame.f_back, level + 1
    return level


def cores() -> int:
    """Return how many cores this process may use, as far as the system tells."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _keep_programs() -> None:
    """Let JAX keep all that it compiles, in the folder that the user chose or in one of ours."""
    import jax

    chosen = setting("jax_compilation_cache_dir")
    folder = Path(chosen) if chosen else programs_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return
    # Where it cannot write, JAX would say so at every program.
    may_write = os.access(folder, os.W_OK)
    if may_write:
        with contextlib.suppress(OSError):  # another process may have removed a file meanwhile
            _drop_what_is_cut_off(folder)
    least = 0.0 if may_write else float("inf")
    jax.config.update("jax_persistent_cache_min_compile_time_secs", least)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
    jax.config.update("jax_compilation_cache_dir", str(folder))


def _drop_what_is_cut_off(folder: Path) -> None:
    """Remove kept programs that cannot be read, as a full disk or a killed process leaves them.

    JAX warns of such a file each time, compiles its program, and keeps the file. Each file is read
    once, the oldest first: the time of a file without content says up to which one.
    """
    try:  # these two are not public, so another version of JAX may not have them
        from jax._src.compilation_cache import compress_executable, decompress_executable

        decompress_executable(compress_executable(b""))
    except Exception:
        return
    mark, until = folder / ".jaxcrusher_checked", perf_counter() + _CHECK
    checked = mark.stat().st_mtime_ns if mark.exists() else 0
    files = ((path.stat().st_mtime_ns, path) for path in folder.glob("*-cache"))
    for changed, path in sorted(file for file in files if file[0] > checked):
        try:
            decompress_executable(path.read_bytes())
        except Exception:  # each library that decompresses has its own
            path.unlink(missing_ok=True)
        checked = changed
        if perf_counter() > until:
            break
    mark.touch()
    os.utime(mark, ns=(checked, checked))


def programs_folder() -> Path:
    """Return the default folder of compiled programs, in the user's cache.

    It is for this version of the package, of XLA and of the processor: machine code of one
    processor may not run on another.
    """
    processor = platform.processor() + platform.machine()
    if (information := Path("/proc/cpuinfo")).exists():
        lines = set(information.read_text().splitlines())
        processor += "".join(sorted(line for line in lines if line.startswith(("model", "flags"))))
    digest = hashlib.sha256(processor.encode()).hexdigest()[:8]
    kind = f"{__version__}-jaxlib{version_of('jaxlib')}-{digest}"
    return platformdirs.user_cache_path("jaxcrusher") / kind
