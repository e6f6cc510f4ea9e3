"""Bifurcation diagrams: section points over a parameter, swept up, down or from cold starts."""

from collections.abc import Callable, Sequence
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, ArrayLike

from jaxcrusher.basics.checks import require, require_choice, require_untraced, require_whole
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.batch.engines import run_all, stack
from jaxcrusher.dynamics.regime import LEAST_TURNS, NOISE
from jaxcrusher.files.table import COLUMNS, columns_of, dataset
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.state import pins_of, places_of
from jaxcrusher.motion.flow import initial_state
from jaxcrusher.motion.indicators import detect_period, spread_trend
from jaxcrusher.motion.section import Section, poincare_section
from jaxcrusher.motion.statistics import of_whirl
from jaxcrusher.scenes.earlier import unnamed
from jaxcrusher.scenes.machine import Machine, machine_of

# The first coordinates of a section point, and what is told of a value besides.
COORDINATES = ("e_x", "e_y", "rate_x", "rate_y")
FLAGS = ("success", "whirl", "settled", "period")


@unnamed("value")
def bifurcation(
    machine: Machine | Callable[..., Scene],
    name: str,
    values: ArrayLike | Sequence[float],
    *,
    direction: Literal["up", "down", "cold"] = "up",
    settle_turns: int,
    turns: int,
    units: str | None = None,
    rtol: float = 1e-9,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Return section points of `turns` turns after `settle_turns`, at each value of a parameter.

    **Arguments:**

    - `machine`: one with clearance and constant speed, as
      `jaxcrusher.paper_machine(start="contact")`, or a function of your own that makes its scenes.
    - `name`: of the number that varies, such as "speed".
    - `values`: shape (n,), increasing.
    - `direction`: `"up"` and `"down"` begin each value with the state that the last one ended
      in (e in clearances and its rate), the first with its scene's start; `"cold"` begins each
      with its scene's start, on all cores. Where up and down differ there is hysteresis.
    - `settle_turns`, `turns`: >= 0 and >= 20.
    - `units`: of the number, for the labels; None is what the machine says.
    - `rtol`: as in `jaxcrusher.statistics`. `progress`: called with the number of finished and of
      all values.

    **Returns:** an `xarray.Dataset`: `e_x`, `e_y` (clearances), `rate_x`, `rate_y` (m/s) and
    the headline statistic of the turn (of a crusher `foundation_rms`, N) with dims `value` and
    `turn`; `success`, `whirl`, `settled` (points that repeat, or whose spread has no trend) and
    `period` (turns, up to 32, 0 for none) with dim `value`. Points of a failed or whirling value
    are NaN. A whirl is handed on; after a failure the next value begins with its scene's start.

    Raises ValueError for arguments out of range, and as `poincare_section` does.
    """
    require_set_up()
    machine = machine_of(machine)
    require_choice("direction", direction, ("up", "down", "cold"))
    require_whole("settle_turns", settle_turns, 0)
    require_whole("turns", turns, LEAST_TURNS)
    require_untraced("values", values, "bifurcation", "jaxcrusher.statistics")
    numbers = np.asarray(values, dtype=float)
    good = numbers.ndim == 1 and numbers.size > 0 and bool((np.diff(numbers) > 0).all())
    require(good, "values", "have shape (n,), n > 0, and increase", values)
    scenes = [machine.scene(**{name: float(number)}) for number in numbers]
    moves = all(len(pins_of(one)) > 0 for one in scenes)
    require(moves, "machine", "have clearance, and the eccentricity formulation", scenes[0])
    first, of = places_of(scenes[0]), scenes[0].headline
    which = jax.tree.leaves((first.eccentricities.values[0], first.rates.values[0]))
    run = eqx.Partial(_run, settle=settle_turns, turns=turns, rtol=rtol)
    count, rows = len(scenes), [{}] * len(numbers)
    if direction == "cold":
        found = jax.tree.map(jnp.asarray, run_all(run, stack(scenes), progress=progress))
        each = (jax.tree.map(lambda leaf, i=i: leaf[i], found) for i in range(count))
        rows = [_row(one, of, which, rtol) for one in each]
    else:
        order = range(count) if direction == "up" else range(count - 1, -1, -1)
        state = None
        for done, i in enumerate(order, 1):
            begin = initial_state(scenes[i]) if state is None else state
            found = run(scenes[i], begin)
            rows[i] = _row(found, of, which, rtol)
            state = found.state if rows[i]["success"] else None
            if progress is not None:
                progress(done, count)
    of = machine.replace(**{name: numbers[0]}).numbers.get(name)
    unit = units or ("1" if of is None else of.unit)
    headline = columns_of(scenes[0].statistics, (scenes[0].headline,))
    kept = {key: COLUMNS[key] for key in COORDINATES}
    kept |= {key: column._replace(dims=("turn",)) for key, column in headline.items()}
    kept |= {key: COLUMNS[key] for key in FLAGS}
    columns = {key: np.stack([row[key] for row in rows]) for key in kept}
    coordinates = {
        "value": ("value", numbers, {"units": unit, "long_name": name}),
        "turn": ("turn", settle_turns + 1 + np.arange(turns), {"units": "1"}),
    }
    attributes = {"direction": direction, "settle_turns": settle_turns}
    return dataset(("value",), columns, kept, coordinates, attributes)


def _run(
    scene: Scene, state: Array | None = None, *, settle: int, turns: int, rtol: float
) -> Section:
    return poincare_section(scene, settle, turns, state=state, outputs=of_whirl(scene), rtol=rtol)


def _row(found: Section, headline: str, which: list[int], rtol: float) -> dict[str, np.ndarray]:
    """Return the diagram's row of one value: `which` numbers of its section points, and more."""
    states, rms = np.array(found.states), np.array(found[headline])
    success, period, settled = bool(found.success), None, False
    whirl = success and bool(found.statistics.whirl)
    if whirl or not success:
        states[:], rms[:] = np.nan, np.nan
    else:
        noise = NOISE * rtol
        period = detect_period(states, noise=noise)
        settled = period is not None or not spread_trend(states, noise=noise)[1]
    row = dict(zip(COORDINATES, states[:, which].T, strict=True)) | {headline: rms}
    flags = zip(FLAGS, (success, whirl, settled, period or 0), strict=True)
    return row | {key: np.asarray(flag) for key, flag in flags}
