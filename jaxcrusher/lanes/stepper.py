"""The integration of a batch as functions of lanes: equations, a step, and the loop over steps.

The step is that of an explicit Runge-Kutta method under a PI controller, as diffrax has it. Every
lane has its own time, step and segment; a lane that has ended takes the next design, so none waits
for another. What all lanes do side by side are functions of vectors; what is rare is done lane by
lane in the loop.
"""

import math
import operator
from collections.abc import Iterable, Sequence
from functools import reduce
from math import prod
from typing import Any, NamedTuple

import numpy as np

from jaxcrusher.lanes import layout as row
from jaxcrusher.lanes.code import CORES, Array, Code, Module, Shape
from jaxcrusher.lanes.elementary import exponential, logarithm
from jaxcrusher.lanes.equations import Atom, Emitter, write_summary
from jaxcrusher.lanes.expression import DOUBLE, INTEGER, Expression, where
from jaxcrusher.lanes.layout import (
    FIELDS,
    STAGES,
    WHOLE,
    Lanes,
    Layout,
    Shared,
    lane_shapes,
    layout,
)
from jaxcrusher.lanes.primitives import type_of
from jaxcrusher.lanes.verify import Verified

# Bounds of the mean square of an error over the allowed one.
HUGE, TINY = 1e300, 1e-300


class Followed(NamedTuple):
    """What is followed from step to step: it is seen where rates are known, and kept."""

    seen: int = 0  # numbers, behind the rates
    begin: tuple[float, ...] = ()  # what is kept before the first step
    # Of what is kept, and of time and what is seen before a step, at its start and at its end.
    follow: Verified | None = None


class Equations(NamedTuple):
    """Functions of scalars: time, states (of the motion, then totals), numbers of the design."""

    field: Verified  # rates, and what is followed
    observe: Verified
    # Of what is observed, stacked over the instants, of states, and of what is kept.
    summarise: Verified
    instants: int
    motion: int  # states that count for the error
    followed: Followed = Followed()

    @property
    def states(self) -> int:
        """Count the states."""
        return len(self.field.results) - self.followed.seen

    @property
    def sampled(self) -> list[int]:
        """Return which of time (0) and states (from 1 on) it takes to observe."""
        return [i for i in self.observe.read if i <= self.states]

    @property
    def coupled(self) -> list[int]:
        """Return which states its rates depend on."""
        return [i - 1 for i in self.field.read if 1 <= i <= self.states]


class Tableau(NamedTuple):
    """An explicit Runge-Kutta method."""

    nodes: np.ndarray  # (STAGES,)
    weights: np.ndarray  # (STAGES, STAGES): of the stages before
    error: np.ndarray  # (STAGES,)
    # At a share s of the step, stage j of the solution has the weight sum_p dense[j, p] s^(p + 1).
    dense: np.ndarray  # (STAGES, 4)


class Kernels(NamedTuple):
    """LLVM's text of `advance` and `summarise`, and the memory that they work on."""

    text: str
    at: Layout
    over: list[bool]  # of every summary, whether it is an array over the instants


def kernels(equations: Equations, table: Tableau, shape: Shape = CORES) -> Kernels:
    """Write the functions of a batch."""
    field, observe, summarise, instants, motion, followed = equations
    types = list(map(type_of, field.operands[1 + equations.states :]))
    observed, found = (sum(map(prod, function.shapes)) for function in (observe, summarise))
    sampled = equations.sampled if shape.width > 1 else []
    counts = len(types), len(sampled), observed, instants, found
    at = layout(shape, motion, equations.states, *counts, followed.seen, len(followed.begin))
    module = Module(shape)
    prepare, rates = Code(module, "prepare"), Code(module, "field", rows=3)
    look = Code(module, "look")
    emitter = Emitter(prepare, at.kept)
    numbers = [emitter.given(at.given + i, type_) for i, type_ in enumerate(types)]
    _write_field(rates, field, emitter, numbers, at)
    seen, see = _at_instant(look, equations.states, table, at), None
    if sampled:
        see = Code(module, "see", flags=())
        _write_look(look, [seen[i] for i in sampled], at)
        _write_see(see, observe, emitter, numbers, sampled, at)
    else:
        _write_look(look, emitter.body(look, observe, [*map(Atom, seen), *numbers]), at)
    at = at._replace(end=at.kept + emitter.keep())
    prepare.end()
    summary, over = write_summary(module, summarise, observe.shapes, at)
    begin = _write_begin(Code(module, "begin"), prepare, rates, at)
    step = _write_step(Code(module, "step"), rates, equations.coupled, table, at)
    follow = None
    if followed.follow is not None:
        follow = _write_following(Code(module, "follow"), followed.follow, emitter, at)
    accept = _write_acceptance(Code(module, "accept"), at)
    functions = _Functions(begin, step, look, follow, accept, see, summary)
    _Loop(Code(module, "advance", flags=()), at, functions, followed.begin).write()
    return Kernels(str(module), at, over)


def _write_field(
    code: Code, field: Verified, emitter: Emitter, numbers: list[Atom], at: Layout
) -> None:
    """Write the rates of the rows of a time and of states, and what is followed there."""
    time, y, rate = code.rows
    states = [Atom(code.read(y + i)) for i in range(at.states)]
    results = emitter.body(code, field, [Atom(code.read(time)), *states, *numbers])
    for i, result in enumerate(results[: at.states]):
        code.write(result, rate + i)
    for i, result in enumerate(results[at.states :]):
        code.write(result, at.ahead + i)
    code.end()


def _at_instant(code: Code, states: int, table: Tableau, at: Layout) -> list[Expression]:
    """Write the time of the instants that are due, and the states then, between the step's ends."""
    due, time, step = code.read(row.DUE), code.read(row.TIME), code.read(row.STEP)
    share = (due - time) / step
    weights = [
        step * share * (d[0] + share * (d[1] + share * (d[2] + share * d[3]))) for d in table.dense
    ]

    def state(i: int) -> Expression:
        rates = (code.read(at.k + stage * states + i) for stage in range(STAGES))
        changes = [weight * rate for weight, rate in zip(weights, rates, strict=True)]
        return code.read(at.y + i) + reduce(operator.add, changes)

    # LLVM leaves out the states that do not matter.
    return [due, *map(state, range(states))]


def _write_look(code: Code, values: Iterable[Any], at: Layout) -> None:
    """Write what lanes keep of the instants that are due."""
    for i, value in enumerate(values):
        code.write(value, at.seen + i)
    code.end()


def _write_see(
    code: Code,
    observe: Verified,
    emitter: Emitter,
    numbers: list[Atom],
    sampled: list[int],
    at: Layout,
) -> None:
    """Write what is observed at all instants of the first lane's segment, from its samples."""
    (memory, _, samples, pages), series = arrays_of_lanes(code, at), at.series * at.shape.lanes

    with code.each(0, at.instants, at.shape.width) as instant:
        operands = [Atom(code.vector(0.0)) for _ in range(1 + at.states)]
        for place, i in enumerate(sampled):
            operands[i] = Atom(samples.vector(code.first, instant + place * series))
        values = emitter.body(
            code, observe, [*operands, *numbers], lambda i: code.alike(memory[i, code.first])
        )
        for i, value in enumerate(values):
            pages[0, instant + i * series] = code.vector(value)
    code.end()


def _write_begin(code: Code, prepare: Code, field: Code, at: Layout) -> Code:
    """Write numbers and the first rates of new designs; other lanes keep theirs."""
    code.run(prepare)
    code.run(field, row.TIME, at.y, at.trial)
    fresh = code.read(row.FRESH) > 0
    for i in range(at.states):
        rate = where(fresh, code.read(at.trial + i), code.read(at.k + i))
        code.write(rate, at.k + i)
    for i in range(at.followed):
        code.write(where(fresh, code.read(at.ahead + i), code.read(at.now + i)), at.now + i)
    return code.end()


def _write_step(
    code: Code, field: Code, coupled: Sequence[int], table: Tableau, at: Layout
) -> Code:
    """Write one step of all lanes into `trial`, and what becomes of it.

    Rates depend on the `coupled` states.
    """
    time, step = code.read(row.TIME), code.read(row.STEP)
    y = [code.read(at.y + i) for i in range(at.states)]

    def combined(weights: np.ndarray, state: int) -> Expression:
        """Write the weighted sum of the rates so far."""
        terms = [
            weight * code.read(at.k + j * at.states + state)
            for j, weight in enumerate(weights)
            if weight != 0
        ]
        return reduce(operator.add, terms)

    for stage in range(1, STAGES):
        # The others, such as totals, are added up at the end of the step alone.
        for i in range(at.states) if stage == STAGES - 1 else coupled:
            change = combined(table.weights[stage, :stage], i)
            code.write(y[i] + step * change, at.trial + i)
        code.write(time + table.nodes[stage] * step, row.AT)
        code.run(field, row.AT, at.trial, at.k + stage * at.states)
    # Totals do not count, unless there is nothing else.
    count, squares = at.motion or at.states, code.vector(0.0)
    for i, before in enumerate(y[:count]):
        before, after = abs(before), abs(code.read(at.trial + i))
        size = where(after > before, after, before)
        error = step * combined(table.error, i) / (code.read(row.ATOL) + code.read(row.RTOL) * size)
        squares = squares + error * error
    _judge(code, squares / count)
    return code.end()


def _judge(code: Code, mean: Expression) -> None:
    """Keep or reject a step of this mean square of errors, and choose the size of the next."""
    # What is not finite is a huge error.
    mean = where(mean < HUGE, mean, HUGE)
    good = -0.5 * logarithm(where(mean > TINY, mean, TINY))
    change = exponential(code.read(row.THIS) * good + code.read(row.LAST) * code.read(row.MEMORY))
    safety, keep = code.read(row.SAFETY), mean < 1.0
    factor = safety * change
    least = where(keep, 1.0, code.read(row.LEAST))
    most = where(keep, code.read(row.LARGEST), safety)
    factor = where(factor < least, least, where(factor > most, most, factor))
    good = where(mean > TINY, good, 0.0)
    code.write(where(keep, good, code.read(row.MEMORY)), row.MEMORY)
    code.write(code.read(row.STEP) * factor, row.DT)
    code.write(where(keep, code.vector(1.0), 0.0), row.KEEP)


def _write_following(code: Code, follow: Verified, emitter: Emitter, at: Layout) -> Code:
    """Write what lanes keep of a step that is kept, and what they see from now on."""
    keep = code.read(row.KEEP) > 0
    now, ahead, before = (
        [code.read(first + i) for i in range(at.followed)]
        for first in (at.now, at.ahead, at.before + 1)
    )
    kept = [code.read(at.tally + i) for i in range(at.tallies)]
    times = [code.read(i) for i in (at.before, row.TIME, row.NEXT)]
    instants = zip(times, (before, now, ahead), strict=True)
    operands = [*kept, *(number for time, seen in instants for number in (time, *seen))]
    found = emitter.body(code, follow, list(map(Atom, operands)))

    def moved_on(first: int, new: Sequence[Any], old: Sequence[Any]) -> None:
        for i, (one, other) in enumerate(zip(new, old, strict=True)):
            code.write(where(keep, one, other), first + i)

    moved_on(at.tally, found, kept)
    moved_on(at.before, [times[1], *now], [times[0], *before])
    moved_on(at.now, ahead, now)
    return code.end()


def _write_acceptance(code: Code, at: Layout) -> Code:
    """Move on the lanes that keep their step, and say which are to be looked at."""
    keep, last = code.read(row.KEEP) > 0, at.k + (STAGES - 1) * at.states
    for i in range(at.states):
        code.write(where(keep, code.read(at.trial + i), code.read(at.y + i)), at.y + i)
        # The last stage is the first of the next step.
        code.write(where(keep, code.read(last + i), code.read(at.k + i)), at.k + i)
    time = where(keep, code.read(row.NEXT), code.read(row.TIME))
    end, size, count = code.read(row.END), code.read(row.DT), code.read(row.COUNT) + 1.0
    after = time + size
    # A step that was too long to keep must not be tried again.
    clipped = where(keep, end, time + 0.5 * (end - time))
    after = where(after > code.read(row.FLOOR), clipped, after)
    stuck = (size < code.read(row.SMALLEST)) | (count >= code.read(row.MOST))
    code.write(time, row.TIME)
    code.write(after, row.NEXT)
    code.write(after - time, row.STEP)
    code.write(count, row.COUNT)
    code.write(where((time >= end) | stuck, code.vector(1.0), 0.0), row.LOOK)
    return code.end()


def _array(code: Code, name: str, *lengths: Any) -> Array:
    return code.array(FIELDS.index(name), INTEGER if name in WHOLE else DOUBLE, *lengths)


def arrays_of_lanes(code: Code, at: Layout) -> Lanes:
    """Find the lanes' own arrays in the table of a function."""
    shapes = lane_shapes(at)
    return Lanes(*(_array(code, x, getattr(shapes, x)[1]) for x in Lanes._fields))


class _Functions(NamedTuple):
    """What the loop calls: functions of vectors of lanes, and `summarise` of a page."""

    begin: Code
    step: Code
    look: Code
    follow: Code | None
    accept: Code
    see: Code | None
    summarise: Code


class _Loop:
    """Writes `advance`, the loop over steps of a table of addresses and its first lane.

    It goes on until nothing is left, or `stop` is set.
    """

    def __init__(
        self, code: Code, at: Layout, functions: _Functions, begin: tuple[float, ...]
    ) -> None:
        self._code, self._at, self._functions, self._begin = code, at, functions, begin
        counts = _array(code, "counts")
        self._designs, self._segments = counts[0], counts[1]
        lengths: dict[str, tuple[Any, ...]] = {
            "starts": (at.states,),
            "numbers": (at.numbers,),
            "tolerances": (2,),
            "floors": (self._segments,),
            "found": (self._segments, at.found),
        }
        self._lanes = arrays_of_lanes(code, at)
        self._shared = Shared(*(_array(code, x, *lengths.get(x, ())) for x in Shared._fields))

    def write(self) -> None:
        """Write the loop: designs into lanes, steps, and segments that have come to their ends."""
        code, stop = self._code, self._shared.stop
        live = code.variable(code.number(1))
        with code.each_lane() as lane:
            self._arrive(lane)
        with code.repeat(lambda: (live[0] > 0) & (stop.now(0) == 0)):
            self._refill(live)
            with code.repeat(lambda: (live[0] > 0) & (stop.now(0) == 0) & ~self._is_any(row.LOOK)):
                self._run(self._functions.step)
                with code.each_vector() as first:
                    self._observe(first)
                if self._functions.follow is not None:
                    self._run(self._functions.follow)
                self._run(self._functions.accept)
            with code.each_lane() as lane, code.when(self._lanes.memory[row.LOOK, lane] > 0):
                self._end_segment(lane)
        code.end(by_name=True)

    def _arrive(self, lane: Expression) -> None:
        """Make a lane without a design, of memory that holds anything."""
        code, at, (memory, whole, samples, pages) = self._code, self._at, self._lanes
        with code.each(0, at.end) as i:
            memory[i, lane] = 0.0
        for i in range(row.CONTROLS):
            memory[row.THIS + i, lane] = self._shared.limits[3 + i]
        # Lanes without a design divide by them too.
        for clock in (row.ATOL, row.RTOL):
            memory[clock, lane] = 1.0
        for i in range(row.WHOLES):
            whole[i, lane] = row.WANTED if i == row.DESIGN else 0
        with code.each(0, lane_shapes(at).samples[1]) as i:
            samples[lane, i] = math.nan
        with code.each(0, at.page * at.shape.lanes) as i:
            pages[self._page(lane), i] = math.nan

    def _page(self, lane: Expression) -> Expression:
        """Return the page of a lane: its own, or the only one."""
        return self._code.number(0) if self._at.sampled else lane

    def _run(self, function: Code) -> None:
        """Run a function for all lanes."""
        with self._code.each_vector() as first:
            self._code.run(function, memory=self._lanes.memory, first=first)

    def _is_any(self, clock: int) -> Expression:
        """Say whether a row of the clock says yes for a lane."""
        code, memory, shape = self._code, self._lanes.memory, self._at.shape
        firsts = (code.first + i for i in range(0, shape.own, shape.width))
        return code.any(reduce(operator.or_, (memory.vector(clock, i) > 0 for i in firsts)))

    def _observe(self, first: Expression) -> None:
        """Observe the instants that lanes have passed in their steps, from the first one on."""
        code, at, (memory, whole, samples, pages) = self._code, self._at, self._lanes
        kept, numbers = (samples, at.sampled) if at.sampled else (pages, at.observed)

        def due() -> Expression:
            keep, at, end = (memory.vector(i, first) for i in (row.KEEP, row.DUE, row.NEXT))
            return (keep > 0) & (at <= end)

        with code.repeat(lambda: code.any(due())):
            code.run(self._functions.look, memory=memory, first=first)
            with code.each_true(due()) as place:
                lane = first + place
                instant = whole[row.INSTANT, lane]
                with code.each(0, numbers) as i:
                    there = i * (at.series * at.shape.lanes) + instant
                    kept[lane, there] = memory[i + at.seen, lane]
                whole[row.INSTANT, lane] = instant + 1
                memory[row.DUE, lane] = math.inf
                with code.when(instant + 1 < at.instants):
                    following = whole[row.FIRST, lane] + instant + 1
                    memory[row.DUE, lane] = self._shared.times[following]

    def _end_segment(self, lane: Expression) -> None:
        """Hand over the segment of a lane that has come to its end, or that goes no further."""
        code, shared, (memory, whole, *_) = self._code, self._shared, self._lanes
        states = range(self._at.y, self._at.trial)
        finite = reduce(operator.and_, (abs(memory[i, lane]) < math.inf for i in states))
        result = where(finite, code.number(row.SUCCESS), row.NOT_FINITE)
        early = memory[row.TIME, lane] < memory[row.END, lane]
        result = where(early, code.number(row.TOO_MANY_STEPS), result)
        stuck = memory[row.DT, lane] < memory[row.SMALLEST, lane]
        result = where(stuck, code.number(row.STEP_TOO_SMALL), result)
        self._summarise(lane, result == row.SUCCESS)
        design = whole[row.DESIGN, lane]
        taken = Expression(code, code.builder.fptosi(memory[row.COUNT, lane].value, INTEGER))
        whole[row.STEPS, lane] = whole[row.STEPS, lane] + taken
        whole[row.SEGMENT, lane] = whole[row.SEGMENT, lane] + 1
        goes_on = (result == row.SUCCESS) & (whole[row.SEGMENT, lane] < self._segments)
        with code.either(goes_on) as (then, otherwise):
            with then:
                self._begin_segment(lane)
            with otherwise:
                shared.result[design] = result
                shared.reached[design] = memory[row.TIME, lane]
                shared.steps[design] = whole[row.STEPS, lane]
                with code.when(whole[row.SEGMENT, lane] < self._segments):
                    self._leave_out(lane, design, whole[row.SEGMENT, lane])
                whole[row.DESIGN, lane] = row.WANTED

    def _summarise(self, lane: Expression, success: Expression) -> None:
        """Reduce a segment's page; from a failure on it is NaN."""
        code, at, (memory, whole, _, pages) = self._code, self._at, self._lanes
        lanes, page = at.shape.lanes, self._page(lane)
        if self._functions.see is not None:
            code.run(self._functions.see, first=lane)
        ends = (*range(at.y, at.trial), *range(at.tally, at.kept))
        for i, number in enumerate(ends):
            end = where(success, memory[number, lane], math.nan)
            pages[page, (at.last + i) * lanes] = end
        with code.when(~success), code.each(0, at.observed) as i:
            with code.each(whole[row.INSTANT, lane], at.instants) as instant:
                pages[page, i * (at.series * lanes) + instant] = math.nan
        code.run(self._functions.summarise, page * at.page, memory=pages, first=0)
        self._hand_over(lane, whole[row.DESIGN, lane], whole[row.SEGMENT, lane])

    def _leave_out(self, lane: Expression, design: Expression, first: Expression) -> None:
        """Summarise a design's segments that it does not reach: all that is seen there is NaN."""
        code, at, pages, page = self._code, self._at, self._lanes.pages, self._page(lane)
        with code.each(0, at.summary * at.shape.lanes) as i:
            pages[page, i] = math.nan
        code.run(self._functions.summarise, page * at.page, memory=pages, first=0)
        with code.each(first, self._segments) as segment:
            self._hand_over(lane, design, segment)

    def _hand_over(self, lane: Expression, design: Expression, segment: Expression) -> None:
        """Write the summary that stands in a lane's page to the results."""
        at, page = self._at, self._page(lane)
        with self._code.each(0, at.found) as i:
            value = self._lanes.pages[page, i + at.summary * at.shape.lanes]
            self._shared.found[design, segment, i] = value

    def _begin_segment(self, lane: Expression) -> None:
        """Start a lane's segment: totals of zero, the first step anew."""
        at, shared, (memory, whole, *_) = self._at, self._shared, self._lanes
        segment, schedule = whole[row.SEGMENT, lane], shared.schedule[whole[row.DESIGN, lane]]
        first = (schedule * self._segments + segment) * at.instants
        whole[row.INSTANT, lane] = 0
        whole[row.FIRST, lane] = first
        for i in range(at.y + at.motion, at.trial):
            memory[i, lane] = 0.0
        for i, number in enumerate(self._begin, at.tally):
            memory[i, lane] = number
        # There is no step before.
        memory[at.before, lane] = memory[row.TIME, lane]
        end = shared.times[first + (at.instants - 1)]
        after = memory[row.TIME, lane] + shared.limits[0]
        memory[row.NEXT, lane] = where(after < end, after, end)
        memory[row.STEP, lane] = memory[row.NEXT, lane] - memory[row.TIME, lane]
        memory[row.DUE, lane] = shared.times[first]
        memory[row.END, lane] = end
        memory[row.FLOOR, lane] = shared.floors[schedule, segment]
        memory[row.MEMORY, lane] = 0.0
        memory[row.COUNT, lane] = 0.0

    def _refill(self, live: Array) -> None:
        """Give a design to every lane without one, as far as there are; count those with one."""
        code, (memory, whole, *_) = self._code, self._lanes
        live[0] = 0
        with code.each_lane() as lane:
            memory[row.FRESH, lane] = 0.0
            memory[row.LOOK, lane] = 0.0
            with code.repeat(lambda: whole[row.DESIGN, lane] == row.WANTED):
                design = self._shared.next_design.take(0)
                with code.either(design < self._designs) as (then, otherwise):
                    with then:
                        self._start(lane, design)
                    with otherwise:
                        self._stand_still(lane)
            with code.when(whole[row.DESIGN, lane] >= 0):
                live[0] = live[0] + 1
        with code.when(self._is_any(row.FRESH)):
            self._run(self._functions.begin)

    def _start(self, lane: Expression, design: Expression) -> None:
        """Put a design into a lane, if its state is finite."""
        code, at, shared, (memory, whole, *_) = self._code, self._at, self._shared, self._lanes
        states = (abs(shared.starts[design, i]) < math.inf for i in range(at.states))
        with code.either(reduce(operator.and_, states)) as (then, otherwise):
            with then:
                whole[row.DESIGN, lane] = design
                whole[row.SEGMENT, lane] = 0
                whole[row.STEPS, lane] = 0
                with code.each(0, at.states) as i:
                    memory[i + at.y, lane] = shared.starts[design, i]
                with code.each(0, at.numbers) as i:
                    memory[i + at.given, lane] = shared.numbers[design, i]
                memory[row.TIME, lane] = 0.0
                memory[row.FRESH, lane] = 1.0
                memory[row.ATOL, lane] = shared.tolerances[design, 0]
                memory[row.RTOL, lane] = shared.tolerances[design, 1]
                memory[row.SMALLEST, lane] = shared.limits[1]
                memory[row.MOST, lane] = shared.limits[2]
                self._begin_segment(lane)
            with otherwise:
                shared.result[design] = row.NOT_FINITE
                shared.reached[design] = 0.0
                shared.steps[design] = 0
                self._leave_out(lane, design, code.number(0))

    def _stand_still(self, lane: Expression) -> None:
        """Let a lane without a design take steps of zero, and never be looked at."""
        memory = self._lanes.memory
        self._lanes.whole[row.DESIGN, lane] = row.NONE_LEFT
        memory[row.STEP, lane] = 0.0
        memory[row.NEXT, lane] = memory[row.TIME, lane]
        for clock in (row.END, row.FLOOR, row.DUE, row.MOST):
            memory[clock, lane] = math.inf
        memory[row.SMALLEST, lane] = -1.0
