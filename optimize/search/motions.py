"""Motions to be drawn: of every cell of the landscape for the report's page, and of designs.

A drawing needs the orbit and the force at some hundred instants of two turns, not their
statistics: it goes on where the landscape's window ended.
"""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float

import jaxcrusher as jc
from jaxcrusher.batch.engines import chunk_of, run_all, stack
from jaxcrusher.files.table import Column, dataset
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.simulation import Trajectory, leading_force
from optimize.answer import Confirmed
from optimize.ask.problem import Problem
from optimize.search.evaluate import NOWHERE, Tracking, stacked_scenes, started

# Instants drawn, 256 in each of two turns, of which the second tells whether the first repeats.
# Peaks of single impacts, a tenth of a millisecond wide, fall between them.
TURN = np.arange(2 * 256 + 1) / 256
# The tolerance of the motions of designs that were run for long.
FINE = 1e-9
# Motions between two reports of progress; on a GPU more.
CHUNK = 32
# What is kept of a motion.
KEPT = {
    "eccentricity_x": Column("clearance", "eccentricity of the pin to the right"),
    "eccentricity_y": Column("clearance", "eccentricity of the pin upwards"),
    "force": Column("N", "|R_O| + |R_C|, or the shaking force of what is no crusher"),
}


def drawn(scene: Scene) -> tuple[str, str]:
    """Return the observables that are drawn of a motion: the force, and where the first pin is."""
    return leading_force(scene), f"{scene.prefix(scene.joints.names[0])}eccentricity"


def cell_motions(
    problem: Problem,
    units: Float[np.ndarray, "points n"],
    landscape: xr.Dataset,
    rtol: float,
    tracking: Tracking = NOWHERE,
    turn: Float[np.ndarray, " instants"] = TURN,
) -> tuple[xr.Dataset, int]:
    """The motion of every cell, from both starts, after the turns of the landscape.

    **Arguments:**

    - `problem`: what the landscape is of.
    - `units`: the landscape's points.
    - `landscape`: with the `state` of every cell to go on from.
    - `rtol`: as in `jaxcrusher.simulate`.
    - `turn`: instants in turns after the landscape's.

    **Returns:** an `xarray.Dataset` of 32-bit floats with dim `start`, the landscape's, and
    `instant`: `eccentricity_x` and `eccentricity_y` of the pin in clearances,
    `force` in N, all NaN where a motion failed; and `ideal_force`, the ideal
    joints', without `start`. The coordinate `turn` counts from the landscape's end. Also the
    integration steps taken.
    """
    angles, points = jnp.asarray(2 * np.pi * turn), jnp.asarray(units)
    states = landscape.state.to_numpy().reshape(-1, landscape.sizes["coordinate"])
    function = eqx.Partial(_motion, angles=angles, rtol=rtol)
    batch = (stacked_scenes(problem, points, jnp.zeros((len(points), 2))), states)
    at_once = chunk_of(len(states), usual=CHUNK)
    found = tracking.run(function, batch, at_once)
    steps = int(found.pop("steps").sum())
    *dims, _ = map(str, landscape.state.dims)
    *shape, _ = landscape.state.shape
    columns = {name: column._replace(dims=(*dims, "instant")) for name, column in KEPT.items()}
    ideal = Column("N", "the same force with ideal joints", dims=(*dims[1:], "instant"))
    columns["ideal_force"] = ideal
    values = {name: column.reshape(*shape, -1) for name, column in found.items()}
    values["ideal_force"] = np.asarray(_ideal_force(points, angles, problem)).reshape(
        *shape[1:], -1
    )
    values = {name: column.astype(np.float32) for name, column in values.items()}
    coordinates = {name: landscape[name] for name in ("start", *problem.design.names)}
    return dataset((), values, columns, coordinates | {"turn": ("instant", turn)}), steps


def design_motions(
    problem: Problem, designs: Sequence[Confirmed], turns: Float[np.ndarray, " n"]
) -> list[dict[str, Trajectory]]:
    """Return each design's motion after its long runs, by start, at these turns."""
    batch = [
        (
            started(problem.design, one.values, start),
            np.asarray(run.state),
            2 * np.pi / one.speed * turns,
        )
        for one in designs
        for start, run in one.transient.items()
    ]
    found = run_all(_drawn, stack(batch))
    each = (jax.tree.map(lambda leaf, i=i: jnp.asarray(leaf[i]), found) for i in range(len(batch)))
    return [{start: next(each) for start in one.transient} for one in designs]


def _drawn(batch: tuple[Scene, Array, Array]) -> Trajectory:
    scene, state, times = batch
    return jc.simulate(scene, times, outputs=drawn(scene), state=state, rtol=FINE)


def _size(force: Array) -> Array:
    return force if force.ndim == 1 else jnp.hypot(force[:, 0], force[:, 1])


def _motion(batch: tuple[Scene, Array], angles: Float[Array, " n"], rtol: float):
    """One motion at these shaft angles (rad), and its steps."""
    scene, state = batch
    times = angles / scene.drive.speed
    force, place = drawn(scene)
    motion = jc.simulate(scene, times, outputs=(force, place), state=state, rtol=rtol)
    orbit = motion[place] / scene.joints.values[0].clearance
    return {
        "eccentricity_x": orbit[:, 0],
        "eccentricity_y": orbit[:, 1],
        "force": _size(motion[force]),
        "steps": motion.outcome.steps,
    }


@eqx.filter_jit
def _ideal_force(units: Float[Array, "m n"], angles: Float[Array, " k"], problem: Problem) -> Array:
    """The force with ideal joints (N): nothing to integrate, so all cells at once."""
    name = leading_force(problem.scene)

    def force(unit):
        scene = problem.design.scene(unit).ideal()
        return _size(jc.simulate(scene, angles / scene.drive.speed, outputs=(name,))[name])

    return jax.vmap(force)(units)
