"""Values of several parts that equations are written in, such as a vector or a joint."""

import equinox as eqx


class Record(eqx.Module):
    """An Equinox module whose methods are Python's own.

    Equinox makes a PyTree of each method that is looked up, with all that its object holds, so that
    it may be handed to JAX by itself. Nobody hands over those of a vector, and to trace the
    equations of motion took twice as long with them.
    """

    __getattribute__ = object.__getattribute__
