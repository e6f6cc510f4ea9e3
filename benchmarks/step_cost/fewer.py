"""The steps and the error of the RMS, by solver, controller and tolerance."""

import math
from collections.abc import Iterator
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp

import jaxcrusher as jc
from benchmarks.step_cost.programs import Start
from jaxcrusher.basics.plane import Vector
from jaxcrusher.mechanism.starts import shifted_start
from jaxcrusher.motion.flow import Flow
from jaxcrusher.motion.integrate import Integration, error_norm, integrate
from jaxcrusher.motion.statistic import chosen
from jaxcrusher.motion.statistics import statistics_problem

# Two turns of the quiet motion; 20 ms of impacts, before their trajectories part.
MOTIONS: dict[str, tuple[Start, float]] = {
    "quiet": ("contact", 4 * math.pi),
    "impacting": ("centred", 30.0 * 0.02),
}
# Proportional, integral and derivative coefficients as diffrax takes them. Exponents of the last
# three errors are p + i + d, -(p + 2 d), d, over the order: 1/6, 1/6 makes Söderlind's H211PI and
# 1/18, 1/9, 1/18 his H312PID.
PI = (0.4, 0.3, 0.0)
CONTROLLERS = {
    "I": (0.0, 1.0, 0.0),
    "PI 0.4, 0.3 (default)": PI,
    "PI 0.2, 0.4": (0.2, 0.4, 0.0),
    "H211PI": (-1 / 6, 1 / 3, 0.0),
    "H312PID": (-2 / 9, 2 / 9, 1 / 18),
}
SOLVERS = (diffrax.Bosh3(), diffrax.Tsit5(), diffrax.Dopri5(), diffrax.Dopri8())
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-8)
FIXED = (300, 400, 600)  # steps a turn
REFERENCE = 1e-12


def _scene(start: Start) -> jc.Scene:
    """Return a scene with its start as numbers, so that both motions run one program."""
    return shifted_start(jc.paper_scene(30.0, 0.06e-3, start=start), Vector(0.0, 0.0))


@eqx.filter_jit
def _run(scene: jc.Scene, angle: jax.Array, method: Integration):
    """Return the RMS (N) over `angle` (rad) from the start, and the steps."""
    problem = statistics_problem(chosen(("foundation_rms",)))
    (_, values), outcome = integrate(
        Flow(scene), angle.reshape(1, 1), problem=problem, method=method
    )
    # The problem takes the angle for a whole turn.
    return values["foundation_rms"][0] * jnp.sqrt(2 * math.pi / angle), outcome.steps


def _adaptive(solver, coefficients, tolerance: float) -> Integration:
    p, i, d = coefficients
    level = jnp.asarray(tolerance)
    controller = diffrax.PIDController(level, level, pcoeff=p, icoeff=i, dcoeff=d, norm=error_norm)
    return Integration(solver, controller, 10_000_000, 1e-5, None)


def _fixed(solver, steps: int) -> Integration:
    return Integration(solver, diffrax.ConstantStepSize(), 10_000_000, 2 * math.pi / steps, None)


def methods() -> list[tuple[str, str, str, Integration]]:
    """Return solvers, controllers, tolerances or steps a turn, and how to integrate."""
    rows = []
    for solver in SOLVERS:
        for name, coefficients in CONTROLLERS.items():
            if coefficients is PI or isinstance(solver, diffrax.Dopri5):
                for tolerance in TOLERANCES:
                    method = _adaptive(solver, coefficients, tolerance)
                    rows.append((type(solver).__name__, name, f"{tolerance:.0e}", method))
    for solver in (diffrax.Bosh3(), diffrax.Tsit5()):
        for steps in FIXED:
            rows.append((type(solver).__name__, "fixed", str(steps), _fixed(solver, steps)))
    return rows


def _evaluations(solver) -> int:
    """Count evaluations in a step; the last stage of most is the first of the next step."""
    return solver.tableau.num_stages - bool(solver.tableau.fsal)


def measure() -> Iterator[dict[str, Any]]:
    """Yield every method on every motion, and last how far apart two references are (relative).

    A row has steps and evaluations a turn, and the relative error of the RMS.
    """
    reference, doubt = {}, {}
    for motion, (start, angle) in MOTIONS.items():
        one, other = (
            float(_run(_scene(start), jnp.asarray(angle), _adaptive(solver, PI, REFERENCE))[0])
            for solver in (diffrax.Dopri8(), diffrax.Tsit5())
        )
        reference[motion], doubt[motion] = one, abs(other / one - 1)
    for solver, controller, setting, method in methods():
        for motion, (start, angle) in MOTIONS.items():
            rms, steps = _run(_scene(start), jnp.asarray(angle), method)
            a_turn = float(steps) * 2 * math.pi / angle
            yield {
                "motion": motion,
                "solver": solver,
                "controller": controller,
                "setting": setting,
                "steps": a_turn,
                "evaluations": a_turn * _evaluations(method.solver),
                "error": abs(float(rms) / reference[motion] - 1),
            }
    yield doubt
