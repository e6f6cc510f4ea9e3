"""Quantities that are followed from step to step of an integration, such as a peak.

A hard impact is shorter than the spacing of any affordable grid of instants, but it always lasts
several steps of the integrator. The followed quantities affect neither the motion nor its error.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree, Scalar
from typing_extensions import override


class Instant(NamedTuple):
    """What is seen at a time."""

    time: Scalar
    seen: PyTree[Array]


class Following(eqx.Module):
    """The functions that follow a motion, whose numbers are `args`."""

    # What is kept before the first step: args -> kept; plain numbers, unless they have tangents.
    begin: Callable[[PyTree], PyTree]
    # Looks at an instant: time, state, args -> seen. It is jitted, so that it is traced once.
    watch: Callable[[Any, Any, PyTree], PyTree] = eqx.field(converter=jax.jit)
    # Takes account of a step: kept, the instants at the start of the step before it, at its own
    # start and at its end -> kept. Before the first step is none, and its own start stands for it.
    follow: Callable[[PyTree, Instant, Instant, Instant], PyTree]


class Followed(eqx.Module):
    """A state of an integration, what is kept, and the last two instants."""

    state: Any
    kept: PyTree[Array]
    before: Instant
    now: Instant


def first_followed(following: Following, time: Scalar, state: Any, args: PyTree) -> Followed:
    """Return the first `Followed` of a motion that starts at a state."""
    now = Instant(time, following.watch(time, state, args))
    return Followed(state, jax.tree.map(jnp.asarray, following.begin(args)), now, now)


def rates(time: Any, y: Any, args: PyTree, field: Callable[[Any, Any, PyTree], Any]) -> Any:
    """Return the rates of a state, or those of a `Followed`, whose shapes diffrax needs."""
    if not isinstance(y, Followed):
        return field(time, y, args)
    still = jax.tree.map(jnp.zeros_like, y)
    return dataclasses.replace(still, state=field(time, y.state, args))


def state_alone(time: Scalar, y: Any, args: PyTree) -> Any:
    """Return the state alone, also of a `Followed`: diffrax is to save nothing else."""
    return y.state if isinstance(y, Followed) else y


class FollowingSolver(diffrax.AbstractWrappedSolver):
    """Takes the steps of a solver, and follows the values at their ends; its state is `Followed`.

    Inside a step only the wrapped solver's own state is interpolated.
    """

    solver: diffrax.AbstractSolver
    following: Following

    @property
    @override
    def term_structure(self):
        return self.solver.term_structure

    @property
    @override
    def interpolation_cls(self):  # pyright: ignore
        return self.solver.interpolation_cls

    @property
    @override
    def term_compatible_contr_kwargs(self):
        return self.solver.term_compatible_contr_kwargs

    @property
    def scan_kind(self):
        """Return the loop kind of the solver, which `diffrax.ForwardMode` replaces."""
        return self.solver.scan_kind  # pyright: ignore

    @override
    def order(self, terms):
        return self.solver.order(terms)

    @override
    def strong_order(self, terms):
        return self.solver.strong_order(terms)

    @override
    def error_order(self, terms):
        return self.solver.error_order(terms)

    @override
    def init(self, terms, t0, t1, y0, args):
        return self.solver.init(terms, t0, t1, y0.state, args)

    @override
    def func(self, terms, t0, y0, args):
        return self.solver.func(terms, t0, y0.state, args)

    @override
    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        """Take a step, and update the followed numbers."""
        state, error, dense, solver_state, result = self.solver.step(
            terms, t0, t1, y0.state, args, solver_state, made_jump
        )
        end = Instant(jnp.asarray(t1), self.following.watch(t1, state, args))
        kept = self.following.follow(y0.kept, y0.before, y0.now, end)
        y1 = Followed(state, kept, y0.now, end)
        none = jax.tree.map(jnp.zeros_like, y1)
        return y1, Followed(error, none.kept, none.before, none.now), dense, solver_state, result
