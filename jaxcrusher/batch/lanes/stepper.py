"""The loop over steps: designs into lanes, segments to their ends, instants to be observed.

Every lane has its own time, step and segment; a lane that has ended takes the next design, so none
waits for another. What all lanes do side by side are compiled functions of their memory (see
`kernels`); what is rare is done here, lane by lane. One compilation of this file serves them all.
"""

import math
from typing import Any

from numba import njit

from jaxcrusher.batch.lanes.instructions import call, take
from jaxcrusher.batch.lanes.layout import (
    ATOL,
    COUNT,
    DESIGN,
    DT,
    DUE,
    END,
    FIRST,
    FLOOR,
    FRESH,
    INSTANT,
    KEEP,
    LOOK,
    MEMORY,
    MOST,
    NEXT,
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
)
from jaxcrusher.batch.lanes.vector import LANES, WIDTH

# Functions that only compiled ones call: without what Python would need to call them, and without
# counts of references to arrays, which outlive every call.
WITHIN: dict[str, Any] = {
    "_nrt": False,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "no_rewrites": True,
}
within = njit(error_model="numpy", **WITHIN)


@njit(error_model="numpy", nogil=True, cache=True)
def advance(batch, lanes):
    """Go on until nothing is left, or `stop` is set."""
    functions, memory = batch.functions, lanes.memory
    while batch.stop[0] == 0 and refill(batch, lanes) > 0:
        looks = False
        while not looks and batch.stop[0] == 0:
            call(functions.step, memory, 0)
            for first in range(0, LANES, WIDTH):
                look(first, batch, lanes)
            call(functions.accept, memory, 0)
            for lane in range(LANES):
                looks |= memory[LOOK, lane] > 0.0
        for lane in range(LANES):
            if memory[LOOK, lane] > 0.0:
                end_segment(lane, batch, lanes)


@within
def look(first, batch, lanes):
    """Observe the instants that `WIDTH` lanes have passed in their steps."""
    memory, whole, at, times = lanes.memory, lanes.whole, batch.places, batch.designs.times
    series, due = batch.page.series * LANES, True
    while due:
        due = False
        for lane in range(first, first + WIDTH):
            due |= memory[KEEP, lane] > 0.0 and memory[DUE, lane] <= memory[NEXT, lane]
        if due:
            call(batch.functions.look, memory, first)
            for lane in range(first, first + WIDTH):
                if memory[KEEP, lane] > 0.0 and memory[DUE, lane] <= memory[NEXT, lane]:
                    instant = whole[INSTANT, lane]
                    for i in range(at.kept - at.seen):
                        lanes.pages[lane, i * series + instant] = memory[at.seen + i, lane]
                    instant += 1
                    whole[INSTANT, lane] = instant
                    more = instant < batch.instants
                    following = times[whole[FIRST, lane] + instant] if more else math.inf
                    memory[DUE, lane] = following


@within
def end_segment(lane, batch, lanes):
    """Hand over the segment of a lane that has come to its end, or that goes no further."""
    memory, whole, at = lanes.memory, lanes.whole, batch.places
    finite = True
    for i in range(at.y, at.trial):
        finite = finite and abs(memory[i, lane]) < math.inf
    if memory[DT, lane] < memory[SMALLEST, lane]:
        result = STEP_TOO_SMALL
    elif memory[TIME, lane] < memory[END, lane]:
        result = TOO_MANY_STEPS
    else:
        result = SUCCESS if finite else NOT_FINITE
    summarise(lane, result == SUCCESS, batch, lanes)
    design = whole[DESIGN, lane]
    whole[STEPS, lane] += int(memory[COUNT, lane])
    whole[SEGMENT, lane] += 1
    if result == SUCCESS and whole[SEGMENT, lane] < batch.found.shape[1]:
        begin_segment(lane, batch, lanes)
        return
    batch.ends.result[design] = result
    batch.ends.reached[design] = memory[TIME, lane]
    batch.ends.steps[design] = whole[STEPS, lane]
    whole[DESIGN, lane] = -1


@within
def summarise(lane, success, batch, lanes):
    """Reduce a segment's page; from a failure on it is NaN."""
    whole, page, series = lanes.whole, lanes.pages[lane], batch.page.series * LANES
    for i in range(batch.places.trial - batch.places.y):
        state = lanes.memory[batch.places.y + i, lane]
        page[(batch.page.last + i) * LANES] = state if success else math.nan
    if not success:
        for i in range(batch.places.kept - batch.places.seen):
            for instant in range(whole[INSTANT, lane], batch.instants):
                page[i * series + instant] = math.nan
    call(batch.functions.summarise, lanes.pages, lane * batch.page.end)
    found = batch.found[whole[DESIGN, lane], whole[SEGMENT, lane]]
    for i in range(found.size):
        found[i] = page[batch.page.found * LANES + i]


@within
def begin_segment(lane, batch, lanes):
    """Start a lane's segment: totals of zero, the first step anew."""
    memory, whole, designs, at = lanes.memory, lanes.whole, batch.designs, batch.places
    segment, schedule = whole[SEGMENT, lane], designs.schedule[whole[DESIGN, lane]]
    first = (schedule * batch.found.shape[1] + segment) * batch.instants
    whole[INSTANT, lane], whole[FIRST, lane] = 0, first
    for i in range(at.y + batch.motion, at.trial):
        memory[i, lane] = 0.0
    end = designs.times[first + batch.instants - 1]
    memory[NEXT, lane] = min(memory[TIME, lane] + batch.control.first, end)
    memory[STEP, lane] = memory[NEXT, lane] - memory[TIME, lane]
    memory[DUE, lane] = designs.times[first] if at.kept > at.seen else math.inf
    memory[END, lane], memory[FLOOR, lane] = end, designs.floors[schedule, segment]
    memory[MEMORY, lane] = memory[COUNT, lane] = 0.0


@within
def refill(batch, lanes):
    """Give a design to every lane without one, as far as there are; how many lanes have one."""
    memory, whole, starts = lanes.memory, lanes.whole, batch.designs.starts
    live = fresh = 0
    for lane in range(LANES):
        memory[FRESH, lane] = 0.0
        while whole[DESIGN, lane] < 0:
            design = take(batch.next_design)
            if design >= starts.shape[0]:
                stand_still(lane, memory)
                break
            finite = True
            for i in range(starts.shape[1]):
                finite = finite and abs(starts[design, i]) < math.inf
            if finite:
                start(lane, design, batch, lanes)
                fresh += 1
            else:
                batch.ends.result[design] = NOT_FINITE
        live += whole[DESIGN, lane] >= 0
    if fresh > 0:
        call(batch.functions.begin, memory, 0)
    return live


@within
def start(lane, design, batch, lanes):
    """Put a design into a lane."""
    memory, whole, designs, at = lanes.memory, lanes.whole, batch.designs, batch.places
    whole[DESIGN, lane], whole[SEGMENT, lane], whole[STEPS, lane] = design, 0, 0
    for i in range(designs.starts.shape[1]):
        memory[at.y + i, lane] = designs.starts[design, i]
    for i in range(designs.numbers.shape[1]):
        memory[at.given + i, lane] = designs.numbers[design, i]
    memory[TIME, lane], memory[FRESH, lane] = 0.0, 1.0
    memory[ATOL, lane] = designs.tolerances[design, 0]
    memory[RTOL, lane] = designs.tolerances[design, 1]
    memory[SMALLEST, lane] = batch.control.smallest
    memory[MOST, lane] = batch.control.steps
    begin_segment(lane, batch, lanes)


@within
def stand_still(lane, memory):
    """A lane without a design takes steps of zero, and is never looked at."""
    memory[STEP, lane] = 0.0
    memory[NEXT, lane] = memory[TIME, lane]
    memory[END, lane] = memory[FLOOR, lane] = memory[DUE, lane] = math.inf
    memory[SMALLEST, lane], memory[MOST, lane] = -1.0, math.inf
