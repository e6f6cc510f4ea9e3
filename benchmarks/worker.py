"""`python -m benchmarks.worker`: the rows of a function, from a process of its own."""

from typing import Annotated

import tyro

from jaxcrusher.files.program import program

Word = Annotated[str, tyro.conf.Positional]


def main(
    module: Word,
    function: Word,
    arguments: Annotated[tuple[str, ...], tyro.conf.Positional] = (),
    bare: bool = False,
) -> None:
    """Print what a generator of a benchmark yields, a line of JSON each.

    Args:
        module: The module of the generator.
        function: Its name.
        arguments: Its arguments.
        bare: Leave out `jaxcrusher.set_up` and the flag on loops; floats have 64 bits anyway.
    """
    import importlib
    import json
    import os

    import jax

    from jaxcrusher.basics.loop_kernels import OPTION
    from jaxcrusher.basics.setup import set_up

    if bare:  # a number of devices that the caller asks for stays
        os.environ["XLA_FLAGS"] = os.environ["XLA_FLAGS"].replace(OPTION, "")
    else:
        set_up()
    jax.config.update("jax_enable_x64", True)
    for row in getattr(importlib.import_module(module), function)(*arguments):
        print(json.dumps(row), flush=True)


if __name__ == "__main__":
    program(main, prepare=None)
