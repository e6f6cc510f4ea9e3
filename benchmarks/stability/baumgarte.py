"""Baumgarte's alpha and beta: what drift they leave, and what they cost."""

import time
from collections.abc import Iterator
from dataclasses import dataclass

import equinox as eqx
import jax
import numpy as np

import jaxcrusher as jc
from benchmarks.stability.cases import BASE, Case
from jaxcrusher.crusher.formulations import MultiplierFormulation

TURNS = 20
METHOD = jc.Method(max_steps=2_000_000)
# The default of statistics, and one at which a drift has something to grow from.
TOLERANCES = (1e-9, 1e-5)
PAPER = 20.0


@dataclass(frozen=True)
class Stabilised:
    """A run of the quiet motion; `alpha` and `beta` in 1/s, None for the eccentricities."""

    alpha: float | None
    beta: float | None
    rtol: float
    residual: float  # largest violation of a constraint, m or rad
    force_error: float  # largest of |R_O| + |R_C|, over its largest value
    steps_a_turn: float
    seconds: float  # of the processor, of the second run
    failure: str


def measure(turns: int = TURNS) -> Iterator[Stabilised]:
    """Every pair of alpha and beta in 0, 5, 20, 100 and 1/h, h the mean step of (20, 20)."""
    case = Case("start", "", "in contact", BASE)
    times = np.linspace(0, 2 * np.pi / BASE.speed * turns, 64 * turns + 1)
    exact = jc.simulate(case.scene("eccentricity"), times, outputs=("foundation_force",))
    scene = case.scene("multiplier")
    for rtol in TOLERANCES:

        def run(scene, alpha, beta, rtol=rtol):
            return _run(scene, times, np.asarray(exact.foundation_force), alpha, beta, rtol)

        yield run(case.scene("eccentricity"), None, None)
        paper = run(scene, PAPER, PAPER)
        values = (0.0, 5.0, PAPER, 100.0, paper.steps_a_turn * BASE.speed / (2 * np.pi))
        for alpha in values:
            for beta in values:
                yield run(scene, alpha, beta)


def _run(scene: jc.Scene, times, exact: np.ndarray, alpha, beta, rtol: float) -> Stabilised:
    outputs: tuple[str, ...] = ("foundation_force",)
    if alpha is not None:
        formulation = MultiplierFormulation(alpha, beta)
        scene = eqx.tree_at(lambda s: s.formulation, scene, formulation)
        outputs += ("constraint_residual",)

    def simulate() -> jc.Trajectory:
        found = jc.simulate(scene, times, outputs=outputs, rtol=rtol, method=METHOD)
        return jax.block_until_ready(found)

    simulate()  # compiles
    begin = time.process_time()
    found = simulate()
    seconds = time.process_time() - begin
    violation = 0.0 if alpha is None else found.constraint_residual.max()
    off = abs(np.asarray(found.foundation_force) - exact).max() / exact.max()
    turns = times[-1] * float(scene.drive.speed) / (2 * np.pi)
    return Stabilised(
        alpha,
        beta,
        rtol,
        float(violation),
        float(off),
        int(found.outcome.steps) / turns,
        seconds,
        found.failure,
    )
