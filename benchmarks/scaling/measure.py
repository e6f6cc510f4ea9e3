"""What one process measures: batches of designs, and gradients."""

import dataclasses
import resource
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import numpy as np

import jaxcrusher as jc
from benchmarks.step_cost import programs
from jaxcrusher.batch.engines import CHUNK, run_all, run_chunks

DESIGNS = (1, 4, 16, 64, 256, 1024, 4096, 16384, 100_000)
DESIGNS_TURNS = 5
SWEEP_SIDES = (8, 16, 32, 64, 100)
SWEEP_TURNS = 5
TURNS = (10, 30, 100, 300, 1000)
TURNS_DESIGNS = 8
RTOL = 1e-6
REPEATS = 5
# A run longer than this is not repeated.
LONG = 5.0  # s
ENOUGH = 0.5  # s; a median needs no more

# By how many of these the RMS is differentiated, one after the other.
DIFFERENTIATED = (2, 8, 20)
PARAMETERS = (
    "speed",
    "clearance",
    "jaw.mass",
    "jaw.inertia",
    "toggle.length",
    "shaft.eccentricity",
    "jaw.length",
    "load",
    "toggle.mass",
    "toggle.inertia",
    "shaft.mass",
    "shaft.mass_centre_radius",
    "shaft.mass_centre_angle",
    "jaw.mass_centre_distance",
    "jaw.mass_centre_angle",
    "bearing.distance",
    "bearing.inclination",
    "bore_radius",
    "friction",
    "gravity",
)
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


class Spent(NamedTuple):
    """Seconds by the clock, and of the processor on all cores: others' work does not count."""

    wall: float
    cpu: float


def spent(run: Callable[[], Any]) -> Spent:
    """In one run."""
    began = time.perf_counter(), time.process_time()
    jax.block_until_ready(run())
    return Spent(time.perf_counter() - began[0], time.process_time() - began[1])


def median_spent(run: Callable[[], Any]) -> Spent:
    """In several runs, many of short ones, or in one that is long."""
    runs = [spent(run)]
    while runs[-1].wall < LONG and (len(runs) < REPEATS or sum(r.wall for r in runs) < ENOUGH):
        runs.append(spent(run))
    return Spent(*np.median(runs, axis=0).tolist())


def batch(designs: int, turns: int) -> dict[str, Any]:
    """A sweep of quiet motions over the paper's box: seconds, steps, peak memory."""
    random = np.random.default_rng(0)
    speeds, clearances = random.uniform([25, 0.03e-3], [40, 0.12e-3], (designs, 2)).T
    scenes = jax.jit(jax.vmap(lambda w, c: jc.paper_scene(w, c, start="contact")))(
        speeds, clearances
    )
    function = eqx.Partial(_rms_and_steps, turns=turns)
    found = []

    def run() -> None:
        found[:] = run_all(function, scenes, CHUNK)

    # Later chunks run the program of the first.
    first = spent(lambda: next(run_chunks(function, scenes, CHUNK)))
    again = median_spent(run)
    rms, steps = found
    if not np.isfinite(rms).all():
        raise RuntimeError(f"{np.sum(~np.isfinite(rms))} of {designs} designs failed.")
    # Of the process so far: it grows with what is run, so the largest run comes last.
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
    """`jaxcrusher.sweep` with all its statistics, beside the peer by hand, which has the RMS only.

    The peer is written for numba, runs on one core and takes its designs one after the other; it
    is timed by 64 of them.
    """
    peers = programs.designs("contact", SWEEP_TURNS)
    by_hand = programs.numba(peers)
    axes = {"speed": np.linspace(28, 32, side), "clearance": np.linspace(5e-5, 7e-5, side)}
    base = {"start": "contact", "slip": "surface", "friction": programs.FRICTION}

    def run() -> None:
        grid = jc.sweep(axes, 0, SWEEP_TURNS, base=base, rtol=programs.RTOL)
        if not bool(grid.success.all()):
            raise RuntimeError("A design failed.")

    first, _ = spent(run), by_hand()
    began, pairs = time.process_time(), []
    while not pairs or (len(pairs) < REPEATS and time.process_time() - began < LONG):
        pairs.append((spent(run), spent(by_hand)))
    ours, theirs = (Spent(*np.median(runs, axis=0).tolist()) for runs in zip(*pairs, strict=True))
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
    """Value and gradient of the RMS of one quiet motion by `count` parameters, and the value."""
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
    first_value, one = spent(lambda: value(point)), median_spent(lambda: value(point))
    first, again = spent(lambda: both(point)), median_spent(lambda: both(point))
    (_, steps), slopes = both(point)
    if not np.isfinite(slopes).all():
        raise RuntimeError(f"The gradient is not finite: {slopes}.")
    return {
        "parameters": count,
        "value_cpu_s": one.cpu,
        "cpu_s": again.cpu,
        "value_first_cpu_s": first_value.cpu,
        "first_cpu_s": first.cpu,
        "value_steps": int(value(point)[1]),
        "steps": int(steps),
    }


def measure(what: str) -> Iterator[dict[str, Any]]:
    """The rows of one process."""
    if what == "designs":
        yield from (batch(count, DESIGNS_TURNS) for count in DESIGNS)
    elif what == "sweeps":
        yield from (whole_sweep(side) for side in SWEEP_SIDES)
    elif what == "turns":
        yield from (batch(TURNS_DESIGNS, count) for count in TURNS)
    else:
        yield from (gradient(what, count) for count in DIFFERENTIATED)
