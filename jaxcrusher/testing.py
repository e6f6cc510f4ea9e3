"""Checks of your own law, to be run in your own tests.

```python
from jaxcrusher.testing import check_law

check_law(Impact(...))
```
"""

import dataclasses
import itertools
import warnings
from collections.abc import Callable, Iterator, Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxcrusher.basics.checks import nan_unless, require
from jaxcrusher.basics.plane import Vector
from jaxcrusher.batch.engines import in_lanes, in_turn, side_by_side, stack
from jaxcrusher.crusher.loads import AbstractLoad
from jaxcrusher.joint.clearance import AbstractBearing
from jaxcrusher.joint.friction import AbstractFriction
from jaxcrusher.joint.normal import AbstractNormalForce
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.statistics import statistics
from jaxcrusher.scenes.build import build_scene

# Penetrations (m), rates (m/s), normal forces (N) and slips (m/s) where a law is looked at: at its
# corners, close to them, and far off.
DEPTHS = np.array([-1e-4, -2e-8, -1e-8, -1e-9, 0.0, 1e-9, 1e-8, 2e-8, 1e-6, 3e-6, 1e-4])
RATES = np.array([-1.0, -0.01, -1e-6, 0.0, 1e-6, 0.01, 1.0])
FORCES = np.array([0.0, 1.0, 1e4, 1e6])
SLIPS = np.array([-4.0, -1.0, -0.1, -1e-4, -1e-9, 0.0, 1e-9, 1e-4, 0.1, 1.0, 4.0])
# A smoothed corner may move a force of 10 kN by this share.
CORNER = 1e-3
# And it may take this force (N) from a law that never pulls: ten times what docs/own_parts.md
# takes, and a millionth of the weight of a jaw.
CORNER_FORCE = 1e-2
# Power that rounding may seem to put in, of force times speed.
ROUNDING = 1e-12
UNITS = {"penetration": "m", "rate": "m/s", "normal force": "N", "slip": "m/s"}

# Eccentricities in clearances, their rates (m/s) and spins of bearing and journal (rad/s).
PLACES = ((0.3, -0.2), (0.6, 0.8), (0.0, 1.05), (-1.2, 0.9))
SPEEDS = ((0.0, 0.0), (0.03, -0.02), (-0.4, 0.1))
SPINS = ((0.0, 0.0), (-0.4, 30.0), (0.2, -5.0))

Law = AbstractNormalForce | AbstractFriction | AbstractLoad | AbstractBearing


def check_law(law: Law) -> None:
    """Check that a law can be computed with: its values, slopes, power, and the ways to run it.

    Its force is finite and has finite slopes, at the corners too. Damping and friction take power
    and put none in. Action and reaction of a whole bearing balance in moment. One after the other,
    side by side and in lanes, a turn of the crusher with the law is the same to 1e-6. Raises
    ValueError of one line for the first thing that does not hold.
    """
    if isinstance(law, AbstractNormalForce):
        _check_normal(law)
    elif isinstance(law, AbstractFriction):
        _check_friction(law)
    elif isinstance(law, AbstractBearing):
        _check_normal(law.normal)
        _check_bearing(law)
    else:
        kinds = "a normal force, a friction, a load or a bearing"
        good = isinstance(law, AbstractLoad)
        is_class = isinstance(law, type)
        given = f"the class {law.__name__}: give it its numbers" if is_class else repr(type(law))
        require(good, "law", f"be an instance of {kinds}", given)
    _check_engines(law)


def _must(condition: bool | np.bool, must: str, where: str) -> None:
    if not condition:
        raise ValueError(f"Argument `law` must {must}, but fails at {where}.")


def _check_normal(law: AbstractNormalForce) -> None:
    memory = law.impact_velocity.initial()
    depth, rate = (grid.ravel() for grid in np.meshgrid(DEPTHS, RATES))

    def force(depth: Array, rate: Array) -> Array:
        return law.force(depth, rate, memory)

    places = {"penetration": depth, "rate": rate}
    forces = _finite(force, places)
    _finite(law.elastic_force, {"penetration": DEPTHS})
    _finite(law.elastic_energy, {"penetration": DEPTHS})
    elastic = np.asarray(jax.vmap(law.elastic_force)(jnp.asarray(depth)))
    taken = (forces - elastic) * rate + CORNER_FORCE * np.abs(rate)
    _never_negative(taken, np.abs(forces * rate), "take power by its damping", places)
    energy = jax.vmap(jax.grad(law.elastic_energy))(jnp.asarray(DEPTHS))
    apart = np.abs(energy - jax.vmap(law.elastic_force)(jnp.asarray(DEPTHS)))
    size = float(np.abs(energy).max())
    for at, off in zip(DEPTHS, apart, strict=True):
        must = "have an energy whose slope is its elastic force"
        _must(off <= 1e-9 * size, must, _place({"penetration": at}))
    for under in FORCES[2:]:
        at = law.penetration_under(jnp.asarray(under))
        met = float(law.elastic_force(at))
        must = f"have an elastic force of {under:g} N at `penetration_under({under:g})`"
        require(abs(met - under) <= CORNER * under, "law", must, f"{met:g} N there")


def _check_friction(law: AbstractFriction) -> None:
    force, slip = (grid.ravel() for grid in np.meshgrid(FORCES, SLIPS))
    places = {"normal force": force, "slip": slip}
    forces = _finite(law.force, places)
    _never_negative(-forces * slip, np.abs(forces * slip), "take power", places)


def _check_bearing(bearing: AbstractBearing) -> None:
    memory = bearing.initial_memory()

    def balance(x: Array, y: Array, u: Array, v: Array, one: Array, other: Array) -> Array:
        """Return what is lost, and what of power and moment is not accounted for."""
        e, rate = bearing.clearance * Vector(x, y), Vector(u, v)
        touch = bearing.contact(e, rate, one, other, memory)
        moments = touch.bearing_moment, touch.journal_moment
        first, second = (jnp.zeros_like(x) if moment is None else moment for moment in moments)
        stored = bearing.normal.elastic_force(touch.penetration) * touch.penetration_rate
        taken = touch.force.dot(rate) - first * one - second * other - stored
        friction = 0.0 if touch.friction_loss is None else touch.friction_loss
        pushed = jnp.abs(touch.force.x) + jnp.abs(touch.force.y)
        size = jnp.abs(stored) + pushed + jnp.abs(first) + jnp.abs(second)
        moment = first + second - e.cross(touch.force)
        return jnp.stack([touch.normal_loss, taken - touch.normal_loss - friction, moment, size])

    places = list(itertools.product(PLACES, SPEEDS, SPINS))
    at = jnp.asarray(places).reshape(len(places), 6).T
    slopes = jax.vmap(jax.jacobian(balance, argnums=tuple(range(6))))(*at)
    finite = np.isfinite(slopes).all((0, 2))
    for place, found, sloped in zip(places, jax.vmap(balance)(*at), finite, strict=True):
        where = f"e / c, its rate, spins {place}"
        lost, power, moment, size = np.asarray(found)
        _must(np.isfinite([lost, power, moment]).all(), "have finite values", where)
        _must(sloped, "have finite slopes", where)
        small = ROUNDING * (1 + size)
        corner = CORNER_FORCE * np.hypot(*place[1])
        _must(lost >= -small - corner, "take power by its damping", where)
        _must(abs(power) <= small, "lose what its forces take", where)
        _must(abs(moment) <= small, "balance in moment", where)


def _place(at: Mapping[str, float]) -> str:
    """Return a place in words, such as "penetration 1e-06 m, rate -1 m/s"."""
    return ", ".join(f"{name} {value:g} {UNITS[name]}" for name, value in at.items())


def _each(places: Mapping[str, np.ndarray]) -> list[str]:
    """Return each place in words."""
    return [_place(dict(zip(places, at, strict=True))) for at in zip(*places.values(), strict=True)]


def _never_negative(
    power: np.ndarray, size: np.ndarray, must: str, places: Mapping[str, np.ndarray]
) -> None:
    for taken, scale, where in zip(power, size, _each(places), strict=True):
        _must(taken >= -ROUNDING * (1 + scale), must, where)


def _finite(function: Callable, places: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the values at places, which are finite with all their slopes."""
    at = tuple(map(jnp.asarray, places.values()))
    values = np.asarray(jax.vmap(function)(*at))
    slopes = jax.vmap(jax.grad(function, tuple(range(len(at)))))(*at)
    columns = {"values": values}
    columns |= {f"slopes by {name}": slope for name, slope in zip(places, slopes, strict=True)}
    for what, column in columns.items():
        for where, good in zip(_each(places), np.isfinite(column), strict=True):
            _must(good, f"have finite {what}", where)
    return values


def _scenes(law: eqx.Module) -> Iterator[Scene]:
    """Yield crushers with the law."""
    for speed in (27.0, 31.0):
        plain = build_scene({"speed": speed, "clearance": 6e-5, "start": "contact"})
        if isinstance(law, AbstractLoad):
            yield dataclasses.replace(plain, pushes=(law,))
            continue
        if not isinstance(law, AbstractBearing):
            part = "friction" if isinstance(law, AbstractFriction) else "normal"
            law = dataclasses.replace(plain.bearings.at("main"), **{part: law})
        yield plain.with_bearing("main", law)


def _turn(scene: Scene) -> Array:
    result = statistics(scene, 0, 1, outputs=("foundation_rms",))
    return nan_unless(result.success, result.foundation_rms)


def _check_engines(law: eqx.Module) -> None:
    scenes = stack(list(_scenes(law)))
    plain = np.asarray(in_turn(_turn, scenes))
    _must(np.isfinite(plain).all(), "let a turn of the crusher be integrated", "27 and 31 rad/s")
    together = np.asarray(side_by_side(_turn, scenes))
    _must(np.allclose(together, plain, rtol=1e-6), "be the same under jax.vmap", "27 or 31 rad/s")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        lanes = np.asarray(in_lanes(_turn, scenes))
    for warning in told:
        known = "Lanes do not know" not in str(warning.message)
        require(known, "law", "run in lanes", warning.message)
    _must(np.allclose(lanes, plain, rtol=1e-6), "be the same in lanes", "27 or 31 rad/s")
