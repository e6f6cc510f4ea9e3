"""Inputs that no motion belongs to: each must be refused with a message, before or in a run."""

from collections.abc import Callable, Iterator
from typing import Any

import equinox as eqx
import jax
import numpy as np

import jaxcrusher as jc
from benchmarks.stability.judgement import DISAGREES, REFUSED, Judged, rms_of
from jaxcrusher.basics.plane import Vector, scalar
from jaxcrusher.mechanism.starts import Given
from jaxcrusher.motion.statistics import Statistics

NUMBERS = {
    "clearance": (0.0, -1e-6, float("nan"), 0.13, 1.0),
    "speed": (0.0, -30.0, float("inf"), float("nan")),
    "young": (0.0, float("inf")),
    "restitution": (0.0, 1.1, float("nan")),
    "friction": (-0.1, 11.0, float("nan")),
    "load": (-1.0, 1e10, float("inf")),
    "jaw.mass": (0.0, -1.0, float("nan")),
    "jaw.length": (2.0,),
}
# e in clearances and e' in m/s: beyond the linkage's reach, or not a number.
STARTS = {
    "e = 1 m": (1 / 0.06e-3, 0.0),
    "e = NaN": (float("nan"), 0.0),
    "e' = NaN": (0.0, float("nan")),
    "e' = 1e6 m/s": (0.0, 1e6),
    "e' = 1e200 m/s": (0.0, 1e200),
}
# Traced values pass every check.
TRACED: dict[str, tuple[Callable[[Any], jax.Array], float]] = {
    "clearance, traced": (lambda s: s.joints.at("main").clearance, float("nan")),
    "clearance < 0, traced": (lambda s: s.joints.at("main").clearance, -1e-3),
    "speed, traced": (lambda s: s.drive.speed, float("inf")),
    "stiffness, traced": (lambda s: s.joints.at("main").normal.stiffness, float("inf")),
    "jaw mass, traced": (lambda s: s.linkage.bodies.at("jaw").mass, float("nan")),
    "load, traced": (lambda s: s.pushes[0].magnitude, 1e300),
}


def inputs() -> Iterator[Judged]:
    """Try them all."""
    for name, values in NUMBERS.items():
        for value in values:
            yield attempt(name, f"{value:g}", lambda n=name, v=value: run(jc.build_scene({n: v})))
    base = jc.build_scene({"friction": 0.02, "slip": "surface"})
    for label, (relative, rate) in STARTS.items():
        start = Given({"main": Vector(relative, 0.0)}, {"main": Vector(rate, 0.0)})
        scene = eqx.tree_at(lambda s: s.start, base, start)
        yield attempt("start", label, lambda s=scene: run(s))
    for label, (where, value) in TRACED.items():
        scene = eqx.tree_at(where, base, scalar(value))
        yield attempt(label, f"{value:g}", lambda s=scene: run(s))
    yield attempt("float32", "x64 off", lambda: without_x64(base))
    yield attempt("float32", "in a context", in_context)
    yield attempt("float32", "a scene cast to it", lambda: run(cast(base)))


def run(scene: jc.Scene) -> Statistics:
    """Integrate two turns."""
    return jc.statistics(scene, 1, 1, method=jc.Method(max_steps=100_000))


def without_x64(scene: jc.Scene) -> Statistics:
    """Run with 64-bit floats off."""
    jax.config.update("jax_enable_x64", False)
    try:
        return run(scene)
    finally:
        jax.config.update("jax_enable_x64", True)


def in_context() -> Statistics:
    """Run with 64-bit floats off in this thread only."""
    with jax.enable_x64(False):
        return run(jc.build_scene({}))


def cast(scene: jc.Scene) -> jc.Scene:
    """Return the scene in 32-bit floats."""
    return jax.tree.map(lambda leaf: leaf.astype(np.float32) if eqx.is_array(leaf) else leaf, scene)


def attempt(what: str, value: str, job: Callable[[], Statistics]) -> Judged:
    """Judge an input: a ValueError or a failure refuses it, and any number is wrong."""
    labels = (what, value, "", "")
    try:
        found = job()
    except ValueError as error:
        return Judged(*labels, REFUSED, "", str(error))
    if not found.success:
        return Judged(*labels, REFUSED, "", found.failure)
    return Judged(*labels, DISAGREES, "no", f"RMS {rms_of(found):.6g} N")
