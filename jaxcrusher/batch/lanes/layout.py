"""What a batch is made of: designs, lanes, and the places where results go.

All numbers of the lanes stand in one memory, a row of all lanes for each.
"""

from typing import Any, NamedTuple

import numpy as np

# Stages of the Runge-Kutta methods, the last of which is the first of the next step.
STAGES = 7
# Rows of the clock. The step ends at NEXT, an instant is DUE; MEMORY is the logarithm of one over
# the last error; what is later than FLOOR is at END; KEEP, LOOK and FRESH are 1 for yes: a step
# that is kept, a lane to be looked at, a design that is new.
TIME, NEXT, STEP, AT, DUE, KEEP, LOOK, FRESH = range(8)
MEMORY, END, FLOOR, DT, SMALLEST, COUNT, MOST, ATOL, RTOL = range(8, 17)
# Of the method, the same in all lanes.
THIS, LAST, SAFETY, LEAST, LARGEST = range(17, 22)
CLOCK = 22
# Whole numbers of a lane: design, segment, instants seen, steps in earlier segments, and
# where the segment's instants begin.
DESIGN, SEGMENT, INSTANT, STEPS, FIRST = range(5)
# In place of a design.
WANTED, NONE_LEFT = -1, -2
# How a design ended.
SUCCESS, TOO_MANY_STEPS, STEP_TOO_SMALL, NOT_FINITE = range(4)


class Sizes(NamedTuple):
    """How many of what a design has."""

    motion: int  # states of the motion, which come first
    states: int  # with the totals
    numbers: int
    observed: int
    kept: int = 0  # numbers prepared from them


class Places(NamedTuple):
    """The first rows of what has several."""

    y: int
    trial: int
    k: int  # rates of the stages
    given: int
    seen: int
    kept: int
    end: int


def places(sizes: Sizes) -> Places:
    """One after the other, behind the clock."""
    lengths = (
        sizes.states,
        sizes.states,
        STAGES * sizes.states,
        sizes.numbers,
        sizes.observed,
        sizes.kept,
    )
    return Places(*(CLOCK + sum(lengths[:i]) for i in range(len(lengths) + 1)))


class Page(NamedTuple):
    """The rows of a segment: what was seen at its instants, states at its end, and its summary."""

    series: int  # of everything that is observed, one more than it fills
    last: int  # the first of the states, a row for each
    found: int  # where the summary begins
    end: int


def page_of(observed: int, instants: int, states: int, found: int, lanes: int) -> Page:
    """One after the other; behind the summary is room for what a whole vector writes."""
    # Rows a power of 2 apart would all meet in one set of the processor's cache.
    series = -(-instants // lanes) + 1
    last = observed * series
    return Page(series, last, last + states, last + states + -(-found // lanes) + 1)


class Designs(NamedTuple):
    """What is to be integrated: from `starts` through segments that end at their last instant."""

    starts: np.ndarray  # (designs, states)
    numbers: np.ndarray  # (designs, numbers)
    tolerances: np.ndarray  # (designs, 2): absolute and relative
    times: np.ndarray  # (schedules * segments * instants,)
    floors: np.ndarray  # (schedules, segments): what is later is at the end
    schedule: np.ndarray  # (designs,): each one's row of both


class Tableau(NamedTuple):
    """An explicit Runge-Kutta method."""

    nodes: np.ndarray  # (STAGES,)
    weights: np.ndarray  # (STAGES, STAGES): of the stages before
    error: np.ndarray  # (STAGES,)
    # At a share s of the step, stage j of the solution has the weight sum_p dense[j, p] s^(p + 1).
    dense: np.ndarray  # (STAGES, 4)


class Control(NamedTuple):
    """Diffrax's PI controller, and the limits of steps."""

    this: float  # exponent of one over this error
    last: float  # exponent of one over the last error
    safety: float
    least: float  # factor of a rejected step
    most: float  # factor of a step that was kept
    smallest: float  # step
    first: float  # step
    steps: float  # in a segment


class Ends(NamedTuple):
    """How each design ended."""

    result: np.ndarray
    reached: np.ndarray
    steps: np.ndarray


class Lanes(NamedTuple):
    """What a thread has to itself: arrays, and in its code what is at their addresses."""

    memory: Any  # (rows, lanes)
    whole: Any  # (5, lanes): whole numbers
    pages: Any  # (lanes, numbers): of the segments that they are in


class Shared(NamedTuple):
    """What all threads read and write, alike."""

    # See `Designs`.
    starts: Any
    numbers: Any
    tolerances: Any
    times: Any
    floors: Any
    schedule: Any
    limits: Any  # first step, smallest step, steps in a segment
    counts: Any  # of designs and segments
    found: Any  # (designs, segments, numbers): their summaries
    # See `Ends`.
    result: Any
    reached: Any
    steps: Any
    next_design: Any  # (1,)
    stop: Any  # (1,): not 0 to end early


# Those of whole numbers.
WHOLE = {"whole", "schedule", "counts", "result", "steps", "next_design", "stop"}


# The fields of a table, in their order.
FIELDS = Lanes._fields + Shared._fields


def table(lanes: Lanes, shared: Shared) -> np.ndarray:
    """Their addresses, one after the other; valid as long as they are."""
    for name, array in zip(FIELDS, (*lanes, *shared), strict=True):
        kind = np.int64 if name in WHOLE else np.float64
        assert array.dtype == kind and array.flags.c_contiguous, name
    return np.array([array.ctypes.data for array in (*lanes, *shared)], np.uintp)


def new_lanes(sizes: Sizes, control: Control, page: Page, lanes: int) -> Lanes:
    """Lanes without a design."""
    whole = np.zeros((5, lanes), np.int64)
    whole[DESIGN] = WANTED
    memory = np.zeros((places(sizes).end, lanes))
    memory[THIS : LARGEST + 1] = np.array(control[:5])[:, None]
    # Lanes without a design divide by them too.
    memory[[ATOL, RTOL]] = 1.0
    return Lanes(memory, whole, np.full((lanes, page.end * lanes), np.nan))
