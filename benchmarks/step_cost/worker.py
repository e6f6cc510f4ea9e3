"""`python -m benchmarks.step_cost.worker`: one measurement, told in lines of JSON."""

from typing import Annotated

import tyro

from jaxcrusher.basics.setup import set_up
from jaxcrusher.files.program import program

Word = Annotated[str, tyro.conf.Positional]


def main(what: Word, motion: Word, flag: Word) -> None:
    """Measure in this process, and tell how far it is and what was found.

    Args:
        what: costs, profile or fewer.
        motion: quiet or impacting, where it matters.
        flag: "loop flag" or "no flag" of XLA.
    """
    import json

    import jax

    # Without the flag nothing else is set; one core means one device anyway.
    if flag == "loop flag":
        set_up()
    jax.config.update("jax_enable_x64", True)
    from benchmarks.step_cost.measure import measure

    done = 0

    def advance(total: int) -> None:
        nonlocal done
        done += 1
        print(json.dumps({"done": done, "total": total}), flush=True)

    print(json.dumps({"answer": measure(what, motion, flag, advance)}), flush=True)


if __name__ == "__main__":
    program(main, prepare=None)
