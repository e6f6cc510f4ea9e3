"""The loop over steps: designs into lanes, segments to their ends, instants to be observed.

Every lane has its own time, step and segment; a lane that has ended takes the next design, so none
waits for another. What all lanes do side by side are functions of their memory (see `kernels`);
what is rare is done here, lane by lane.
"""

import math
import operator
from functools import reduce
from typing import Any, NamedTuple

from jaxcrusher.batch.lanes.expression import DOUBLE, INTEGER, Expression, where
from jaxcrusher.batch.lanes.layout import (
    ATOL,
    COUNT,
    DESIGN,
    DT,
    DUE,
    END,
    FIELDS,
    FIRST,
    FLOOR,
    FRESH,
    INSTANT,
    KEEP,
    LOOK,
    MEMORY,
    MOST,
    NEXT,
    NONE_LEFT,
    NOT_FINITE,
    RTOL,
    SEGMENT,
    SMALLEST,
    STEP,
    STEP_TOO_SMALL,
    STEPS,
    SUCCESS,
    TIME,
    TOO_MANY_STEPS,
    WANTED,
    WHOLE,
    Lanes,
    Page,
    Shared,
    Sizes,
    places,
)
from jaxcrusher.batch.lanes.routine import Array, Routine
from jaxcrusher.batch.lanes.vector import Code, Module


class Parts(NamedTuple):
    """Functions of `kernels`, of a vector of lanes each, and of a page."""

    begin: Code
    step: Code
    look: Code
    accept: Code
    summarise: Code


def write_loop(
    module: Module, parts: Parts, sizes: Sizes, page: Page, instants: int, found: int
) -> None:
    """The function `advance` of a table of addresses (see `layout.table`) and its first lane.

    It goes on until nothing is left, or `stop` is set.
    """
    loop = _Loop(module, parts, sizes, page, instants, found)
    f, stop = loop.f, loop.shared.stop
    live = f.variable(1)
    with f.repeat(lambda: (live[0] > 0) & (stop.now(0) == 0)):
        loop.refill(live)
        with f.repeat(lambda: (live[0] > 0) & (stop.now(0) == 0) & ~loop.is_any(LOOK)):
            loop.run(parts.step)
            with f.each_vector() as first:
                loop.observe(first)
            loop.run(parts.accept)
        with f.each_lane() as lane, f.when(loop.lanes.memory[LOOK, lane] > 0):
            loop.end_segment(lane)
    f.end(by_name=True)


class _Loop:
    """What the loop is written of; `f` is the function that is being written."""

    def __init__(
        self, module: Module, parts: Parts, sizes: Sizes, page: Page, instants: int, found: int
    ) -> None:
        self.f = Routine(module, "advance")
        lanes = module.shape.lanes
        self._parts, self._sizes, self._page, self._at = parts, sizes, page, places(sizes)
        self._instants, self._found = instants, found
        counts = self._array("counts")
        self._designs, self._segments = counts[0], counts[1]
        lengths: dict[str, tuple[Any, ...]] = {
            "memory": (lanes,),
            "whole": (lanes,),
            "pages": (page.end * lanes,),
            "starts": (sizes.states,),
            "numbers": (sizes.numbers,),
            "tolerances": (2,),
            "floors": (self._segments,),
            "found": (self._segments, found),
        }
        self.lanes = Lanes(*(self._array(x, *lengths[x]) for x in Lanes._fields))
        self.shared = Shared(*(self._array(x, *lengths.get(x, ())) for x in Shared._fields))

    def _array(self, name: str, *lengths: Any) -> Array:
        kind = INTEGER if name in WHOLE else DOUBLE
        return self.f.array(FIELDS.index(name), kind, *lengths)

    def run(self, part: Code) -> None:
        """Run a function for all lanes."""
        with self.f.each_vector() as first:
            self.f.run(part, self.lanes.memory, first)

    def is_any(self, row: int) -> Expression:
        """Whether a row of the clock says yes for a lane."""
        f, memory, shape = self.f, self.lanes.memory, self.f.shape
        firsts = range(0, shape.own, shape.width)
        return f.any(reduce(operator.or_, (memory.lanes(row, f.first + i) > 0 for i in firsts)))

    def observe(self, first: Expression) -> None:
        """Observe the instants that lanes have passed in their steps, from the first one on."""
        f, (memory, whole, pages) = self.f, self.lanes

        def due(row: Any) -> Expression:
            return (row(KEEP) > 0) & (row(DUE) <= row(NEXT))

        with f.repeat(lambda: f.any(due(lambda row: memory.lanes(row, first)))):
            f.run(self._parts.look, memory, first)
            with f.each(first, first + f.shape.width) as lane:
                with f.when(due(lambda row: memory[row, lane])):
                    instant = whole[INSTANT, lane]
                    with f.each(0, self._sizes.observed) as i:
                        place = i * (self._page.series * self.f.shape.lanes) + instant
                        pages[lane, place] = memory[i + self._at.seen, lane]
                    whole[INSTANT, lane] = instant + 1
                    memory[DUE, lane] = math.inf
                    with f.when(instant + 1 < self._instants):
                        following = whole[FIRST, lane] + instant + 1
                        memory[DUE, lane] = self.shared.times[following]

    def end_segment(self, lane: Expression) -> None:
        """Hand over the segment of a lane that has come to its end, or that goes no further."""
        f, a, (memory, whole, _) = self.f, self.shared, self.lanes
        rows = range(self._at.y, self._at.trial)
        finite = reduce(operator.and_, (abs(memory[i, lane]) < math.inf for i in rows))
        result = where(finite, f.number(SUCCESS), NOT_FINITE)
        result = where(memory[TIME, lane] < memory[END, lane], f.number(TOO_MANY_STEPS), result)
        stuck = memory[DT, lane] < memory[SMALLEST, lane]
        result = where(stuck, f.number(STEP_TOO_SMALL), result)
        self._summarise(lane, result == SUCCESS)
        design = whole[DESIGN, lane]
        whole[STEPS, lane] = whole[STEPS, lane] + f.whole(memory[COUNT, lane])
        whole[SEGMENT, lane] = whole[SEGMENT, lane] + 1
        goes_on = (result == SUCCESS) & (whole[SEGMENT, lane] < self._segments)
        with f.either(goes_on) as (then, otherwise):
            with then:
                self._begin_segment(lane)
            with otherwise:
                a.result[design] = result
                a.reached[design] = memory[TIME, lane]
                a.steps[design] = whole[STEPS, lane]
                whole[DESIGN, lane] = WANTED

    def _summarise(self, lane: Expression, success: Expression) -> None:
        """Reduce a segment's page; from a failure on it is NaN."""
        f, (memory, whole, pages) = self.f, self.lanes
        for i in range(self._sizes.states):
            state = memory[self._at.y + i, lane]
            pages[lane, (self._page.last + i) * self.f.shape.lanes] = where(
                success, state, math.nan
            )
        with f.when(~success), f.each(0, self._sizes.observed) as i:
            with f.each(whole[INSTANT, lane], self._instants) as instant:
                pages[lane, i * (self._page.series * self.f.shape.lanes) + instant] = math.nan
        f.run(self._parts.summarise, pages, 0, lane * self._page.end)
        with f.each(0, self._found) as i:
            number = pages[lane, i + self._page.found * self.f.shape.lanes]
            self.shared.found[whole[DESIGN, lane], whole[SEGMENT, lane], i] = number

    def _begin_segment(self, lane: Expression) -> None:
        """Start a lane's segment: totals of zero, the first step anew."""
        a, (memory, whole, _) = self.shared, self.lanes
        segment, schedule = whole[SEGMENT, lane], a.schedule[whole[DESIGN, lane]]
        first = (schedule * self._segments + segment) * self._instants
        whole[INSTANT, lane] = 0
        whole[FIRST, lane] = first
        for i in range(self._at.y + self._sizes.motion, self._at.trial):
            memory[i, lane] = 0.0
        end = a.times[first + (self._instants - 1)]
        after = memory[TIME, lane] + a.limits[0]
        memory[NEXT, lane] = where(after < end, after, end)
        memory[STEP, lane] = memory[NEXT, lane] - memory[TIME, lane]
        memory[DUE, lane] = a.times[first]
        memory[END, lane] = end
        memory[FLOOR, lane] = a.floors[schedule, segment]
        memory[MEMORY, lane] = 0.0
        memory[COUNT, lane] = 0.0

    def refill(self, live: Array) -> None:
        """Give a design to every lane without one, as far as there are; count those with one."""
        f, a, (memory, whole, _) = self.f, self.shared, self.lanes
        live[0] = 0
        with f.each_lane() as lane:
            memory[FRESH, lane] = 0.0
            memory[LOOK, lane] = 0.0
            with f.repeat(lambda: whole[DESIGN, lane] == WANTED):
                design = a.next_design.take(0)
                with f.either(design < self._designs) as (then, otherwise):
                    with then:
                        self._start(lane, design)
                    with otherwise:
                        self._stand_still(lane)
            with f.when(whole[DESIGN, lane] >= 0):
                live[0] = live[0] + 1
        with f.when(self.is_any(FRESH)):
            self.run(self._parts.begin)

    def _start(self, lane: Expression, design: Expression) -> None:
        """Put a design into a lane, if its state is finite."""
        f, a, (memory, whole, _) = self.f, self.shared, self.lanes
        states = (abs(a.starts[design, i]) < math.inf for i in range(self._sizes.states))
        with f.either(reduce(operator.and_, states)) as (then, otherwise):
            with then:
                whole[DESIGN, lane] = design
                whole[SEGMENT, lane] = 0
                whole[STEPS, lane] = 0
                with f.each(0, self._sizes.states) as i:
                    memory[i + self._at.y, lane] = a.starts[design, i]
                with f.each(0, self._sizes.numbers) as i:
                    memory[i + self._at.given, lane] = a.numbers[design, i]
                memory[TIME, lane] = 0.0
                memory[FRESH, lane] = 1.0
                memory[ATOL, lane] = a.tolerances[design, 0]
                memory[RTOL, lane] = a.tolerances[design, 1]
                memory[SMALLEST, lane] = a.limits[1]
                memory[MOST, lane] = a.limits[2]
                self._begin_segment(lane)
            with otherwise:
                a.result[design] = NOT_FINITE

    def _stand_still(self, lane: Expression) -> None:
        """A lane without a design takes steps of zero, and is never looked at."""
        memory = self.lanes.memory
        self.lanes.whole[DESIGN, lane] = NONE_LEFT
        memory[STEP, lane] = 0.0
        memory[NEXT, lane] = memory[TIME, lane]
        for row in (END, FLOOR, DUE, MOST):
            memory[row, lane] = math.inf
        memory[SMALLEST, lane] = -1.0
