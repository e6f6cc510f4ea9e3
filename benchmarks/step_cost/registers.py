"""The machine code of a field in lanes: its instructions counted, and its time."""

import re
import time
from collections import Counter
from types import ModuleType
from typing import Any

import jax
import numpy as np
from numba import njit

from benchmarks.step_cost.programs import Designs, statistics_of
from jaxcrusher.batch.lanes.layout import LANES
from jaxcrusher.batch.lanes.recorded import Recorded, integration_p, record
from jaxcrusher.motion.integrate import integrator

EVALUATIONS = 20_000
_ARITHMETIC = re.compile(r"\bv(?:add|sub|mul|div|sqrt|fn?m(?:add|sub)\d*)(pd|sd)\b.*")
_WIDTHS = {"zmm": "on registers of 8", "ymm": "on registers of 4", "xmm": "on registers of 2"}


def _recorded(d: Designs) -> Recorded:
    scene = jax.tree.map(lambda leaf: leaf[0], d.scenes)
    with integrator(record):
        jaxpr = jax.make_jaxpr(lambda scene: statistics_of(scene, d.turns))(scene)

    def find(jaxpr) -> Recorded | None:
        for equation in jaxpr.eqns:
            if equation.primitive is integration_p:
                return equation.params["what"]
            inner = equation.params.get("jaxpr", equation.params.get("call_jaxpr"))
            found = None if inner is None else find(inner.jaxpr)
            if found is not None:
                return found
        return None

    found = find(jaxpr.jaxpr)
    assert found is not None
    return found


def _compiled(d: Designs) -> tuple[Any, Any]:
    """The module of the equations, compiled anew, and its sizes; the contact's exponent is 1.5."""
    what = _recorded(d)
    text, sizes = what.source(dict.fromkeys(what.exponents, 1.5))
    module = ModuleType("equations")
    exec(text.replace("cache=True", "cache=False"), module.__dict__)
    return module, sizes


def counts(d: Designs) -> dict[str, int]:
    """Arithmetic instructions of the field on x86, by the registers that they work on."""
    module, _ = _compiled(d)
    found: Counter[str] = Counter()
    for line in module.field._library.get_asm_str().splitlines():
        operation = _ARITHMETIC.search(line)
        if operation:
            scalar = operation[1] == "sd"
            width = next(width for width in _WIDTHS if width in line)
            found["on single numbers" if scalar else _WIDTHS[width]] += 1
    return dict(found)


@njit
def _again(count, field, time, y, kept, rate):
    for _ in range(count):
        field(time, y, kept, rate)


def evaluation(d: Designs) -> float:
    """CPU nanoseconds of one evaluation of the field, of each of the designs side by side."""
    module, sizes = _compiled(d)
    # Any numbers will do: nothing branches.
    y, kept = np.full(sizes.states * LANES, 0.5), np.full(sizes.kept * LANES, 0.5)
    operands = module.field, np.linspace(0, 6, LANES), y, kept, np.zeros_like(y)
    _again(1, *operands)
    seconds = []
    for _ in range(5):
        began = time.process_time()
        _again(EVALUATIONS, *operands)
        seconds.append(time.process_time() - began)
    return 1e9 * float(np.median(seconds)) / EVALUATIONS / LANES
