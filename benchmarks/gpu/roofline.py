"""The least time of a kernel on a card's units for numbers of 64 bits.

Instructions are counted in PTX, along the way of a step; what is rare is left out, and lanes of a
warp that wait are not counted. A kernel cannot be faster than this, and is slower.
"""

import re
from collections.abc import Mapping

from jaxcrusher.lanes.stepper import STAGES
from jaxcrusher.motion.statistic import SAMPLES

# Of a division, a square root and an inverse NVIDIA's compiler makes some of these: an estimate
# from a table, and Newton's steps.
MANY = {"div": 8, "sqrt": 8, "rcp": 5}
SINGLE = ("add", "sub", "mul", "fma", "min", "max", "setp")
# What the units of a multiprocessor issue at a clock, by the card's capability; others 2. See
# "Throughput of Native Arithmetic Instructions" in NVIDIA's CUDA C++ Programming Guide.
A_CLOCK = {"60": 32, "70": 32, "80": 32, "90": 64, "100": 64}


def counted(ptx: str) -> dict[str, int]:
    """Return how many instructions of each function are for the units, without its calls."""
    functions = re.findall(r"\.(?:func|entry) +(\w+)\(.*?\n\{(.*?)\n\}", ptx, re.DOTALL)
    return {name: sum(map(_weight, _operations(text))) for name, text in functions}


def _operations(text: str) -> list[str]:
    found = re.findall(r"^\s*(?:@!?%p\d+\s+)?([a-z][\w.]*\.f64)\s", text, re.MULTILINE)
    return [operation.partition(".")[0] for operation in found]


def _weight(operation: str) -> int:
    return MANY.get(operation, int(operation in SINGLE))


def instructions(ptx: str, steps: float, turns: int) -> float:
    """Return those of a design that takes so many steps through so many turns."""
    of = counted(ptx)
    step = of["step"] + (STAGES - 1) * of["field"] + of["accept"]
    return steps * step + turns * SAMPLES * of["look"]


def peak(capability: str, attributes: Mapping[str, int]) -> float:
    """Return how many of them a card issues in a second."""
    clock = 1e3 * attributes["ClockRate"]
    return attributes["MultiProcessorCount"] * A_CLOCK.get(capability, 2) * clock
