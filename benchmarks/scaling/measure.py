"""The measurements of a process: batches of designs, and gradients."""

import dataclasses
import resource
from collections.abc import Iterator
from typing import Any

import diffrax
import equinox as eqx
import jax
import numpy as np

import jaxcrusher as jc
from benchmarks.step_cost import programs
from benchmarks.timing import spent, timed, timed_in_turn
from jaxcrusher.batch.engines import CHUNK, run_all, run_chunks

DESIGNS = (1, 4, 16, 64, 256, 1024, 4096, 16384, 100_000)
DESIGNS_TURNS = 5
SWEEP_SIDES = (8, 16, 32, 64, 100)
SWEEP_TURNS = 5
TURNS = (10, 30, 100, 300, 1000)
TURNS_DESIGNS = 8
RTOL = 1e-6
# Repeats of a run, and their least and most seconds.
HOW = (5, 0.5, 5.0)

# The RMS is differentiated by the first so many of these.
DIFFERENTIATED = (2, 8, 20)
PARAMETERS = """
    speed clearance jaw.mass jaw.inertia toggle.length shaft.eccentricity jaw.length load
    toggle.mass toggle.inertia shaft.mass shaft.mass_centre_radius shaft.mass_centre_angle
    jaw.mass_centre_distance jaw.mass_centre_angle bearing.distance bearing.inclination
    bore_radius friction gravity
""".split()
GRADIENT_TURNS = 4
EQUAL_STEPS = 1024  # a turn: about twice what stability asks of Tsit5 here
EQUAL = jc.Method(
    stepsize_controller=diffrax.ConstantStepSize(),
    max_steps=EQUAL_STEPS + 1,
    dt0=2 * np.pi / EQUAL_STEPS,
)
METHODS = {
    "forward, error controlled": jc.Method(),
    "forward, equal steps": EQUAL,
    "reverse, equal steps": dataclasses.replace(
        EQUAL, adjoint=diffrax.RecursiveCheckpointAdjoint()
    ),
}


def batch(designs: int, turns: int) -> dict[str, Any]:
    """Time a sweep of quiet motions over the paper's box: seconds, steps, peak memory."""
    random = np.random.default_rng(0)
    speeds, clearances = random.uniform([25, 0.03e-3], [40, 0.12e-3], (designs, 2)).T
    scenes = jax.jit(jax.vmap(lambda w, c: jc.paper_scene(w, c, start="contact")))(
        speeds, clearances
    )
    function = eqx.Partial(_rms_and_steps, turns=turns)
    # Later chunks run the program of the first.
    first, _ = spent(lambda: next(run_chunks(function, scenes, CHUNK)))
    _, again, (rms, steps) = timed(lambda: run_all(function, scenes, CHUNK), *HOW)
    if not np.isfinite(rms).all():
        raise RuntimeError(f"{np.sum(~np.isfinite(rms))} of {designs} designs failed.")
    # The process's peak so far: it grows with what is run, so the largest run comes last.
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {
        "designs": designs,
        "turns": turns,
        "first_cpu_s": first.cpu,
        "seconds": again.wall,
        "cpu_s": again.cpu,
        "steps": float(steps.sum()),
        "peak_mib": peak,
    }


def _rms_and_steps(scene: jc.Scene, turns: int) -> tuple[jax.Array, jax.Array]:
    result = jc.statistics(scene, 0, turns, outputs=("foundation_rms",), rtol=RTOL)
    return result.foundation_rms, result.outcome.steps


def whole_sweep(side: int) -> dict[str, Any]:
    """Time `jaxcrusher.sweep` with all statistics, beside the peer by hand with the RMS only.

    The peer is written for numba, runs on one core and takes its designs one after the other; it
    is timed by 64 of them.
    """
    peers = programs.designs("contact", SWEEP_TURNS)
    axes = {"speed": np.linspace(28, 32, side), "clearance": np.linspace(5e-5, 7e-5, side)}
    base = {"start": "contact", "slip": "surface", "friction": programs.FRICTION}

    def run() -> None:
        grid = jc.sweep(axes, 0, SWEEP_TURNS, base=base, rtol=programs.RTOL)
        if not bool(grid.success.all()):
            raise RuntimeError("A design failed.")

    both = timed_in_turn({"ours": run, "by hand": programs.numba(peers)}, *HOW)
    (first, ours, _), (_, theirs, _) = both.values()
    share = side**2 / len(peers.starts)
    return {
        "designs": side**2,
        "turns": SWEEP_TURNS,
        "first_cpu_s": first.cpu,
        "seconds": ours.wall,
        "cpu_s": ours.cpu,
        "by_hand_s": theirs.wall * share,
        "by_hand_cpu_s": theirs.cpu * share,
    }


def gradient(method: str, count: int) -> dict[str, Any]:
    """Time the value and gradient of one RMS by `count` parameters, and the value alone."""
    names = PARAMETERS[:count]
    point = np.array([jc.PARAMETERS[name].default for name in names])

    def rms(point):
        scene = jc.build_scene(dict(zip(names, point, strict=True)) | {"start": "contact"})
        result = jc.statistics(
            scene, 0, GRADIENT_TURNS, outputs=("foundation_rms",), method=METHODS[method]
        )
        return result.foundation_rms, result.outcome.steps

    value = jax.jit(lambda point: rms(point))
    both = jax.jit(jax.value_and_grad(rms, has_aux=True))
    first_value, one, (_, value_steps) = timed(lambda: value(point), *HOW)
    first, again, ((_, steps), slopes) = timed(lambda: both(point), *HOW)
    if not np.isfinite(slopes).all():
        raise RuntimeError(f"The gradient is not finite: {slopes}.")
    return {
        "parameters": count,
        "value_cpu_s": one.cpu,
        "cpu_s": again.cpu,
        "value_first_cpu_s": first_value.cpu,
        "first_cpu_s": first.cpu,
        "value_steps": int(value_steps),
        "steps": int(steps),
    }


def measure(what: str) -> Iterator[dict[str, Any]]:
    """Yield the rows of one process."""
    if what == "designs":
        yield from (batch(count, DESIGNS_TURNS) for count in DESIGNS)
    elif what == "sweeps":
        yield from (whole_sweep(side) for side in SWEEP_SIDES)
    elif what == "turns":
        yield from (batch(TURNS_DESIGNS, count) for count in TURNS)
    else:
        yield from (gradient(what, count) for count in DIFFERENTIATED)
