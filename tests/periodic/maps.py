"""Maps that stand in place of the integrated turn."""

from collections.abc import Callable

import equinox as eqx
import numpy as np

from jaxcrusher.periodic.shooting_problem import AbstractFlow, ShootingProblem


class Map(AbstractFlow):
    """Where a function leads, and what another one watches."""

    leads: Callable = eqx.field(static=True)  # p, states -> ends, jacobians, forcing
    watches: Callable = eqx.field(static=True, default=lambda p, state: np.zeros(0))

    def slices(self, p, states, rtol):
        return self.leads(np.asarray(p), np.asarray(states))

    def monitors(self, p, state, turns):
        return self.watches(np.asarray(p), state)


def of_map(leads, *, slices=1, period=1, watches=None, watched=()):
    """The problem of the orbits of a map."""
    flow = Map(leads) if watches is None else Map(leads, watches)
    return ShootingProblem(flow=flow, period=period, slices=slices, watched=watched)
