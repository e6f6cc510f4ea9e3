"""Guesses of the orbits of many designs at once, from motions that are waited for in lanes."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxcrusher.batch.engines import Engine, run_all
from jaxcrusher.crusher.scene import Scene
from jaxcrusher.lanes.code import LANES
from jaxcrusher.settled.transient import one_period, resting_start, section_mean


def waited(
    scene: Callable[[Any], Scene], cases: PyTree, period: int, engine: Engine | None = None
) -> Float[np.ndarray, "cases angles dims"]:
    """The motions over `period` turns that the scenes of stacked `cases` come to, as guesses.

    NaN where the integration fails, and where a joint loses contact: collocation finds no such
    orbit.
    """
    count = len(jax.tree.leaves(cases)[0])
    # As many as fill all lanes, so that few sizes are compiled.
    index = np.minimum(np.arange(-(-count // LANES) * LANES), count - 1)

    def start(case: Any) -> tuple[Array, Scene]:
        return resting_start(scene(case))

    states, scenes = jax.vmap(start)(jax.tree.map(lambda leaf: np.asarray(leaf)[index], cases))
    mean, seen = (eqx.Partial(look, period=period) for look in (section_mean, one_period))
    means, _, ended = run_all(mean, (states, scenes), engine=engine)
    found, good = run_all(seen, (means, scenes), engine=engine)
    apart = np.linalg.norm(found.reshape(*found.shape[:2], -1, 2), axis=3)
    kept = ended & good & np.all(apart > 1, axis=(1, 2))
    return np.where(kept[:, None, None], found, np.nan)[:count]
