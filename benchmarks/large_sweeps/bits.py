"""`python -m benchmarks.large_sweeps.bits`: the hash of some results, in a process of its own."""

from typing import Annotated

import tyro

from jaxcrusher.files.program import program

# Impacts amplify a rounding by exp(200 t): 0.4 s of them show any difference in the last bit.
TRIAL = {"speed": [25.0, 31.0, 40.0], "clearance": [0.03e-3, 0.07e-3, 0.09e-3, 0.12e-3]}


def main(chunk: Annotated[int, tyro.conf.Positional]) -> None:
    """Print a hash of the results of twelve impacting designs.

    Args:
        chunk: Designs a chunk.
    """
    import hashlib

    import jaxcrusher as jc

    grid = jc.sweep(TRIAL, 0, 2, chunk=chunk, rtol=1e-6)
    digest = hashlib.sha256(b"".join(grid[name].values.tobytes() for name in grid.data_vars))
    print(digest.hexdigest()[:8])


if __name__ == "__main__":
    program(main)
