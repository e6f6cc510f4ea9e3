"""The verdict on a case: our numbers and warnings beside the reference's numbers."""

import math
from dataclasses import dataclass

import numpy as np
from scipy import stats

import jaxcrusher as jc
from benchmarks.batch import map_scenes
from benchmarks.narrow import narrow
from benchmarks.stability.case import Case, Formulation
from benchmarks.stability.ours import MOST_STEPS, Ours, simulate, statistics
from benchmarks.stability.reference import FEW, OURS, SETTLE, TIMES, TURNS, Reference, members
from jaxcrusher.mechanism.multiplier import MultiplierFormulation
from jaxcrusher.motion.simulation import Trajectory
from jaxcrusher.motion.statistics import WHIRL_WINDING, Statistics

AGREES, WHIRL, OUTSIDE = "agrees", "whirl", "outside the model"
REFUSED, DISAGREES = "refused", "DISAGREES"
VERDICTS = (AGREES, WHIRL, OUTSIDE, REFUSED, DISAGREES)

# Errors at the first contact: of ours in clearances (the tolerance of a step, 1e-11, times a
# few thousand), and with multipliers the rounding of positions of 0.6 m (2e-14 m a step, times
# as many); of CVODE 1e-12 of its angles, times as many. Every contact renews them.
OURS_RELATIVE, ROUNDING, THEIRS = 3e-8, 6e-11, 2e-12  # 1, m, m
# Trajectories are compared as long as these errors, grown as the reference's own motions part,
# stay below a share of the largest value; what `jaxcrusher.simulate` promises is always allowed.
PREDICTABLE, PROMISED = 1e-2, 1e-4
# One number in this many may disagree by chance.
CHANCES = 10_000
# What a step of the statistics is asked for; over all steps it may add up.
STEP = 1e-9


@dataclass(frozen=True)
class Judged:
    """A row of the table; what is not known is NaN or empty."""

    axis: str
    value: str
    start: str
    formulation: str
    verdict: str
    agreement: str  # with the reference: yes, no, but for smoothing, or empty
    remark: str
    error: float = math.nan  # of |R_O| + |R_C|, largest over the compared span / largest value
    allowed: float = math.nan  # at the same instant
    span_ms: float = math.nan  # compared
    rms: float = math.nan  # N
    reference_rms: float = math.nan  # N
    rms_error: float = math.nan  # relative
    rms_allowed: float = math.nan  # relative
    steps_a_turn: float = math.nan


def judge(
    case: Case, formulation: Formulation, known: Reference, ours: Ours | ValueError
) -> Judged:
    """Judge our motion of a case beside its reference."""
    labels = (case.axis, case.value, case.start, formulation)
    if isinstance(ours, ValueError):
        return Judged(*labels, REFUSED, "", str(ours))
    history, found = ours
    if not (history.success and found.success):
        return Judged(*labels, REFUSED, "", history.failure or found.failure)
    scene = case.scene(formulation)
    rms, steps = [rms_of(found)], int(found.outcome.steps)
    if len(known.rms) > FEW:
        count = min(OURS, 1 + MOST_STEPS // steps)
        rms += others(case, formulation, count - 1)
    close = pointwise(scene, history, known)
    middle, off, allowed = statistical(np.array(rms), known.rms, steps * STEP)
    near = close["error"] <= close["allowed"]
    agreement = "yes" if near and off <= allowed else "no"
    if not near and off <= allowed:
        (sharp,) = map_scenes(simulate, [narrow(scene)])
        closer = pointwise(scene, sharp, known)
        if sharp.success and closer["error"] <= closer["allowed"]:
            agreement = "but for smoothing"
    remarks = [*rolling(scene, found), *found.validity.remarks()]
    if bool(found.whirl):
        verdict, remarks = WHIRL, [f"{found.winding:.0f} revolutions a turn", *remarks]
    elif not bool(found.validity.inside):
        verdict = OUTSIDE
    else:
        verdict = AGREES if agreement == "yes" else DISAGREES
    return Judged(
        *labels,
        verdict,
        agreement,
        "; ".join(remarks),
        **close,
        rms=rms[0],
        reference_rms=middle,
        rms_error=off,
        rms_allowed=allowed,
        steps_a_turn=steps / (SETTLE + TURNS),
    )


def rolling(scene: jc.Scene, found: Statistics) -> list[str]:
    """Name the pins of B and C that go round their bores."""
    told = []
    for name, _ in scene.joints.items():
        prefix = scene.prefix(name)
        winding, share = float(found[f"{prefix}winding"]), float(found[f"{prefix}contact_fraction"])
        if name != "main" and abs(winding) > WHIRL_WINDING:
            told.append(f"{name}: {winding:.0f} revolutions a turn, {share:.2f} of it in contact")
    return told


def pointwise(scene: jc.Scene, history: Trajectory, known: Reference) -> dict[str, float]:
    """Return error and tolerance where their ratio is largest, in units of the largest value.

    The span is zero where rounding alone moves the force by more than is compared.
    """
    multiplier = isinstance(scene.formulation, MultiplierFormulation)
    rounding = ROUNDING if multiplier else 0.0
    widest = max(float(joint.clearance) for _, joint in scene.joints.items())
    level = max(OURS_RELATIVE * widest, rounding, THEIRS)
    worst = {"error": 0.0, "allowed": PROMISED, "span_ms": 1e3 * TIMES[-1]}
    for name, theirs in known.histories.items():
        size = abs(theirs).max()
        grown = level * (1 + known.contacts) * known.growth[name]
        kept, allowed = grown <= PREDICTABLE, np.maximum(grown, PROMISED)
        off = abs(np.asarray(history[name]) - theirs).reshape(len(TIMES), -1).max(axis=1) / size
        last = TIMES[kept][-1] if kept.any() else 0.0
        worst["span_ms"] = min(worst["span_ms"], 1e3 * float(last))
        at = int(np.argmax(np.where(kept, off / allowed, 0)))
        if kept[at] and off[at] * worst["allowed"] >= worst["error"] * allowed[at]:
            worst |= {"error": float(off[at]), "allowed": float(allowed[at])}
    return worst


def others(case: Case, formulation: Formulation, count: int) -> list[float]:
    """Return the RMS (N) of ours from starts about the case's."""
    scenes = [case.scene(formulation, place) for place in members(case.peer, case.pins, count)]
    return list(map(rms_of, map_scenes(statistics, scenes)))


def rms_of(found: Statistics) -> float:
    """Return the RMS of |R_O| + |R_C|, N."""
    return float(found.foundation_rms)


def statistical(
    ours: np.ndarray, theirs: np.ndarray, integration: float
) -> tuple[float, float, float]:
    """Return the reference's mean (N), how far ours is from it, and may be (both relative).

    Allowed are the scatter of the reference's starts and the `integration`'s own error.

    Where starts part between attractors (quiet, whirl), only those within a factor of two of our
    first count; NaN if fewer than two of the reference do.
    """
    middle = float(theirs.mean())
    ours, theirs = (runs[(runs > ours[0] / 2) & (runs < 2 * ours[0])] for runs in (ours, theirs))
    if len(theirs) < 2:
        return middle, math.nan, math.nan
    middle = float(theirs.mean())
    # Of one run of ours the scatter is that of the reference's.
    quantile = stats.t.ppf(1 - 0.5 / CHANCES, len(theirs) - 1)
    allowed = quantile * theirs.std(ddof=1) * math.sqrt(1 / len(ours) + 1 / len(theirs))
    return middle, abs(ours.mean() / middle - 1), allowed / middle + integration
