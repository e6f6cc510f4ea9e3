"""The settled motion of designs: the objective on it, its exact slopes, and its multipliers."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float

import jaxcrusher as jc
from jaxcrusher.batch import rows as rows_of
from jaxcrusher.batch.engines import run_all, without_lanes
from jaxcrusher.dynamics import orbit_map
from jaxcrusher.dynamics.waiting import waited
from jaxcrusher.motion.statistic import STATISTIC, STATISTICS, Chosen, chosen
from jaxcrusher.settled.forced import from_rest_unless, refusal
from jaxcrusher.settled.result import reason
from optimize.answer import Companion, Settled
from optimize.evaluate import Case, Progress, Rows, started
from optimize.landscape import labelled

# Nodes a turn of maps and descents; what is reported is solved with as many as it takes.
NODES = 96
# Designs solved between two reports of progress. Descents run the same program.
CHUNK = 32
# Slopes are compared with differences over twice this share of the box: shorter ones lose more to
# rounding (1e-10 of the value) than they gain in truncation.
BESIDE = 1e-3
# Random starts of a design that is looked at for other motions, and the turns of each.
ENSEMBLE, ENSEMBLE_TURNS = 16, 480
# Objectives that differ by less, as a share, are of one motion, solved for twice.
SAME = 1e-6
# Name -> unit and meaning of what is kept of an orbit besides the statistics.
VARIABLES = {
    name: orbit_map.VARIABLES[name]
    for name in ("error", "largest_multiplier", "settling_turns", "least_penetration")
}

# A point of the unit box, and a guess of its orbit, or NaN.
_Point = tuple[Float[Array, " n"], Float[Array, "nodes dims"]]


def unsolvable(case: Case) -> str:
    """Why the case's scenes have no orbit to solve for, or nothing."""
    return refusal(case.design.scene(np.full(len(case.design.names), 0.5)))


def solve_map(
    case: Case, units: Float[np.ndarray, "points n"], progress: Progress | None = None
) -> Rows:
    """The settled motions of points of the unit box, as `solve` has them.

    Motions that are not found from the pin at rest are waited for in lanes, and solved for from
    there.
    """
    rows = solve(case, units, progress)
    failed = np.flatnonzero(rows["failure"] != "")
    if not failed.size:
        return rows
    guesses = waited(case.design.scene, units[failed], 1)
    known = np.isfinite(guesses).all(axis=(1, 2))
    if known.any():
        again = solve(case, units[failed[known]], guesses=guesses[known])
        for name, column in rows.items():
            column[failed[known]] = again[name]
    return rows


def solve(
    case: Case,
    units: Float[np.ndarray, "points n"],
    progress: Progress | None = None,
    guesses: Float[np.ndarray, "points angles dims"] | None = None,
) -> Rows:
    """The settled motions of points of the unit box, each from the pin at rest in its bore.

    With `guesses` from these: e / c at equal steps over a turn.

    Rows of shape (points,): `objective`, `stable`, `inside_model`, `counts` (stable and within
    the constraints), statistics, `VARIABLES` and `failure` in words; and `slope` of the objective
    per unit of each free parameter, (points, n). Numbers are NaN where there is a failure.
    """
    count = -len(units) % CHUNK
    padded = np.concatenate([units, np.full((count, units.shape[1]), np.nan)])
    if guesses is None:
        joints = case.design.scene(np.full(len(case.design.names), 0.5)).joints
        guesses = np.full((len(units), NODES, 2 * len(list(joints.present()))), np.nan)
    begin = np.concatenate([guesses, np.full((count, *guesses.shape[1:]), np.nan)])
    function = eqx.Partial(_row, case=case)

    def report(done: int, _: int) -> None:
        if progress is not None:
            progress(min(done, len(units)), len(units))

    rows = run_all(function, (padded, begin), CHUNK, without_lanes(), report)
    rows = jax.tree.map(lambda column: column[: len(units)], rows)
    rows["slope"] = rows["slope"] / widths(case)
    capacity = case.capacity(units) >= case.capacity_floor * (1 - 1e-12)
    inside = rows["inside_model"] if case.inside_model else True
    rows["counts"] = rows["stable"] & capacity & inside & np.isfinite(rows["objective"])
    # Most results are one and the same.
    results = rows.pop("result")
    codes, which = np.unique(jax.tree.leaves(results)[0], return_inverse=True)
    first = [int(np.argmax(which == i)) for i in range(len(codes))]
    words = [reason(jax.tree.map(lambda leaf, i=i: leaf[i], results)) for i in first]
    return rows | {"failure": np.array(words, object)[which]}


def widths(case: Case) -> Float[np.ndarray, " n"]:
    """Of the box, in each parameter's unit."""
    return np.array([high - low for low, high in case.design.bounds.values()])


def _row(
    point: tuple[Float[Array, " n"], Float[Array, "nodes dims"]], case: Case
) -> dict[str, Any]:
    """What is kept of a point; of one that is NaN, which fills a chunk up, zeros at no cost."""
    outputs = chosen(STATISTIC)
    like = eqx.filter_eval_shape(_orbit, point, case, outputs)

    def nothing(_: _Point) -> dict[str, Any]:
        return jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), like)

    return jax.lax.cond(
        jnp.isnan(point[0][0]), nothing, lambda point: _orbit(point, case, outputs), point
    )


@eqx.filter_jit
def _orbit(point: _Point, case: Case, outputs: Chosen) -> dict[str, Any]:
    """What is kept of a point; the objective is one of `outputs`, or made of them."""
    unit, guess = point

    def objective(unit: Array):
        described = case.design.description(unit)
        scene = jc.build_scene(described)
        first = None if scene.is_ideal else from_rest_unless(guess, scene, 1)
        orbit = jc.periodic_orbit(scene, nodes=NODES, guess=first)
        return case.objective.formula(orbit, scene, case.chamber_of(described)), orbit

    (value, orbit), slope = jax.value_and_grad(objective, has_aux=True)(unit)
    row = {name: orbit[name] for name in STATISTICS}
    row |= {name: getattr(orbit, name) for name in (*VARIABLES, "stable", "result")}
    return row | {
        "objective": jnp.where(orbit.success, value, jnp.nan),
        "slope": jnp.where(orbit.success, slope, jnp.nan),
        "inside_model": orbit.validity.inside,
    }


def mapped(case: Case, units: np.ndarray, cells: tuple[int, int], rows: Rows) -> xr.Dataset:
    """Rows of a grid's or a sequence's points, labelled."""
    of = case.objective
    meanings: dict[str, tuple[str, str]] = {
        **{name: (STATISTIC[name].unit, STATISTIC[name].meaning) for name in STATISTICS},
        **VARIABLES,
        "objective": (of.unit, of.meaning),
        "slope": (of.unit, f"slope of the {of.meaning}, per unit of the parameter"),
        "stable": ("1", orbit_map.LOGICAL["stable"]),
        "inside_model": rows_of.VARIABLES["inside_model"],
        "counts": ("1", "may be chosen: a stable motion inside the constraints"),
        "failure": ("1", "why there is no orbit"),
    }
    return labelled(case.design, units, cells, rows, meanings, {"slope": "parameter"})


def count(orbits: xr.Dataset | None) -> int | None:
    """Return how many points of a map have a stable orbit, None where none is solved for."""
    return None if orbits is None else int(orbits.stable.sum())


def looked_at(case: Case, unit: Float[np.ndarray, " n"]) -> Settled | None:
    """The settled motion of one point, with as many nodes as it takes, integrated round once.

    Its slopes stand beside central differences of settled motions. None where there is no orbit
    to solve for.
    """
    if unsolvable(case):
        return None
    described = {**case.design.fixed, **case.design.numbers(unit)}
    scene = jc.build_scene(described)
    orbit = jc.periodic_orbit(scene)
    beside = BESIDE * np.eye(len(unit))
    rows = solve(case, np.concatenate([unit[None], unit + beside, unit - beside]))
    above, below = np.split(rows["objective"][1:], 2)
    slopes, names = rows["slope"][0], case.design.names
    apart = np.abs((above - below) / (2 * BESIDE * widths(case)) - slopes)
    value = case.objective.formula(orbit, scene, case.chamber_of(described))
    modulus = np.abs(orbit.multipliers)
    return Settled(
        failure=orbit.failure,
        objective=float(value) if bool(orbit.success) else float("nan"),
        foundation_rms=float(orbit.foundation_rms),
        foundation_peak=float(orbit.foundation_peak),
        shaking_rms=float(orbit.shaking_rms),
        shaking_peak=float(orbit.shaking_peak),
        error=float(orbit.error),
        multipliers=[[float(m.real), float(m.imag)] for m in orbit.multipliers],
        largest_multiplier=float(modulus.max(initial=0.0)),
        settling_turns=float(orbit.settling_turns),
        least_penetration=float(orbit.least_penetration),
        section=np.asarray(orbit.eccentricity)[0],
        state=np.asarray(orbit.section),
        validity=orbit.validity,
        slopes=dict(zip(names, slopes.tolist(), strict=True)),
        slopes_apart=dict(zip(names, apart.tolist(), strict=True)),
    )


def companions(case: Case, values: dict[str, float]) -> tuple[Companion, ...]:
    """The stable motions of a design that random starts about the centred one come to."""
    described = {**case.design.fixed, **values}
    scene, chamber = started(described, "centred"), case.chamber_of(described)
    found = jc.settled_motions(scene, starts=ENSEMBLE, turns=ENSEMBLE_TURNS)
    return tuple(
        Companion(
            share,
            orbit.period,
            float(case.objective.formula(orbit, scene, chamber)),
            float(orbit.foundation_rms),
            float(orbit.foundation_peak),
            float(orbit.shaking_rms),
            float(orbit.least_penetration),
            float(orbit.settling_turns),
        )
        for orbit, share in zip(found.orbits, found.shares, strict=True)
        if share > 0
    )


def worse(one: float, other: float) -> bool:
    """Whether an objective is above another by more than two solutions of one motion are apart."""
    return one - other > SAME * abs(other)
