"""A small problem that has a bit of everything, for lanes to integrate."""

from typing import Any

import diffrax
import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxcrusher.basics.following import Following, Instant
from jaxcrusher.basics.integrate import (
    Carried,
    InitialValueProblem,
    Integration,
    integrate,
    pi_controller,
)
from jaxcrusher.mechanism.reductions import LARGEST

SEGMENTS, INSTANTS = 3, 20
TIMES = jnp.arange(float(SEGMENTS))[:, None] + jnp.arange(1, INSTANTS + 1)[None] / INSTANTS


class Swing(eqx.Module):
    """x'' = force - stiffness sin x - x (1 + x^2)^exponent, and `blow` x'^2 that ends it early."""

    stiffness: Any
    blow: Any
    exponent: Any


def _initial(swing):
    return Carried((jnp.full((), 0.5), 1 / swing.stiffness), {"work": jnp.zeros(())})


def field_of(time, y, swing):
    place, rate = y.motion
    force = jnp.cos(3 * time) - swing.stiffness * jnp.sin(place) + swing.blow * rate**2
    force -= place * (1 + place**2) ** swing.exponent
    return Carried((rate, force), {"work": force * rate})


def _observe(time, y, swing):
    place, rate = y.motion
    return {"place": place * 2, "both": jnp.stack([rate, time + y.totals["work"]])}


def _summarise(seen, end, kept):
    return {
        "last": seen["both"][-1],
        "mean": jnp.mean(seen["place"]),
        "most": end.totals["work"],
        "kept": (LARGEST.of_kept(kept[:-1], 1.0), kept[-1]),
    }


def _watch(time, y, swing):
    return {"place": y.motion[0], "power": y.motion[1] * jnp.cos(3 * time)}


def _follow(kept, before, start, end):
    """Return the top of the power, and a sum that begins with a number."""
    *most, total = kept
    powers = (Instant(at.time, at.seen["power"]) for at in (before, start, end))
    step = 0.5 * (end.time - start.time) * (start.seen["place"] + end.seen["place"])
    return *LARGEST.follow(tuple(most), *powers), total + step


def _begin(swing):
    return *LARGEST.begin(), 0.5


FOLLOWING = Following(_begin, _watch, _follow)
# What parabolas and trapezia leave of the steps, which rounding moves: one in some hundred fails.
OF_STEPS = 1e-4
PROBLEM = InitialValueProblem(_initial, field_of, _observe, _summarise, FOLLOWING)


def run_of(swing, solver=None, rtol=1e-9, max_steps=10_000, times=TIMES, problem=PROBLEM):
    controller = pi_controller(rtol)
    method = Integration(solver or diffrax.Tsit5(), controller, max_steps, 1e-3, None)
    found, outcome = integrate(swing, times, problem=problem, method=method)
    return found, outcome


def swings_of(count, seed=0):
    stiffness = np.random.default_rng(seed).uniform(1, 400, count)
    return Swing(stiffness, np.zeros(count), np.full(count, 1.5))


def again(swing):
    """An integration whose numbers another one has found."""
    found, outcome = run_of(swing)
    stiffness = swing.stiffness + 1e-3 * found["mean"][-1]
    return run_of(Swing(stiffness, swing.blow, swing.exponent))[0]["last"], outcome.steps
