"""Our side: RMS, force history and the RMS's slope in one compiled program of `jaxcrusher`.

`jaxcrusher.statistics` integrates the square over whole turns and `jaxcrusher.simulate` looks at
instants; here one run does both, over any span, with the same integration.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Scalar

import jaxcrusher as jc
from benchmarks.work_precision.cases import Case
from jaxcrusher.basics.integrate import (
    Carried,
    InitialValueProblem,
    Integration,
    Outcome,
    integrate,
)
from jaxcrusher.crusher.template import foundation_force
from jaxcrusher.joint.normal import cylinder_stiffness
from jaxcrusher.motion.flow import by_phase
from jaxcrusher.motion.method import resolve

# A run that would take more is cut off, and said to have failed.
MOST_STEPS = 2_000_000
SOLVERS = {
    "Tsit5": diffrax.Tsit5(),
    "Dopri5": diffrax.Dopri5(),
    "Dopri8": diffrax.Dopri8(),
    "Kvaerno5": diffrax.Kvaerno5(),
}
LADDER = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11)
# An implicit step costs tens of explicit ones.
FEW = (1e-4, 1e-6, 1e-8, 1e-10)
SINGLE = (1e-2, 1e-3, 1e-4, 1e-5)
WIDTHS = (1e-10, 1e-7, 1e-6)  # m, of the contact's corner; 1e-8 is the default
FIXED_STEPS = (4e-3, 1e-3, 2e-4)  # rad


@dataclass(frozen=True)
class Run:
    """One of our ways to solve a case."""

    program: str
    setting: str
    scene: jc.Scene
    method: Integration
    single: bool = False  # in 32-bit floats
    with_slope: bool = True


def _initial(scene: jc.Scene) -> Carried:
    return Carried(scene.formulation.initial(scene), jnp.zeros(()))


def _field(angle: Scalar, y: Carried, scene: jc.Scene) -> Carried:
    rate, snapshot = by_phase(angle, y.motion, scene)
    return Carried(rate, foundation_force(snapshot, scene) ** 2)


def _observe(angle: Scalar, y: Carried, scene: jc.Scene) -> Scalar:
    _, snapshot = by_phase(angle, y.motion, scene)
    return foundation_force(snapshot, scene)


PROBLEM = InitialValueProblem(
    _initial, _field, _observe, lambda forces, end, _: (forces, end.totals)
)


def solve(scene: jc.Scene, angles: Array, method: Integration) -> tuple[Array, Array, Outcome]:
    """Return RMS (N), forces (N) at `angles` (rad) and how it ended."""
    (forces, total), outcome = integrate(scene, angles[None], problem=PROBLEM, method=method)
    return jnp.sqrt(total[0] / angles[-1]), forces[0], outcome


def slope(scene: jc.Scene, angles: Array, method: Integration) -> tuple[Array, Array]:
    """Return the RMS (N) and its derivative by clearance (by speed for the ideal joint)."""

    def rms(value):
        return solve(_with(scene, value), angles, method)[0]

    value = scene.drive.speed if scene.joints["main"] is None else scene.joints.at("main").clearance
    return jax.jvp(rms, (value,), (jnp.ones_like(value),))


def _with(scene: jc.Scene, value: Scalar) -> jc.Scene:
    """Return the scene with another clearance, on which the stiffness depends, or another speed."""
    if scene.joints["main"] is None:
        return eqx.tree_at(lambda s: s.drive.speed, scene, value)
    stiffness = cylinder_stiffness(scene.bearings.at("main").bore_radius, value)
    return eqx.tree_at(
        lambda s: (s.joints.at("main").clearance, s.joints.at("main").normal.stiffness),
        scene,
        (value, stiffness),
    )


def runs(case: Case) -> Iterator[Run]:
    """Yield all ways to solve a case."""
    formulations = ("closed",) if case.ideal else ("eccentricity", "multiplier")
    for formulation in formulations:
        scene = case.scene(formulation)
        for name, solver in SOLVERS.items():
            ladder = FEW if name == "Kvaerno5" else LADDER
            # The other programs with tangents take too long to compile.
            quick = name == "Tsit5" or (name != "Kvaerno5" and formulation != "multiplier")
            for rtol in ladder:
                yield Run(
                    f"{name}, {formulation}",
                    f"rtol {rtol:.0e}",
                    scene,
                    _adaptive(scene, rtol, solver),
                    with_slope=quick,
                )
        if formulation == formulations[0]:
            yield from _variants(scene)


def _adaptive(scene: jc.Scene, rtol: float, solver=None) -> Integration:
    return resolve(scene, rtol, jc.Method(solver, max_steps=MOST_STEPS))


def _variants(scene: jc.Scene) -> Iterator[Run]:
    """Yield Tsit5 with fixed steps, other widths, and 32-bit floats."""
    fixed = diffrax.ConstantStepSize()
    for step in FIXED_STEPS:
        method = jc.Method(stepsize_controller=fixed, max_steps=MOST_STEPS, dt0=step)
        method = resolve(scene, 1e-9, method)
        yield Run("Tsit5, fixed steps", f"{step:.0e} rad", scene, method, with_slope=False)
    for width in WIDTHS if scene.joints["main"] is not None else ():
        smoothed = eqx.tree_at(lambda s: s.joints.at("main").normal.width, scene, jnp.array(width))
        for rtol in FEW:
            yield Run(
                f"Tsit5, corner {width:.0e} m", f"rtol {rtol:.0e}", smoothed, _adaptive(scene, rtol)
            )
    for rtol in SINGLE:
        method = _adaptive(scene, rtol)
        yield Run(
            "Tsit5, float32", f"rtol {rtol:.0e}", scene, method, single=True, with_slope=False
        )
