"""How a motion is integrated: the choice offered to users, and what it comes to for a scene."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree, Scalar

from jaxcrusher.basics.checks import (
    concrete,
    is_concrete,
    primal,
    require,
    require_kind,
    require_positive,
    require_whole,
)
from jaxcrusher.basics.integrate import Integration, Outcome, pi_controller
from jaxcrusher.basics.setup import warn_once
from jaxcrusher.mechanism.scene import Scene, require_scene

MOST_STEPS = 10_000_000
FIRST_STEP = 1e-5  # rad of phase
# A slope is told to be one history's if this is the sensitivity of the state after more than a few
# turns. In contact it stays below 20 for 30 turns at 60 rad/s; with impacts it is 1e6 after five
# turns of a slider-crank at 400 rad/s, and 1e16 after three of a crusher that starts centred.
SENSITIVE = 1e4
FEW_TURNS = 2


class Method(eqx.Module):
    """Solver, step-size controller, bounds and adjoint; a field of None is chosen for the scene.

    - `solver`: any of diffrax; None is Tsit5.
    - `stepsize_controller`: any of diffrax, which then ignores `rtol`; None is a PI controller of
      equal relative and absolute tolerance.
    - `max_steps`: accepted and rejected, of one integration: a turn, but all of `simulate`, whose
      times need not end with turns. None is ten million. With fewer than a motion needs the run
      fails, and a derivative, which may need more than twice as many, is NaN.
    - `dt0`: the first step of an integration, or every step of `diffrax.ConstantStepSize`: in rad
      of phase (2 pi a turn), but in s for `simulate`, as its times. None is 1e-5 rad, or 1e-6 s.
    - `adjoint`: a diffrax adjoint differentiates through the steps; None is tangents beside the
      motion, under the same error control.

    Raises ValueError for an object not of diffrax (also for its classes), for a `max_steps` that is
    not a whole number >= 1, and a `dt0` not > 0.
    """

    solver: diffrax.AbstractSolver | None = None
    stepsize_controller: diffrax.AbstractStepSizeController | None = None
    max_steps: int | None = eqx.field(static=True, default=None)
    dt0: float | None = eqx.field(static=True, default=None)
    adjoint: diffrax.AbstractAdjoint | None = None

    def __check_init__(self):
        for name, kind, example in (
            ("solver", diffrax.AbstractSolver, "diffrax.Dopri8()"),
            (
                "stepsize_controller",
                diffrax.AbstractStepSizeController,
                "diffrax.ConstantStepSize()",
            ),
            ("adjoint", diffrax.AbstractAdjoint, "diffrax.RecursiveCheckpointAdjoint()"),
        ):
            if getattr(self, name) is not None:
                require_kind(name, getattr(self, name), kind, example)
        if self.max_steps is not None:
            require_whole("max_steps", self.max_steps, 1)
        if self.dt0 is not None:
            require_positive("dt0", self.dt0, "rad of phase, or s")


def resolve(
    scene: Scene,
    rtol: Scalar | float,
    method: Method = Method(),
    first_step: float = FIRST_STEP,
) -> Integration:
    """The method with its open fields chosen for a scene.

    `rtol` counts in clearances (and m/s): 1e-9 is 6e-14 m for a clearance of 0.06 mm. Steps
    are bounded below, so that a motion that is not finite ends at once, and in number.
    """
    require_kind("method", method, Method, "jaxcrusher.Method(diffrax.Dopri8())")
    require_scene(scene)
    require_tolerance(rtol)
    return Integration(
        method.solver or diffrax.Tsit5(),
        method.stepsize_controller or _controller(scene, rtol),
        method.max_steps or MOST_STEPS,
        float(method.dt0 or first_step),
        method.adjoint,
    )


def require_tolerance(rtol: Scalar | float) -> None:
    """Check that a tolerance is a share of a clearance."""
    require_positive("rtol", rtol, "")
    known = concrete(rtol)
    require(known is None or bool(known.ndim == 0 and known < 1), "rtol", "be one number < 1", rtol)


def warn_of_slopes(found: PyTree, outcome: Outcome, speed: Scalar | float = 1.0):
    """Warn, once in a process, if a motion is too sensitive for the slopes that are taken of it.

    The sensitivity is known under `jax.grad` and the like, but not in a program of `jax.jit`.
    `speed` is that of the shaft, rad/s, where the outcome counts seconds.
    """
    if is_concrete(found):  # and nobody waits for numbers that are still computed
        return
    known, phase = primal(outcome.sensitivity), primal(outcome.reached * speed)
    if known is None or phase is None:
        return
    turns = float(np.max(phase)) / (2 * np.pi)
    if turns > FEW_TURNS and (most := float(np.max(known))) > SENSITIVE:
        warn_once(
            "slopes",
            f"A derivative over {turns:.3g} turns is of this one run alone: a number that changes "
            f"by {1 / most:.1e} of itself changes the state by as much as its size. "
            "jaxcrusher.gradient_report tells which slopes may be believed.",
        )


def _controller(scene: Scene, rtol: Scalar | float) -> diffrax.PIDController:
    # An array, so that another value runs the same program. It may depend on the scene, but is
    # not part of what is differentiated.
    tolerance = jnp.asarray(scene.formulation.tolerance(scene, rtol), dtype=float)
    return pi_controller(jax.lax.stop_gradient(tolerance))
