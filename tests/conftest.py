"""A process set up before its first computation; one folder of compiled programs for this run."""

import atexit
import os
import shutil
import tempfile

import jaxcrusher as jc

# Workers, kernels of notebooks and subprocesses inherit it.
if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
    os.environ["JAX_COMPILATION_CACHE_DIR"] = tempfile.mkdtemp(prefix="jaxcrusher-")
    atexit.register(shutil.rmtree, os.environ["JAX_COMPILATION_CACHE_DIR"], ignore_errors=True)
jc.set_up()
