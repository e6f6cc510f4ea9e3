"""The machine code of a field in lanes: its instructions counted, and its time."""

import ctypes
import re
from collections import Counter

import jax
import numpy as np

from benchmarks.step_cost.programs import Designs, statistics_of
from benchmarks.timing import timed
from jaxcrusher.lanes.code import LANES, WIDTH
from jaxcrusher.lanes.layout import TIME
from jaxcrusher.lanes.machine import assembly, load
from jaxcrusher.lanes.record import Recorded, integration_p
from jaxcrusher.lanes.stepper import Kernels
from jaxcrusher.motion.integrate import integrator
from jaxcrusher.motion.recorded import record

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


def _kernels(d: Designs) -> Kernels:
    """Return the kernels of the designs; the contact's exponent is 1.5."""
    what = _recorded(d)
    return what.kernels(dict.fromkeys(what.exponents, 1.5))


def counts(d: Designs) -> dict[str, int]:
    """Count arithmetic instructions of the field on x86, by the registers that they work on."""
    found: Counter[str] = Counter()
    _, text = assembly(_kernels(d).text).split("\nfield:", 1)
    for line in text[: text.index(".Lfunc_end")].splitlines():
        operation = _ARITHMETIC.search(line)
        if operation:
            scalar = operation[1] == "sd"
            width = next(width for width in _WIDTHS if width in line)
            found["on single numbers" if scalar else _WIDTHS[width]] += 1
    return dict(found)


# The field of all lanes, so many times: at the time of the row TIME, to the first stage's rates.
_AGAIN = """
define void @again(ptr %memory, i64 %count) {{
  br label %turn
turn:
  %i = phi i64 [ 0, %0 ], [ %next, %turn ]
  {calls}
  %next = add i64 %i, 1
  %more = icmp slt i64 %next, %count
  br i1 %more, label %turn, label %end
end:
  ret void
}}
"""


def evaluation(d: Designs) -> float:
    """Return CPU nanoseconds of one evaluation of the field, for each design side by side."""
    kernels = _kernels(d)
    at = kernels.at
    calls = (
        f"call void @field(ptr %memory, i64 {first}, i64 {TIME}, i64 {at.y}, i64 {at.k})"
        for first in range(0, LANES, WIDTH)
    )
    machine = load(kernels.text + _AGAIN.format(calls="\n  ".join(calls)))
    # Any numbers will do: nothing branches.
    memory = np.full((at.end, LANES), 0.5)
    memory[0] = np.linspace(0, 6, LANES)
    again = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64)(machine["again"])
    run = timed(lambda: again(memory.ctypes.data, EVALUATIONS))
    return 1e9 * run.again.cpu / EVALUATIONS / LANES
