"""The loop over steps: explicit Runge-Kutta under a PI controller, as diffrax has it, in lanes.

Every lane has its own time, step and segment; a lane that has ended takes the next design, so none
waits for another. What is rare, an instant to observe or the end of a segment, is done lane by
lane. The equations come as compiled functions of all lanes (see `source`), so that one compilation
of this file serves them all; it has no expressions of whole arrays, whose compilation takes long.
"""

import math

from numba import njit

from jaxcrusher.batch.lanes.elementary import exponential, logarithm
from jaxcrusher.batch.lanes.instructions import WITHIN, take
from jaxcrusher.batch.lanes.layout import (
    AT,
    COUNT,
    DEPTH,
    DESIGN,
    DONE,
    DT,
    DUE,
    END,
    FLOOR,
    FREE,
    FRESH,
    HELD,
    IN_USE,
    INSTANT,
    KEEP,
    LANES,
    LOOK,
    MEMORY,
    MOST,
    NEXT,
    NOT_FINITE,
    ROW,
    SEGMENT,
    SMALLEST,
    SQUARES,
    STAGES,
    STEP,
    STEP_TOO_SMALL,
    STEPS,
    SUCCESS,
    TIME,
    TOO_MANY_STEPS,
    WEIGHTS,
)

# Fast, but with NaN and infinity kept: a trial step may leave the linkage's reach.
FAST = {"reassoc", "contract", "arcp", "nsz"}
fast = njit(error_model="numpy", fastmath=FAST, **WITHIN)
# Bounds of the mean square of an error over the allowed one.
HUGE, TINY = 1e300, 1e-300


@njit(error_model="numpy", fastmath=FAST, nogil=True, cache=True)
def advance(prepare, field, observe, batch, lanes):
    """Go on until rows are to be taken away; False if nothing is left, or `stop` is set."""
    clock = lanes.clock
    looking = batch.sizes.observed > 0
    while batch.stop[0] == 0:
        if free(batch.rows) < LANES:
            flush(observe, batch, lanes)
            return True
        if refill(prepare, field, batch, lanes) == 0:
            flush(observe, batch, lanes)
            return False
        looks = 0.0
        while looks == 0.0 and batch.stop[0] == 0:
            attempt(field, batch.method, lanes)
            measure(batch, lanes)
            judge(clock, batch.method)
            if looking:
                while due(clock) > 0.0:
                    hold(observe, batch, lanes)
            looks = accept(lanes)
        for lane in range(LANES):
            if clock[LOOK + lane] > 0.0:
                end_segment(lane, observe, batch, lanes)
    return False


@fast
def free(rows):
    """The number of free rows."""
    count = 0
    for state in rows.state:
        count += state == FREE
    return count


@fast
def attempt(field, method, lanes):
    """One step of all lanes into `trial`, its stages into `k`."""
    clock, k = lanes.clock, lanes.k
    spread(clock[STEP : STEP + LANES], lanes.wide)
    for stage in range(1, STAGES):
        for lane in range(LANES):
            clock[AT + lane] = clock[TIME + lane] + method.nodes[stage] * clock[STEP + lane]
        combine(stage, method.weights[stage], k, lanes.wide, lanes.y, lanes.trial)
        field(clock[AT : AT + LANES], lanes.trial, lanes.kept, k[stage])


@fast
def spread(row, wide):
    """A row of the clock for every state."""
    for first in range(0, wide.size, LANES):
        for lane in range(LANES):
            wide[first + lane] = row[lane]


@fast
def combine(stages, w, k, step, y, found):
    """`found` = `y` + `step` times the weighted sum of the first `stages` rates, from 1 to 7.

    Written out: of a loop over stages inside LLVM makes no vector instructions, and one outside
    goes through memory.
    """
    k0, k1, k2, k3, k4, k5, k6 = k[0], k[1], k[2], k[3], k[4], k[5], k[6]
    w0, w1, w2, w3, w4, w5, w6 = w[0], w[1], w[2], w[3], w[4], w[5], w[6]
    size = y.size
    if stages == 1:
        for i in range(size):
            found[i] = y[i] + step[i] * (w0 * k0[i])
    elif stages == 2:
        for i in range(size):
            found[i] = y[i] + step[i] * (w0 * k0[i] + w1 * k1[i])
    elif stages == 3:
        for i in range(size):
            found[i] = y[i] + step[i] * (w0 * k0[i] + w1 * k1[i] + w2 * k2[i])
    else:
        for i in range(size):
            found[i] = y[i] + step[i] * (w0 * k0[i] + w1 * k1[i] + w2 * k2[i] + w3 * k3[i])
        if stages == 5:
            for i in range(size):
                found[i] += step[i] * (w4 * k4[i])
        elif stages == 6:
            for i in range(size):
                found[i] += step[i] * (w4 * k4[i] + w5 * k5[i])
        elif stages == 7:
            for i in range(size):
                found[i] += step[i] * (w4 * k4[i] + w5 * k5[i] + w6 * k6[i])


@fast
def measure(batch, lanes):
    """The mean squares of the errors over the allowed ones."""
    clock, y, trial, change = lanes.clock, lanes.y, lanes.trial, lanes.change
    for i in range(change.size):
        change[i] = 0.0
    combine(len(lanes.k), batch.method.error, lanes.k, lanes.wide, change, change)
    # Totals do not count, unless there is nothing else.
    count = batch.sizes.motion if batch.sizes.motion > 0 else batch.sizes.states
    for i in range(count * LANES):
        before, after = abs(y[i]), abs(trial[i])
        size = after if after > before else before
        error = change[i] / (lanes.atol[i] + lanes.rtol[i] * size)
        change[i] = error * error
    # Sums over the states before; the last one's are those over all.
    for i in range(LANES, count * LANES):
        change[i] += change[i - LANES]
    for lane in range(LANES):
        clock[SQUARES + lane] = change[(count - 1) * LANES + lane] / count


@fast
def judge(clock, method):
    """Keep or reject the step of every lane, and choose the size of the next."""
    for lane in range(LANES):
        # What is not finite is a huge error.
        mean = clock[SQUARES + lane] if clock[SQUARES + lane] < HUGE else HUGE
        good = -0.5 * logarithm(mean if mean > TINY else TINY)
        change = exponential(method.this * good + method.last * clock[MEMORY + lane])
        factor = method.safety * change
        keep = mean < 1.0
        least = 1.0 if keep else method.least
        most = method.most if keep else method.safety
        factor = least if factor < least else (most if factor > most else factor)
        good = good if mean > TINY else 0.0
        clock[MEMORY + lane] = good if keep else clock[MEMORY + lane]
        clock[DT + lane] = clock[STEP + lane] * factor
        clock[KEEP + lane] = 1.0 if keep else 0.0


@fast
def due(clock):
    """The number of lanes whose step passes an instant."""
    lanes = 0.0
    for lane in range(LANES):
        passed = clock[KEEP + lane] > 0.0 and clock[DUE + lane] <= clock[NEXT + lane]
        lanes += 1.0 if passed else 0.0
    return lanes


@fast
def accept(lanes):
    """Move on the lanes that keep their step; the number of those to be looked at."""
    clock, y, trial, keeps = lanes.clock, lanes.y, lanes.trial, lanes.wide
    spread(clock[KEEP : KEEP + LANES], keeps)
    # The last stage is the first of the next step.
    first, last = lanes.k[0], lanes.k[STAGES - 1]
    for i in range(y.size):
        y[i] = trial[i] if keeps[i] > 0.0 else y[i]
    for i in range(y.size):
        first[i] = last[i] if keeps[i] > 0.0 else first[i]
    looks = 0.0
    for lane in range(LANES):
        keep = clock[KEEP + lane] > 0.0
        time = clock[NEXT + lane] if keep else clock[TIME + lane]
        end = clock[END + lane]
        after = time + clock[DT + lane]
        # A step that was too long to keep must not be tried again.
        clipped = end if keep else time + 0.5 * (end - time)
        after = clipped if after > clock[FLOOR + lane] else after
        count = clock[COUNT + lane] + 1.0
        stuck = clock[DT + lane] < clock[SMALLEST + lane] or count >= clock[MOST + lane]
        look = 1.0 if time >= end or stuck else 0.0
        clock[TIME + lane] = time
        clock[NEXT + lane] = after
        clock[STEP + lane] = after - time
        clock[COUNT + lane] = count
        clock[LOOK + lane] = look
        looks += look
    return looks


@fast
def interpolate(method, lanes):
    """The states at the instants that are due, into `change`."""
    clock, k, found = lanes.clock, lanes.k, lanes.change
    for stage in range(STAGES):
        d, row = method.dense[stage], WEIGHTS + stage * LANES
        for lane in range(LANES):
            s = (clock[DUE + lane] - clock[TIME + lane]) / clock[STEP + lane]
            clock[row + lane] = clock[STEP + lane] * s * (d[0] + s * (d[1] + s * (d[2] + s * d[3])))
    k0, k1, k2, k3, k4, k5, k6 = k[0], k[1], k[2], k[3], k[4], k[5], k[6]
    y, w = lanes.y, clock[WEIGHTS:]
    # So large a body LLVM does not unroll to scalar code.
    for first in range(0, found.size, LANES):
        for lane in range(LANES):
            i = first + lane
            found[i] = (
                y[i]
                + (w[lane] * k0[i] + w[LANES + lane] * k1[i])
                + (w[2 * LANES + lane] * k2[i] + w[3 * LANES + lane] * k3[i])
                + (w[4 * LANES + lane] * k4[i] + w[5 * LANES + lane] * k5[i])
                + w[6 * LANES + lane] * k6[i]
            )


@fast
def hold(observe, batch, lanes):
    """Keep the states at the instants that are due, to be observed later."""
    clock, whole, times = lanes.clock, lanes.whole, batch.designs.times
    instants = times.shape[2]
    interpolate(batch.method, lanes)
    full = False
    for lane in range(LANES):
        if clock[KEEP + lane] > 0.0 and clock[DUE + lane] <= clock[NEXT + lane]:
            depth, instant = whole[HELD, lane], whole[INSTANT, lane]
            lanes.held[depth, lane] = clock[DUE + lane]
            for i in range(batch.sizes.states):
                lanes.held[depth, (1 + i) * LANES + lane] = lanes.change[i * LANES + lane]
            lanes.held_for[depth, 0, lane] = whole[ROW, lane]
            lanes.held_for[depth, 1, lane] = instant
            whole[HELD, lane] = depth + 1
            full = full or depth + 1 == DEPTH
            whole[INSTANT, lane] = instant + 1
            schedule, segment = batch.designs.schedule[whole[DESIGN, lane]], whole[SEGMENT, lane]
            more = instant + 1 < instants
            clock[DUE + lane] = times[schedule, segment, instant + 1] if more else math.inf
    if full:
        flush(observe, batch, lanes)


@fast
def flush(observe, batch, lanes):
    """Observe what is held back."""
    held, deepest = lanes.whole[HELD], 0
    for lane in range(LANES):
        deepest = max(deepest, held[lane])
    for depth in range(deepest):
        now = lanes.held[depth]
        observe(now[:LANES], now[LANES:], lanes.kept, lanes.seen)
        for lane in range(LANES):
            if depth < held[lane]:
                row, instant = lanes.held_for[depth, 0, lane], lanes.held_for[depth, 1, lane]
                for i in range(batch.sizes.observed):
                    batch.rows.seen[row, instant, i] = lanes.seen[i * LANES + lane]
    for lane in range(LANES):
        held[lane] = 0


@fast
def end_segment(lane, observe, batch, lanes):
    """Hand over the segment of a lane that has come to its end, or that goes no further."""
    clock, whole, rows = lanes.clock, lanes.whole, batch.rows
    design, row = whole[DESIGN, lane], whole[ROW, lane]
    finite = True
    for i in range(batch.sizes.states):
        rows.last[row, i] = lanes.y[i * LANES + lane]
        finite = finite and abs(rows.last[row, i]) < math.inf
    if clock[DT + lane] < clock[SMALLEST + lane]:
        result = STEP_TOO_SMALL
    elif clock[TIME + lane] < clock[END + lane]:
        result = TOO_MANY_STEPS
    else:
        result = SUCCESS if finite else NOT_FINITE
    if result != SUCCESS:
        for i in range(batch.sizes.states):
            rows.last[row, i] = math.nan
    rows.state[row] = DONE
    whole[STEPS, lane] += int(clock[COUNT + lane])
    whole[SEGMENT, lane] += 1
    if result == SUCCESS and whole[SEGMENT, lane] < batch.designs.times.shape[1]:
        begin_segment(lane, batch, lanes)
        return
    # The next design brings other numbers.
    flush(observe, batch, lanes)
    batch.ends.result[design] = result
    batch.ends.reached[design] = clock[TIME + lane]
    batch.ends.steps[design] = whole[STEPS, lane]
    whole[DESIGN, lane] = -1


@fast
def begin_segment(lane, batch, lanes):
    """Start a lane's segment: a row of its own, totals of zero, the first step anew."""
    clock, whole, rows, designs = lanes.clock, lanes.whole, batch.rows, batch.designs
    segment, row = whole[SEGMENT, lane], 0
    schedule = designs.schedule[whole[DESIGN, lane]]
    times = designs.times[schedule, segment]
    while rows.state[row] != FREE:
        row += 1
    rows.state[row] = IN_USE
    rows.design[row] = whole[DESIGN, lane]
    rows.segment[row] = segment
    for instant in range(times.size):
        for i in range(batch.sizes.observed):
            rows.seen[row, instant, i] = math.nan
    whole[ROW, lane] = row
    whole[INSTANT, lane] = 0
    for i in range(batch.sizes.motion, batch.sizes.states):
        lanes.y[i * LANES + lane] = 0.0
    end, first = times[times.size - 1], max(batch.method.first, batch.method.smallest)
    clock[NEXT + lane] = min(clock[TIME + lane] + first, end)
    clock[STEP + lane] = clock[NEXT + lane] - clock[TIME + lane]
    clock[DUE + lane] = times[0] if batch.sizes.observed > 0 else math.inf
    clock[END + lane] = end
    clock[FLOOR + lane] = designs.floors[schedule, segment]
    clock[MEMORY + lane] = 0.0
    clock[COUNT + lane] = 0.0


@fast
def refill(prepare, field, batch, lanes):
    """Give a design to every lane without one, as far as there are; how many lanes have one."""
    clock, whole, starts = lanes.clock, lanes.whole, batch.designs.starts
    live = fresh = 0
    for lane in range(LANES):
        whole[FRESH, lane] = 0
        while whole[DESIGN, lane] < 0:
            design = take(batch.next_design)
            if design >= starts.shape[0]:
                stand_still(lane, clock)
                break
            finite = True
            for i in range(starts.shape[1]):
                finite = finite and abs(starts[design, i]) < math.inf
            if finite:
                start(lane, design, batch, lanes)
                whole[FRESH, lane] = 1
                fresh += 1
            else:
                batch.ends.result[design] = NOT_FINITE
        live += whole[DESIGN, lane] >= 0
    if fresh > 0:
        # Computed for all lanes, and taken over where a design is new.
        prepare(lanes.given, lanes.scratch)
        renew(whole, lanes.scratch, lanes.kept)
        field(clock[TIME : TIME + LANES], lanes.y, lanes.kept, lanes.scratch)
        renew(whole, lanes.scratch, lanes.k[0])
    return live


@fast
def renew(whole, found, rows):
    """Copy the lanes of new designs."""
    for first in range(0, rows.size, LANES):
        for lane in range(LANES):
            if whole[FRESH, lane] > 0:
                rows[first + lane] = found[first + lane]


@fast
def start(lane, design, batch, lanes):
    """Put a design into a lane."""
    clock, whole, designs = lanes.clock, lanes.whole, batch.designs
    whole[DESIGN, lane], whole[SEGMENT, lane], whole[STEPS, lane] = design, 0, 0
    for i in range(batch.sizes.states):
        lanes.y[i * LANES + lane] = designs.starts[design, i]
    for i in range(batch.sizes.numbers):
        lanes.given[i * LANES + lane] = designs.numbers[design, i]
    clock[TIME + lane] = 0.0
    for i in range(batch.sizes.states):
        lanes.atol[i * LANES + lane] = designs.tolerances[design, 0]
        lanes.rtol[i * LANES + lane] = designs.tolerances[design, 1]
    clock[SMALLEST + lane], clock[MOST + lane] = batch.method.smallest, batch.method.steps
    begin_segment(lane, batch, lanes)


@fast
def stand_still(lane, clock):
    """A lane without a design takes steps of zero, and is never looked at."""
    clock[STEP + lane] = 0.0
    clock[NEXT + lane] = clock[TIME + lane]
    clock[END + lane], clock[FLOOR + lane], clock[DUE + lane] = math.inf, math.inf, math.inf
    clock[SMALLEST + lane], clock[MOST + lane] = -1.0, math.inf
