"""The motion of every cell of the landscape: what the report's page draws.

A drawing needs the orbit and the force at some hundred instants of the last turns, not their
statistics: it settles like the landscape and stops after two turns, so that it costs about
half of it.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float

import jaxcrusher as jc
from jaxcrusher.basics.checks import require_whole
from jaxcrusher.batch.engines import map_all
from optimize.evaluate import STARTS, Case, Progress, stacked_scenes

# Turns drawn (the second tells whether the first repeats) and instants in each. Peaks of single
# impacts, a tenth of a millisecond wide, fall between the instants.
TURNS, SAMPLES = 2, 256
# Motions between two reports of progress.
CHUNK = 32
# Name -> unit and meaning of what is kept of a motion.
VARIABLES = {
    "eccentricity_x": ("clearance", "eccentricity of the pin to the right"),
    "eccentricity_y": ("clearance", "eccentricity of the pin upwards"),
    "foundation_force": ("N", "|R_O| + |R_C|"),
}


def cell_motions(
    case: Case,
    landscape: xr.Dataset,
    settle: int,
    rtol: float,
    progress: Progress,
    *,
    turns: int = TURNS,
    samples: int = SAMPLES,
) -> xr.Dataset:
    """The last `turns` turns of every cell, from both starts, after `settle` turns.

    **Arguments:**

    - `case`: what the landscape is of.
    - `landscape`: its coordinates are the cells; dims are the design's parameters, or `sample`.
    - `settle`, `turns`, `samples`: whole numbers; turns before, turns drawn, instants in each.
    - `rtol`: as in `jaxcrusher.simulate`.
    - `progress`: called with the number of finished and of all motions.

    **Returns:** an `xarray.Dataset` of 32-bit floats with dim `start`, the landscape's, and
    `instant`: `eccentricity_x` and `eccentricity_y` of the pin in clearances,
    `foundation_force` in N, all NaN where a motion failed; and `ideal_force`, the ideal
    joint's, without `start`. The coordinate `turn` counts from the end of settling.

    Raises ValueError for counts out of range.
    """
    require_whole("settle", settle, 0)
    require_whole("turns", turns, 1)
    require_whole("samples", samples, 8)
    turn = np.arange(turns * samples + 1) / samples
    angles = jnp.asarray(2 * np.pi * (settle + turn))
    units, dims, shape = _cells(case, landscape)
    function = eqx.Partial(_motion, angles=angles, rtol=rtol)
    scenes = stacked_scenes(case, jnp.asarray(units))
    columns = map_all(function, scenes, CHUNK, progress=progress)
    motions = xr.Dataset(
        {
            name: (
                ("start", *dims, "instant"),
                column.astype(np.float32).reshape(len(STARTS), *shape, -1),
            )
            for name, column in columns.items()
        },
        {
            "start": list(STARTS),
            **{name: landscape[name] for name in case.design.names},
            "turn": ("instant", turn),
        },
        {"settle_turns": settle, "rtol": rtol},
    )
    for name, (unit, meaning) in VARIABLES.items():
        motions[name].attrs = {"units": unit, "long_name": meaning}
    ideal = np.asarray(_ideal_force(jnp.asarray(units), angles, case)).astype(np.float32)
    attributes = {"units": "N", "long_name": "|R_O| + |R_C| of the ideal joint"}
    motions["ideal_force"] = ((*dims, "instant"), ideal.reshape(*shape, -1), attributes)
    return motions


def _cells(
    case: Case, landscape: xr.Dataset
) -> tuple[np.ndarray, tuple[str, ...], tuple[int, ...]]:
    """The cells as points of the unit box (cells, n), and the dims and shape they come in."""
    names = case.design.names
    values = [landscape[name].to_numpy() for name in names]
    if "sample" in landscape.dims:
        dims, shape = ("sample",), (landscape.sizes["sample"],)
    else:
        dims, shape = names, tuple(len(axis) for axis in values)
        values = [axis.ravel() for axis in np.meshgrid(*values, indexing="ij")]
    units = case.design.unit(dict(zip(names, values, strict=True)))
    # From the unit box and back, rounding may leave it.
    return np.clip(units, 0, 1), dims, shape


def _motion(scene: jc.Scene, angles: Float[Array, " n"], rtol: float) -> dict[str, Array]:
    """One motion at these shaft angles (rad)."""
    times = angles / scene.drive.speed
    motion = jc.simulate(scene, times, outputs=("foundation_force", "eccentricity"), rtol=rtol)
    orbit = motion.eccentricity / scene.joint.clearance
    return {
        "eccentricity_x": orbit[:, 0],
        "eccentricity_y": orbit[:, 1],
        "foundation_force": motion.foundation_force,
    }


@eqx.filter_jit
def _ideal_force(units: Float[Array, "m n"], angles: Float[Array, " k"], case: Case) -> Array:
    """The ideal joint's foundation force (N): nothing to integrate, so all cells at once."""

    def force(unit):
        scene = case.design.scene(unit).ideal()
        motion = jc.simulate(scene, angles / scene.drive.speed, outputs=("foundation_force",))
        return motion.foundation_force

    return jax.vmap(force)(units)
