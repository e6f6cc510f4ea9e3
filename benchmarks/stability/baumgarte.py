"""Baumgarte's alpha and beta: the drift that they leave, and their cost."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import equinox as eqx
import numpy as np

import jaxcrusher as jc
from benchmarks.stability.cases import BASE, bearing_case
from benchmarks.timing import timed
from jaxcrusher.mechanism.multiplier import MultiplierFormulation
from jaxcrusher.motion.simulation import Trajectory

TURNS = 20
METHOD = jc.Method(max_steps=2_000_000)
# The default of statistics, and one at which a drift has something to grow from.
TOLERANCES = (1e-9, 1e-5)
PAPER = 20.0


@dataclass(frozen=True)
class Stabilised:
    """A run of the quiet motion; `alpha` and `beta` in 1/s, NaN for the eccentricities."""

    alpha: float
    beta: float
    rtol: float
    residual: float  # largest violation of a constraint, m or rad
    force_error: float  # largest of |R_O| + |R_C|, over its largest value
    steps_a_turn: float
    seconds: float  # of the processor, of the second run
    failure: str


def measure(turns: int = TURNS) -> Iterator[Stabilised]:
    """Run every pair of alpha and beta in 0, 5, 20, 100 and 1/h, h the mean step of (20, 20)."""
    case = bearing_case("in contact")
    times = np.linspace(0, 2 * np.pi / BASE.speed * turns, 64 * turns + 1)
    free, scene = case.scene("eccentricity"), case.scene("multiplier")
    exact = np.asarray(jc.simulate(free, times, outputs=("foundation_force",)).foundation_force)
    for rtol in TOLERANCES:
        yield _run(free, times, exact, math.nan, math.nan, rtol)
        paper = _run(scene, times, exact, PAPER, PAPER, rtol)
        values = (0.0, 5.0, PAPER, 100.0, paper.steps_a_turn * BASE.speed / (2 * np.pi))
        for alpha in values:
            for beta in values:
                yield _run(scene, times, exact, alpha, beta, rtol)


def _run(scene: jc.Scene, times, exact, alpha: float, beta: float, rtol: float) -> Stabilised:
    outputs: tuple[str, ...] = ("foundation_force",)
    free = math.isnan(alpha)
    if not free:
        formulation = MultiplierFormulation(alpha, beta)
        scene = eqx.tree_at(lambda s: s.formulation, scene, formulation)
        outputs += ("constraint_residual",)

    def simulate() -> Trajectory:
        return jc.simulate(scene, times, outputs=outputs, rtol=rtol, method=METHOD)

    run = timed(simulate, 1)
    found = run.found
    off = abs(np.asarray(found.foundation_force) - exact).max() / exact.max()
    turns = times[-1] * float(scene.drive.speed) / (2 * np.pi)
    return Stabilised(
        alpha,
        beta,
        rtol,
        0.0 if free else float(found.constraint_residual.max()),
        float(off),
        int(found.outcome.steps) / turns,
        run.again.cpu,
        found.failure,
    )
