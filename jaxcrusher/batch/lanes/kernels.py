"""All of a batch as functions of lanes: the equations, the arithmetic of a step, and the loop.

The step is that of an explicit Runge-Kutta method under a PI controller, as diffrax has it.
"""

from collections.abc import Mapping
from math import prod
from typing import NamedTuple

from jaxcrusher.batch.lanes.elementary import exponential, logarithm
from jaxcrusher.batch.lanes.emit import Atom, Emitter, number
from jaxcrusher.batch.lanes.expression import where
from jaxcrusher.batch.lanes.known import Known
from jaxcrusher.batch.lanes.layout import (
    AT,
    ATOL,
    COUNT,
    DT,
    DUE,
    END,
    FLOOR,
    FRESH,
    KEEP,
    LARGEST,
    LAST,
    LEAST,
    LOOK,
    MEMORY,
    MOST,
    NEXT,
    RTOL,
    SAFETY,
    SMALLEST,
    STAGES,
    STEP,
    THIS,
    TIME,
    Page,
    Places,
    Sizes,
    Tableau,
    places,
)
from jaxcrusher.batch.lanes.primitives import type_of
from jaxcrusher.batch.lanes.stepper import Parts, write_loop
from jaxcrusher.batch.lanes.summary import Summary, write_summary
from jaxcrusher.batch.lanes.vector import CORES, Code, Module, Shape

# Bounds of the mean square of an error over the allowed one.
HUGE, TINY = 1e300, 1e-300


class Equations(NamedTuple):
    """Functions of scalars: time, states (of the motion, then totals), numbers of the design."""

    field: Known
    observe: Known
    summarise: Known  # of what is observed, stacked over the instants, and states
    instants: int
    motion: int
    states: int

    @property
    def types(self) -> list[str]:
        """The types of the numbers of the design."""
        return list(map(type_of, self.field.operands[1 + self.states :]))


class Kernels(NamedTuple):
    """LLVM's text of `advance` (see `stepper`) and `summarise` (see `summary`), and of what."""

    text: str
    shape: Shape
    sizes: Sizes
    page: Page
    over: list[bool]  # of every summary, whether it is an array over the instants


def kernels(
    equations: Equations, known: Mapping[int, float], table: Tableau, shape: Shape = CORES
) -> Kernels:
    """The functions of a batch.

    `known` are those numbers of a design that are written into them.
    """
    module, types = Module(shape), equations.types
    observed = sum(map(prod, equations.observe.shapes))
    sizes = Sizes(equations.motion, equations.states, len(types), observed)
    at = places(sizes)
    prepare, field = Code(module, "prepare"), Code(module, "field", rows=3)
    look = Code(module, "look")
    emitter = Emitter(prepare, at.kept)
    numbers = [
        number(known[i]) if i in known else emitter.given(i, at.given + i, type_)
        for i, type_ in enumerate(types)
    ]
    _write_field(field, equations, emitter, numbers)
    _write_look(look, equations, emitter, numbers, table, at)
    sizes = _write_prepare(prepare, emitter, sizes)
    summary = _write_summary(module, equations)
    parts = Parts(
        _write_begin(Code(module, "begin"), prepare, field, at, sizes),
        _write_step(Code(module, "step"), field, table, at, sizes),
        look,
        _write_acceptance(Code(module, "accept"), at, sizes),
        summary.part,
    )
    write_loop(module, parts, sizes, summary.page, equations.instants, summary.numbers)
    return Kernels(str(module), shape, sizes, summary.page, summary.over)


def exponents(equations: Equations) -> list[int]:
    """The numbers of a design that powers depend on: formulas rather than data.

    x^1.5 is a product and a root, x^p a logarithm and an exponential.
    """
    module = Module()
    emitter = Emitter(Code(module, "prepare"), 0)
    numbers = [emitter.given(i, i, type_) for i, type_ in enumerate(equations.types)]
    _write_field(Code(module, "field", rows=3), equations, emitter, numbers)
    states = [Atom(emitter.prepare.read(i)) for i in range(1 + equations.states)]
    emitter.body(Code(module, "look"), equations.observe, [*states, *numbers])
    _write_summary(module, equations)
    return sorted(emitter.exponents)


def _write_summary(module: Module, equations: Equations) -> Summary:
    """Of what is observed at the instants of a segment; see `summary.write_summary`."""
    return write_summary(module, equations.summarise, equations.observe.shapes, equations.instants)


def _write_field(code: Code, equations: Equations, emitter: Emitter, numbers: list[Atom]) -> None:
    """Of the rows of a time and of states, to those of rates."""
    time, y, rate = code.rows
    states = [Atom(code.read(y, i)) for i in range(equations.states)]
    results = emitter.body(code, equations.field, [Atom(code.read(time)), *states, *numbers])
    for i, result in enumerate(results):
        code.write(result, rate, i)
    code.end()


def _write_look(
    code: Code,
    equations: Equations,
    emitter: Emitter,
    numbers: list[Atom],
    table: Tableau,
    at: Places,
) -> None:
    """What is seen at the instants that are due, from states between those of the step's ends."""
    due, time, step, states = code.read(DUE), code.read(TIME), code.read(STEP), equations.states
    share = (due - time) / step
    weights = [
        step * share * (d[0] + share * (d[1] + share * (d[2] + share * d[3]))) for d in table.dense
    ]

    def state(i: int):
        rates = (code.read(at.k + stage * states + i) for stage in range(STAGES))
        changes = [weight * rate for weight, rate in zip(weights, rates, strict=True)]
        return code.read(at.y + i) + sum(changes[1:], changes[0])

    # LLVM leaves out the states that do not matter.
    operands = [Atom(due), *(Atom(state(i)) for i in range(states)), *numbers]
    for i, value in enumerate(emitter.body(code, equations.observe, operands)):
        code.write(value, at.seen + i)
    code.end()


def _write_prepare(code: Code, emitter: Emitter, sizes: Sizes) -> Sizes:
    """Of the numbers of designs, to what is kept; the sizes with it."""
    kept, first = emitter.keep(), places(sizes).kept
    for i, value in enumerate(kept):
        code.write(value, first + i)
    code.end()
    return sizes._replace(kept=len(kept))


def _write_begin(code: Code, prepare: Code, field: Code, at: Places, sizes: Sizes) -> Code:
    """Numbers and the first rates of new designs; other lanes keep theirs."""
    code.run(prepare)
    code.run(field, TIME, at.y, at.trial)
    fresh = code.read(FRESH) > 0
    for i in range(sizes.states):
        rate = where(fresh, code.read(at.trial + i), code.read(at.k + i))
        code.write(rate, at.k + i)
    return code.end()


def _write_step(code: Code, field: Code, table: Tableau, at: Places, sizes: Sizes) -> Code:
    """One step of all lanes into `trial`, and what becomes of it."""
    time, step = code.read(TIME), code.read(STEP)
    y = [code.read(at.y + i) for i in range(sizes.states)]

    def combined(weights, state):
        """The weighted sum of the rates so far."""
        terms = [
            weight * code.read(at.k + j * sizes.states + state)
            for j, weight in enumerate(weights)
            if weight != 0
        ]
        return sum(terms[1:], terms[0])

    for stage in range(1, STAGES):
        for i, before in enumerate(y):
            change = combined(table.weights[stage, :stage], i)
            code.write(before + step * change, at.trial + i)
        code.write(time + table.nodes[stage] * step, AT)
        code.run(field, AT, at.trial, at.k + stage * sizes.states)
    # Totals do not count, unless there is nothing else.
    count, squares = sizes.motion or sizes.states, code.vector(0.0)
    for i, before in enumerate(y[:count]):
        before, after = abs(before), abs(code.read(at.trial + i))
        size = where(after > before, after, before)
        error = step * combined(table.error, i) / (code.read(ATOL) + code.read(RTOL) * size)
        squares = squares + error * error
    _judge(code, squares / count)
    return code.end()


def _judge(code: Code, mean) -> None:
    """Keep or reject a step of this mean square of errors, and choose the size of the next."""
    # What is not finite is a huge error.
    mean = where(mean < HUGE, mean, HUGE)
    good = -0.5 * logarithm(where(mean > TINY, mean, TINY))
    change = exponential(code.read(THIS) * good + code.read(LAST) * code.read(MEMORY))
    safety, keep = code.read(SAFETY), mean < 1.0
    factor = safety * change
    least = where(keep, 1.0, code.read(LEAST))
    most = where(keep, code.read(LARGEST), safety)
    factor = where(factor < least, least, where(factor > most, most, factor))
    good = where(mean > TINY, good, 0.0)
    code.write(where(keep, good, code.read(MEMORY)), MEMORY)
    code.write(code.read(STEP) * factor, DT)
    code.write(where(keep, code.vector(1.0), 0.0), KEEP)


def _write_acceptance(code: Code, at: Places, sizes: Sizes) -> Code:
    """Move on the lanes that keep their step, and say which are to be looked at."""
    keep, last = code.read(KEEP) > 0, at.k + (STAGES - 1) * sizes.states
    for i in range(sizes.states):
        code.write(where(keep, code.read(at.trial + i), code.read(at.y + i)), at.y + i)
        # The last stage is the first of the next step.
        code.write(where(keep, code.read(last + i), code.read(at.k + i)), at.k + i)
    time = where(keep, code.read(NEXT), code.read(TIME))
    end, size, count = code.read(END), code.read(DT), code.read(COUNT) + 1.0
    after = time + size
    # A step that was too long to keep must not be tried again.
    clipped = where(keep, end, time + 0.5 * (end - time))
    after = where(after > code.read(FLOOR), clipped, after)
    stuck = (size < code.read(SMALLEST)) | (count >= code.read(MOST))
    code.write(time, TIME)
    code.write(after, NEXT)
    code.write(after - time, STEP)
    code.write(count, COUNT)
    code.write(where((time >= end) | stuck, code.vector(1.0), 0.0), LOOK)
    return code.end()
