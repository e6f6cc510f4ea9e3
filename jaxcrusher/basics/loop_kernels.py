"""The flag by which XLA makes one kernel of a loop on a processor, set as the package is imported.

Without it each operation in a loop is called on its own, and a loop of this package has hundreds.
JAX takes such a flag for the whole process, and only before its first computation.
"""

import os
import sys

from jaxcrusher.basics.devices import setting

# Internal to XLA. It makes one kernel of a loop that moves at most so many bytes in a turn, unless
# the loop has a matrix product, a sort or a scatter. Without the flag the bound is 1 KiB up to JAX
# 0.11, and there is none from 0.12 on. The largest loop of this package, of the slopes of three
# loose joints, moves between 16 and 64 KiB. A loop of the user's below this bound takes some 20 us
# a turn, which several cores hardly shorten.
FLAG = "xla_cpu_small_while_loop_byte_threshold"
OPTION = f"--xla_backend_extra_options={FLAG}={256 * 1024}"
# Measured on one core without the flag: an orbit 5, its slopes 6 to 7, statistics 16.
SLOWER = "5 to 16"


def ask_for_loop_kernels() -> None:
    """Add the flag to `XLA_FLAGS`, unless it stands there already or JAX has started."""
    if not asked_for() and not jax_has_started():
        # XLA adds up the extra options of several flags.
        os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {OPTION}".strip()


def asked_for() -> bool:
    """Tell whether the flag stands in `XLA_FLAGS`, with this bound or one of the user's."""
    return FLAG in os.environ.get("XLA_FLAGS", "")


def loops_are_slow() -> bool:
    """Tell whether XLA calls each loop operation on its own: before JAX 0.12, without the flag."""
    import jax

    return not asked_for() and jax.__version_info__ < (0, 12)


def jax_has_started() -> bool:
    """Tell whether JAX has computed already: from then on it refuses to change this setting."""
    if "jax" not in sys.modules:
        return False
    import jax

    before = setting("jax_num_cpu_devices")
    try:
        jax.config.update("jax_num_cpu_devices", before + 1)
    except RuntimeError:
        return True
    jax.config.update("jax_num_cpu_devices", before)
    return False
