"""The memory of a batch: where things stand in the rows of lanes, and in tables of addresses.

All numbers of the lanes stand in one memory, a row of all lanes for each.

The observations along a segment stand in a page. On a GPU every lane has a page, and observes in
its steps. On a processor a lane keeps samples, its states at the instants. At the end of a segment
it observes a vector of instants at a time in the thread's only page. The summary uses the page.
"""

from typing import Any, NamedTuple

import numpy as np

from jaxcrusher.lanes.code import Shape

# Stages of the Runge-Kutta methods, the last of which is the first of the next step.
STAGES = 7
# Rows of the clock. The step ends at NEXT, an instant is DUE; MEMORY is the logarithm of one over
# the last error; what is later than FLOOR is at END; KEEP, LOOK and FRESH are 1 for yes: a step
# that is kept, a lane to be looked at, a design that is new.
TIME, NEXT, STEP, AT, DUE, KEEP, LOOK, FRESH = range(8)
MEMORY, END, FLOOR, DT, SMALLEST, COUNT, MOST, ATOL, RTOL = range(8, 17)
# Rows of the method's numbers, the same in all lanes.
THIS, LAST, SAFETY, LEAST, LARGEST = range(17, 22)
CONTROLS, CLOCK = 5, 22
# Whole numbers of a lane: design, segment, instants seen, steps in earlier segments, and
# where the segment's instants begin.
DESIGN, SEGMENT, INSTANT, STEPS, FIRST = range(5)
WHOLES = 5
# In place of a design.
WANTED, NONE_LEFT = -1, -2
# How a design ended.
SUCCESS, TOO_MANY_STEPS, STEP_TOO_SMALL, NOT_FINITE = range(4)


class Layout(NamedTuple):
    """How many numbers a design has, and the first row of each group of numbers."""

    shape: Shape
    motion: int  # states of the motion, which come first
    states: int  # with the totals
    numbers: int
    sampled: int  # times and states that a lane keeps at each instant; 0: it observes at once
    observed: int
    instants: int  # of a segment
    found: int  # numbers of a segment's summary
    followed: int  # numbers that are seen at the ends of steps
    tallies: int  # that are kept of them
    # Rows of the memory, behind the clock.
    y: int
    trial: int
    k: int  # rates of the stages
    given: int  # numbers of the design
    seen: int  # a sample, or what is observed
    ahead: int  # what is followed, where rates were computed last
    now: int  # the same at the start of the step
    before: int  # time, and the same, at the start of the step before
    tally: int  # what is kept of it
    kept: int  # what is computed once a design
    end: int
    # Rows of a page: what was observed at a segment's instants, states and what is kept at its end,
    # its summary.
    series: int  # of everything that is observed, one more than it fills
    last: int  # the first of the states, a row for each, and what is kept behind them
    summary: int
    page: int  # its end


def layout(
    shape: Shape,
    motion: int,
    states: int,
    numbers: int,
    sampled: int,
    observed: int,
    instants: int,
    found: int,
    followed: int = 0,
    tallies: int = 0,
) -> Layout:
    """Put the groups one after the other; no values of the design are kept yet."""
    lengths = (states, states, STAGES * states, numbers, sampled or observed)
    lengths += (followed, followed, 1 + followed, tallies, 0)
    rows = (CLOCK + sum(lengths[:i]) for i in range(len(lengths) + 1))
    # Rows a power of 2 apart would all meet in one set of the processor's cache.
    series = -(-instants // shape.lanes) + 1
    last = observed * series
    # Behind the summary is room for what a whole vector writes.
    summary = last + states + tallies
    page = (series, last, summary, summary + -(-found // shape.lanes) + 1)
    counts = (motion, states, numbers, sampled, observed, instants, found, followed, tallies)
    return Layout._make((shape, *counts, *rows, *page))


class Designs(NamedTuple):
    """Designs to be integrated from `starts` through segments that end at their last instant."""

    starts: np.ndarray  # (designs, states)
    numbers: np.ndarray  # (designs, numbers)
    tolerances: np.ndarray  # (designs, 2): absolute and relative
    times: np.ndarray  # (schedules * segments * instants,)
    floors: np.ndarray  # (schedules, segments): what is later is at the end
    schedule: np.ndarray  # (designs,): each one's row of both


class Control(NamedTuple):
    """The limits of steps, and diffrax's PI controller: the `limits` that all threads read."""

    first: float  # step
    smallest: float  # step
    steps: float  # in a segment
    this: float  # exponent of one over this error
    last: float  # exponent of one over the last error
    safety: float
    least: float  # factor of a rejected step
    most: float  # factor of a step that was kept


class Lanes(NamedTuple):
    """A thread's own arrays; in its code, the arrays at their addresses."""

    memory: Any  # (rows, lanes)
    whole: Any  # (5, lanes): whole numbers
    samples: Any  # (lanes, numbers): series of them
    pages: Any  # (1 or lanes, numbers): of the segments that they are in


class Shared(NamedTuple):
    """Arrays that all threads read and write; in their code, the arrays at the addresses."""

    # See `Designs`.
    starts: Any
    numbers: Any
    tolerances: Any
    times: Any
    floors: Any
    schedule: Any
    limits: Any  # a `Control`
    counts: Any  # of designs and segments
    # See `WRITTEN`.
    found: Any  # (designs, segments, numbers): their summaries
    # How each design ended: code, time and steps.
    result: Any
    reached: Any
    steps: Any
    next_design: Any  # (1,)
    stop: Any  # (1,): not 0 to end early


# What is written of each design.
WRITTEN = ("found", "result", "reached", "steps")
# The fields of a table, in their order, and those of whole numbers.
FIELDS = Lanes._fields + Shared._fields
WHOLE = {"whole", "schedule", "counts", "result", "steps", "next_design", "stop"}


def table(lanes: Lanes, shared: Shared) -> np.ndarray:
    """List the addresses of arrays one after the other; it is valid as long as they are."""
    for name, array in zip(FIELDS, (*lanes, *shared), strict=True):
        kind = np.int64 if name in WHOLE else np.float64
        assert array.dtype == kind and array.flags.c_contiguous, name
    return np.array([array.ctypes.data for array in (*lanes, *shared)], np.uintp)


def lane_shapes(at: Layout) -> Lanes:
    """Return the shapes of a thread's own arrays, or of a warp's."""
    lanes = at.shape.lanes
    samples = (lanes, at.sampled * at.series * lanes)
    pages = (1 if at.sampled else lanes, at.page * lanes)
    return Lanes((at.end, lanes), (WHOLES, lanes), samples, pages)
