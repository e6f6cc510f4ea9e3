"""A motion turn by turn: statistics of each turn, and what is seen in it, in bounded time."""

import logging
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Complex, Float

from jaxcrusher.basics.checks import require_whole
from jaxcrusher.basics.integrate import Integration, Outcome, failure_text, integrate
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.mechanism.reductions import Chosen
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.motion.flow import Flow, initial_state, unflattened
from jaxcrusher.motion.method import resolve
from jaxcrusher.motion.statistics import statistics_problem

# Turns that are integrated at once, and of which progress is told.
CHUNK = 5
# The share of the time that settling may take.
SETTLING = 1 / 3
# What the names of a vector's components end with.
SIDES = ("_x", "_y")

logger = logging.getLogger(__name__)


class Curve(NamedTuple):
    """A number along the pieces of a motion, at equal steps of the phase, and its extremes in each.

    An impact is shorter than the step between two values; the extremes of a run contain it.
    """

    unit: str
    values: Float[Any, "pieces samples"]
    largest: Float[Any, " pieces"]
    least: Float[Any, " pieces"]

    @property
    def moving(self) -> "Curve":
        """Return the curve without its mean."""
        mean = self.values.mean()
        return Curve(self.unit, self.values - mean, self.largest - mean, self.least - mean)

    @property
    def peak(self) -> Float[Any, " pieces"]:
        """Return the largest size in each piece."""
        return np.maximum(self.largest, -self.least)

    @property
    def rms(self) -> Float[Array, " pieces"]:
        """Return the root mean square of each piece; where it is zero, so is its slope."""
        square = jnp.mean(self.values**2, axis=1)
        return jnp.where(square == 0, 0.0, jnp.sqrt(jnp.where(square == 0, 1.0, square)))

    def amplitudes(self, highest: int) -> Complex[Array, "pieces orders"]:
        """Return each piece's complex amplitudes A e^(i phi) of A cos(k theta + phi).

        Order 0 is the mean; the others, up to the `highest`, count periods in a piece.
        """
        # An FFT sums a exp(-i k theta): its angle is the phase of the cosine.
        spectrum = jnp.fft.rfft(self.values, axis=1)[:, : highest + 1] / self.values.shape[1]
        twice = np.where(np.arange(highest + 1) == 0, 1 + 0j, 2 + 0j)  # but for the mean
        return spectrum * twice[None]


def curve_of(unit: str, values: Float[Any, "pieces samples"]) -> Curve:
    """Return a curve whose extremes are among its values."""
    return Curve(unit, values, values.max(axis=1), values.min(axis=1))


@dataclass(frozen=True)
class Turns:
    """Statistics of the pieces of a motion and quantities in them, by name.

    A statistic has the shape (pieces,). A quantity at equal steps of the phase, from phase zero on,
    has the shape (pieces, samples) or (pieces, samples, 2). A piece is `length` turns. A run has a
    piece for each turn, and an orbit one piece, which repeats.
    """

    scene: Scene
    length: int
    values: Mapping[str, Any]
    settled: int = 0  # turns before the first piece
    failure: str = ""  # why a run stopped, or nothing

    def curves(self) -> dict[str, Curve]:
        """Return the curves of the sampled observables; a vector has one for each component."""
        found = {}
        for name, values in self.values.items():
            columns = values.reshape(*values.shape[:2], -1)
            unit, sides = self.scene.observables[name].unit, ("",) if values.ndim == 2 else SIDES
            for i, side in enumerate(sides):
                found[name + side] = curve_of(unit, columns[..., i])
        return found

    @property
    def pieces(self) -> int:
        """Return how many pieces there are."""
        return len(next(iter(self.values.values())))

    @property
    def repeats(self) -> bool:
        """Whether the motion is a periodic orbit, which is known without scatter."""
        return self.pieces == 1


def require_turns(settle: int, turns: int) -> None:
    """Check counts of turns; ValueError for those that are not whole numbers in range."""
    require_whole("settle", settle, 0)
    require_whole("turns", turns, 1)


def run_turns(
    scene: Scene,
    outputs: Chosen,
    *,
    settle: int = 20,
    turns: int = 40,
    seconds: float = 40.0,
    rtol: float = 1e-9,
) -> Turns:
    """Integrate a motion from its start and return the statistics of its turns.

    It logs its progress. Settling ends after a third of the `seconds`. The run ends after all of
    them, but not before 10 turns are seen: `Turns` says how many turns there were.

    **Arguments:**

    - `scene`: what to simulate, with concrete values.
    - `outputs`: names and statistics; those of `jaxcrusher.mechanism.reductions.samples_of` are
      what is seen 1024 times a turn.
    - `settle`, `turns`: the turns before the kept ones, and the kept turns; in steps of five.
    - `seconds`: of wall-clock time after the first five turns.
    - `rtol`: as in `jaxcrusher.statistics`.

    Raises ValueError for counts that are not whole numbers in range.
    """
    require_set_up()
    require_turns(settle, turns)
    how = resolve(scene, rtol)
    state, done, settled, began = initial_state(scene), 0, 0, None
    kept: list[dict[str, np.ndarray]] = []
    before: dict[str, np.ndarray] = {}  # the last instant of settling
    while CHUNK * len(kept) < turns:
        spent = 0.0 if began is None else (time.monotonic() - began) / seconds
        if len(kept) >= 2 and spent > 1:
            break
        settles = done < settle and spent < SETTLING
        last = min(done + CHUNK, settle) if settles else settled + turns
        logger.info(f"turn {done + 1} to {done + CHUNK}, {'settling' if settles else f'of {last}'}")
        phase = jnp.asarray(2 * jnp.pi * done)
        state, values, outcome = _chunk(scene, state, phase, outputs, how)
        if not bool(outcome.success):
            return Turns(scene, 1, {}, settled, failure_text(outcome, "rad of phase"))
        # The first chunk is compiled, which does not count.
        began = time.monotonic() if began is None else began
        done += CHUNK
        seen = {name: np.asarray(one) for name, one in values.items()}
        if settles:
            settled, before = done, {n: one[-1:, -1] for n, one in seen.items() if one.ndim > 1}
        else:
            kept.append(seen)
    joined = {name: np.concatenate([one[name] for one in kept]) for name in kept[0]}
    series = {n: _begun(one, before.get(n)) for n, one in joined.items() if one.ndim > 1}
    return Turns(scene, 1, joined | series, settled)


def _begun(ends: np.ndarray, before: np.ndarray | None) -> np.ndarray:
    """Return samples from the first instant of each turn on, which ends the turn before.

    Without one `before` the first turn's end stands for its beginning.
    """
    first = ends[:1, -1] if before is None else before
    joined = np.concatenate([first, ends.reshape(-1, *ends.shape[2:])[:-1]])
    return joined.reshape(ends.shape)


@eqx.filter_jit
def _chunk(
    scene: Scene, state: Array, phase: Array, outputs: Chosen, method: Integration
) -> tuple[Array, dict[str, Array], Outcome]:
    """Return the state after a chunk of turns, and the outputs by turn."""
    flow = Flow(scene, unflattened(state, scene), phase)
    problem, shares = statistics_problem(flow, outputs)
    times = 2 * jnp.pi * (jnp.arange(CHUNK, dtype=float)[:, None] + shares[None])
    (states, values), outcome = integrate(flow, times, problem=problem, method=method)
    # The phase goes on, and with it the crank's angle: it is not counted from the nearest turn.
    end, _ = ravel_pytree(jax.tree.map(lambda leaf: leaf[-1], states))
    return end.astype(float), values, outcome
