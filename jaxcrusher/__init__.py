"""A differentiable simulator of a jaw crusher whose main bearing has clearance.

The public names stand in `__init__.pyi`. Each is imported when it is first asked for: JAX takes a
second, which `--help` and a program that sets JAX up first need not wait for.
"""

import lazy_loader

from jaxcrusher.basics.loop_kernels import ask_for_loop_kernels
from jaxcrusher.basics.processes import watch_forks

ask_for_loop_kernels()
watch_forks()
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
