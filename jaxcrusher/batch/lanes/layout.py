"""What a batch is made of: designs, lanes, and the places where results go.

Numbers of a lane stand at [row * LANES + lane] of flat arrays: with known distances between them
LLVM makes vector instructions of every loop over lanes.
"""

from typing import NamedTuple

import numpy as np

# Eight lanes are unrolled by LLVM to scalar code, sixteen become vector instructions.
LANES = 16
# Stages of the Runge-Kutta methods, the last of which is the first of the next step.
STAGES = 7
# Rows of the clock. The step ends at NEXT; MEMORY is the logarithm of one over the last error; what
# is later than FLOOR is at END; KEEP and LOOK are 1 for yes; the interpolation's WEIGHTS come last.
TIME, NEXT, STEP, AT, DUE, KEEP, LOOK, SQUARES = (row * LANES for row in range(8))
MEMORY, END, FLOOR, DT, SMALLEST, COUNT, MOST, WEIGHTS = (row * LANES for row in range(8, 16))
CLOCK = WEIGHTS + STAGES * LANES
# Rows of whole numbers: design (-1: none), segment, next instant, row, steps so far, instants held
# back, and whether the design is new.
DESIGN, SEGMENT, INSTANT, ROW, STEPS, HELD, FRESH = range(7)
# Instants held back by a lane until it has so many: then all lanes observe side by side.
DEPTH = 8
# States of a row, and how a design ended.
FREE, IN_USE, DONE = range(3)
SUCCESS, TOO_MANY_STEPS, STEP_TOO_SMALL, NOT_FINITE = range(4)


class Sizes(NamedTuple):
    """How many of what a design has."""

    motion: int  # states of the motion, which come first
    states: int  # with the totals
    numbers: int
    kept: int  # numbers prepared from them
    observed: int


class Designs(NamedTuple):
    """What is to be integrated: from `starts` through segments that end at their last instant."""

    starts: np.ndarray  # (designs, states)
    numbers: np.ndarray  # (designs, numbers)
    tolerances: np.ndarray  # (designs, 2): absolute and relative
    times: np.ndarray  # (schedules, segments, instants)
    floors: np.ndarray  # (schedules, segments): what is later is at the end
    schedule: np.ndarray  # (designs,): each one's row of both


class Method(NamedTuple):
    """An explicit Runge-Kutta method, diffrax's PI controller, and the limits of steps."""

    nodes: np.ndarray  # (STAGES,)
    weights: np.ndarray  # (STAGES, STAGES): of the stages before
    error: np.ndarray  # (STAGES,)
    # At a share s of the step, stage j of the solution has the weight sum_p dense[j, p] s^(p + 1).
    dense: np.ndarray  # (STAGES, 4)
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


class Rows(NamedTuple):
    """Segments: what was seen at their instants, and the state at their end."""

    state: np.ndarray  # (rows,): FREE, IN_USE or DONE
    design: np.ndarray  # (rows,)
    segment: np.ndarray  # (rows,)
    seen: np.ndarray  # (rows, instants and a few more, observed)
    last: np.ndarray  # (rows, states)


class Batch(NamedTuple):
    """All that threads share, and the rows of one of them."""

    sizes: Sizes
    designs: Designs
    method: Method
    ends: Ends
    next_design: np.ndarray  # (1,)
    stop: np.ndarray  # (1,): not 0 to end early
    rows: Rows


class Lanes(NamedTuple):
    """Where the lanes are."""

    whole: np.ndarray  # (rows of whole numbers, LANES)
    clock: np.ndarray  # (CLOCK,)
    y: np.ndarray  # (states * LANES,)
    k: np.ndarray  # (STAGES, states * LANES): rates of the stages
    trial: np.ndarray  # as y; so are the next four
    wide: np.ndarray  # a row of the clock, repeated for every state
    change: np.ndarray
    atol: np.ndarray
    rtol: np.ndarray
    given: np.ndarray  # (numbers * LANES,)
    kept: np.ndarray  # (kept * LANES,)
    scratch: np.ndarray  # as the longer of kept and y
    held: np.ndarray  # (DEPTH, (1 + states) * LANES): instants and their states
    held_for: np.ndarray  # (DEPTH, 2, LANES): their row and place in it
    seen: np.ndarray  # (observed * LANES,)


def new_lanes(sizes: Sizes) -> Lanes:
    """Lanes without a design."""
    whole = np.zeros((7, LANES), np.int64)
    whole[DESIGN] = -1
    width = sizes.states * LANES
    return Lanes(
        whole,
        np.zeros(CLOCK),
        y=np.zeros(width),
        k=np.zeros((STAGES, width)),
        trial=np.zeros(width),
        wide=np.zeros(width),
        change=np.zeros(width),
        # Lanes without a design divide by them too.
        atol=np.ones(width),
        rtol=np.ones(width),
        given=np.zeros(sizes.numbers * LANES),
        kept=np.zeros(sizes.kept * LANES),
        scratch=np.zeros(max(sizes.kept, sizes.states) * LANES),
        held=np.zeros((DEPTH, (1 + sizes.states) * LANES)),
        held_for=np.zeros((DEPTH, 2, LANES), np.int64),
        seen=np.zeros(sizes.observed * LANES),
    )


def new_rows(count: int, sizes: Sizes, instants: int) -> Rows:
    """Rows that are free."""
    state, design, segment = np.zeros((3, count), np.int64)
    # A few instants more than are used: rows a power of 2 apart would all meet in one set of the
    # processor's cache.
    seen = np.full((count, instants + 8, sizes.observed), np.nan)
    return Rows(state, design, segment, seen, np.full((count, sizes.states), np.nan))
