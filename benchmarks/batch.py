"""One function of many scenes, side by side."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import jax
import numpy as np

import jaxcrusher as jc
from jaxcrusher.batch.engines import stack


def map_scenes(function: Callable[[jc.Scene], Any], scenes: Sequence[jc.Scene]) -> list[Any]:
    """Apply a function to each scene; those of one structure run side by side."""
    kinds = [jax.tree.structure(scene) for scene in scenes]
    found: dict[int, Any] = {}
    for kind in dict.fromkeys(kinds):
        places = [i for i, other in enumerate(kinds) if other == kind]
        results = jc.map_all(function, stack([scenes[i] for i in places]))
        for at, i in enumerate(places):
            found[i] = jax.tree.map(lambda leaf, at=at: np.asarray(leaf[at]), results)
    return [found[i] for i in range(len(scenes))]


def stacked(results: Iterable[dict[str, Any]]) -> dict[str, np.ndarray]:
    """Stack results of the same names, shape (results, ...)."""
    results = list(results)
    return {name: np.stack([one[name] for one in results]) for name in results[0]}
