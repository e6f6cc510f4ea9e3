"""A thousand turns: the drift of the energy ledger, the constraints and the RMS."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

import jaxcrusher as jc
from benchmarks.stability.case import FORMULATIONS, Case, Formulation
from benchmarks.stability.cases import BASE, bearing_case
from benchmarks.stability.peer import BearingPeer, Pins
from benchmarks.stability.reference import members

TURNS, BLOCK, MEMBERS = 1000, 100, 4
MOST_STEPS = 50_000_000
METHOD = jc.Method(max_steps=MOST_STEPS)


@dataclass(frozen=True)
class Drift:
    """A long run; `imbalance` and `residual` after a block of turns and after all."""

    start: str
    formulation: str
    failure: str
    whirl: bool
    imbalance: tuple[float, float]  # of the energy ledger, J
    turned_over: float  # work of the drive against it, summed without sign, J
    residual: tuple[float, float] | None  # largest violation of a constraint, m or rad
    rms: tuple[float, float]  # of the first and last block, N
    reference_rms: tuple[float, float]  # the same by numba, mean of its members
    reference_scatter: tuple[float, float]  # standard deviation of the members


def measure(known: Mapping[str, np.ndarray]) -> Iterator[Drift]:
    """Run both formulations from each start of `known`, which has the answers of `reference`."""
    for start, theirs in known.items():
        case = bearing_case(start)
        for formulation in FORMULATIONS:
            yield run(case, formulation, TURNS, BLOCK, theirs)


def run(case: Case, formulation: Formulation, turns: int, block: int, known: np.ndarray) -> Drift:
    """Run ours for long; `known` is the answer of `reference`."""
    scene = case.scene(formulation)
    # Odd instants, so that not the same phase is seen in every turn.
    times = 2 * np.pi / BASE.speed * np.linspace(0, turns, 7 * turns + 2)
    outputs: tuple[str, ...] = ("energy", "drive_power")
    if formulation == "multiplier":
        outputs += ("constraint_residual",)
    history = jc.simulate(scene, times, outputs=outputs, rtol=1e-9, method=METHOD)
    found = jc.statistics(scene, 0, turns)
    early = times <= times[-1] * block / turns

    def both(values) -> tuple[float, float]:
        size = abs(np.asarray(values))
        return float(size[early].max()), float(size.max())

    residual = history.values.get("constraint_residual")
    squares = found.by_turn["foundation_rms"] ** 2
    return Drift(
        case.start,
        formulation,
        history.failure or found.failure,
        bool(found.whirl),
        both(history.energy.imbalance),
        float(np.trapezoid(abs(history.drive_power), times)),
        None if residual is None else both(residual),
        (float(squares[:block].mean()) ** 0.5, float(squares[-block:].mean()) ** 0.5),
        tuple(known.mean(axis=0)),
        tuple(known.std(axis=0, ddof=1)),
    )


def reference(pins: Pins, turns: int = TURNS, block: int = BLOCK) -> np.ndarray:
    """Return the RMS (N) of the first and last block by numba, shape (members, 2)."""
    peer, rows = BearingPeer(BASE), []
    for place in members(peer, pins, MEMBERS):
        first, _ = peer.mean_square(place, 0, block, MOST_STEPS)
        last, _ = peer.mean_square(place, turns - 2 * block, block, MOST_STEPS)
        rows.append(np.sqrt([first, last]))
    return np.array(rows)
