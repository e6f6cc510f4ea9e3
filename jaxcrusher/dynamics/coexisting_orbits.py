"""The stable motions that a machine comes to from many starts, and how many come to each.

Of one machine, or of a grid of them.
"""

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import numpy as np
import xarray as xr
from jaxtyping import Float, Int
from typing_extensions import override

from jaxcrusher.basics.checks import require, require_positive, require_untraced, require_whole
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.batch.cluster import connected
from jaxcrusher.batch.engines import computing, run_all
from jaxcrusher.batch.points import Grid, make_grid
from jaxcrusher.batch.store import Layout, opened
from jaxcrusher.files import svg
from jaxcrusher.files.summary import Summarised, Summary
from jaxcrusher.files.table import COLUMNS
from jaxcrusher.files.text import number
from jaxcrusher.lanes.code import LANES
from jaxcrusher.mechanism.scene import Scene, require_scene, require_steady
from jaxcrusher.mechanism.state import pins_of
from jaxcrusher.motion.flow import initial_state
from jaxcrusher.orbits.oscillation import NEAR, Oscillation, distance, oscillation_about, section_of
from jaxcrusher.orbits.periodic_orbit import periodic_orbit
from jaxcrusher.orbits.result import PeriodicOrbit
from jaxcrusher.orbits.shot import shoot
from jaxcrusher.orbits.transient import TRANSIENT_RTOL, section_points
from jaxcrusher.scenes.earlier import axes_first
from jaxcrusher.scenes.machine import Machine, machine_of

if TYPE_CHECKING:
    import distributed

# A run is looked at so many times; the orbits searched for, and a multiple of all their periods.
LOOKS, PERIODS, CYCLE = 4, (1, 2, 3, 4), 12
# A motion oscillates about an orbit of few turns if its spread about their means is, to this factor
# and within this slack in clearances, no wider than that about the means of a whole cycle.
AS_NARROW, SLACK = 1.25, 1e-4
# The mean of a wider oscillation, in clearances, is no guess of an orbit.
WIDE = 0.1
# An oscillation no wider, in clearances, is shot for at once; others may yet narrow.
NARROW = 0.01
# Two orbits whose RMS agrees so well are one, unless they are mirror images.
SAME = 1e-6
# Searches that fail, after which no more begins: each costs as much as all the starts.
MOST_FAILURES = 3


@dataclass(frozen=True, repr=False)
class CoexistingOrbits(Summarised):
    """Stable orbits, the most frequent first, and which start comes to which.

    An orbit that no start came to has a share of 0. Another spread of the starts gives other
    shares.
    """

    orbits: tuple[PeriodicOrbit, ...]
    starts: Float[np.ndarray, "starts dims"]  # section points
    labels: Int[np.ndarray, " starts"]  # places in `orbits`; -1: the start came to none
    unsettled: dict[str, float]  # shares of starts that came to none, by reason

    @property
    def shares(self) -> tuple[float, ...]:
        """Return the share of starts that comes to each orbit; with those unsettled 1 in all."""
        return tuple(float(np.mean(self.labels == i)) for i in range(len(self.orbits)))

    @property
    def share_errors(self) -> tuple[float, ...]:
        """Return the standard error of each share.

        If k of n starts came, it is the standard deviation of the beta distribution with k + 1 and
        n - k + 1, which assumes no knowledge of the share. It is not 0 where none or all came.
        """
        n = len(self.labels)
        means = [(share * n + 1) / (n + 2) for share in self.shares]
        return tuple(float(np.sqrt(mean * (1 - mean) / (n + 3))) for mean in means)

    @override
    def _summary(self) -> Summary:
        count = f"{len(self.orbits)} stable orbits, {len(self.labels)} starts"
        return Summary(f"CoexistingOrbits: {count}", (), str(self).splitlines())

    @override
    def _picture(self) -> str:
        paths = [orbit.eccentricity for orbit in self.orbits if orbit.eccentricity is not None]
        return svg.pins_in_bores([path[:, :2] for path in paths]) if paths else ""

    @override
    def __str__(self) -> str:
        lines = [
            f"{share:.0%} ± {error:.0%} period {orbit.period}: "
            f"RMS {float(orbit[orbit.scene.headline]):.2f} N, "
            f"peak {number(float(orbit[orbit.scene.headline.replace('rms', 'peak')]))} N, "
            f"least penetration {float(orbit.least_penetration):.2g} clearances, "
            f"settles in {float(orbit.settling_turns):.3g} turns"
            for orbit, share, error in zip(self.orbits, self.shares, self.share_errors, strict=True)
        ]
        return "\n".join(lines + [f"{share:.0%} {why}" for why, share in self.unsettled.items()])


def coexisting_orbits(
    scene: Scene, *, starts: int = 32, spread: float = 0.5, turns: int = 1000, seed: int = 0
) -> CoexistingOrbits:
    """Find the stable orbits that `starts` random starts come to, and solve for each.

    The scene's start is shifted by up to `spread` clearances in any direction. Each motion is
    integrated over `turns` turns (or up to three more) and looked at four times. Where it
    oscillates about a point that repeats after one to four turns, shooting starts from there
    (`jaxcrusher.orbits.shot`), with or without loss of contact. Oscillations take thousands of
    turns to decay. A motion has therefore come to an orbit if it oscillates about it and keeps
    contact, or if its oscillation is smaller at the end than half-way. The quiet orbit, from the
    pin resting in its bore, is searched for too.

    Raises ValueError for a count, spread or turns out of range, and in one line for a scene that
    `jaxcrusher.periodic_orbit` refuses or whose joint is ideal.
    """
    require_scene(scene)
    require_steady(scene)
    require_untraced("scene", scene, "coexisting_orbits", "jaxcrusher.periodic_orbit")
    _require_asked(starts, spread, turns, seed)
    require(not scene.is_ideal, "scene", "have a joint with clearance", "ideal ones")
    quiet = periodic_orbit(scene, effort="thorough")
    known = _Known(scene, [quiet] if bool(quiet.stable) else [])
    length = -(-turns // LOOKS)
    advance = eqx.Partial(section_points, turns=length, rtol=TRANSIENT_RTOL)
    pins = pins_of(scene)
    begun, going = _shifted(scene, pins, starts, spread, seed), list(range(starts))
    state, labels = begun.copy(), np.full(starts, -1)
    looks: list[dict[int, _Oscillations]] = []
    failed = 0
    for look in range(LOOKS):
        if not going:
            break
        cases = state[going], jax.tree.map(lambda *leaves: np.stack(leaves), *len(going) * [scene])
        states, _, outcome = run_all(advance, cases, len(going), whole=LANES)
        state[going], success = states[:, -1], np.asarray(outcome.success)
        failed += int(np.sum(~success))
        ended = zip(going, states, success, strict=True)
        seen = {n: _oscillations(s, pins) for n, s, good in ended if good}
        looks.append(seen)
        # The narrowest first: it leads to an orbit best.
        going = []
        for start in sorted(seen, key=lambda n: _shortest(seen[n]).spread):
            one = _shortest(seen[start])
            place = known.about(one, NARROW if look < LOOKS - 1 else WIDE)
            if place is not None and known.surely_decays(place, one):
                labels[start] = place
            else:
                going.append(start)
    for start in going:
        place = known.approached(looks[LOOKS // 2 - 1][start], looks[-1][start])
        labels[start] = -1 if place is None else place
    order = sorted(range(len(known.orbits)), key=lambda i: -np.sum(labels == i))
    ranks = np.argsort([*order, len(order)])  # the last stands for none
    reasons = {
        "failed to integrate": failed,
        f"come to no orbit of up to {PERIODS[-1]} turns after {LOOKS * length}": (
            int(np.sum(labels < 0)) - failed
        ),
    }
    return CoexistingOrbits(
        tuple(known.orbits[i] for i in order),
        begun,
        np.where(labels < 0, -1, ranks[labels]),
        {why: count / starts for why, count in reasons.items() if count},
    )


def _require_asked(starts: int, spread: float, turns: int, seed: int) -> None:
    """Refuse numbers of a search that are out of range."""
    require_whole("starts", starts, 1)
    require_positive("spread", spread, "clearances")
    require_whole("turns", turns, 2 * LOOKS * CYCLE)
    require_whole("seed", seed, 0)


def _shifted(
    scene: Scene, pins: Int[np.ndarray, " half"], starts: int, spread: float, seed: int
) -> Float[np.ndarray, "starts dims"]:
    """Return section points about the scene's start, evenly over a disc at each joint.

    All but the numbers `pins` of a point stays, such as rates, memories and a frame.
    """
    random, start = np.random.default_rng(seed), np.asarray(initial_state(scene))
    count = len(scene.joints), starts
    radii, angles = spread * np.sqrt(random.uniform(size=count)), random.uniform(size=count)
    offsets = radii * np.exp(2j * np.pi * angles)
    begun = np.tile(start, (starts, 1))
    begun[:, pins] += (
        np.stack([offsets.real, offsets.imag], axis=2).transpose(1, 0, 2).reshape(starts, -1)
    )
    return begun


# The oscillations about orbits of so many turns.
_Oscillations = dict[int, Oscillation]


def _oscillations(
    states: Float[np.ndarray, "turns dims"], pins: Int[np.ndarray, " half"]
) -> _Oscillations:
    """Return the oscillations about orbits of each of `PERIODS`, and of `CYCLE` turns."""
    whole = states[len(states) % CYCLE :]
    return {period: oscillation_about(whole, period, pins) for period in (*PERIODS, CYCLE)}


def _shortest(oscillations: _Oscillations) -> Oscillation:
    """Return the oscillation about the shortest orbit that fits, of `CYCLE` turns if none does."""
    enough = AS_NARROW * oscillations[CYCLE].spread + SLACK
    return next(one for one in oscillations.values() if one.spread <= enough)


class _Known:
    """The orbits of a scene that are known so far, and the searches that failed."""

    def __init__(self, scene: Scene, orbits: list[PeriodicOrbit]) -> None:
        self.scene, self.orbits = scene, orbits
        self._sections = [section_of(orbit) for orbit in orbits]
        self._failures: list[np.ndarray] = []

    def about(self, one: Oscillation, widest: float) -> int | None:
        """Return the orbit that a motion oscillates about; up to a spread it is solved for."""
        away = [distance(section, one.middle) for section in self._sections]
        if away and min(away) < one.allowed:
            return int(np.argmin(away))
        if len(one.centre) > PERIODS[-1] or one.spread > widest:
            return None
        again = any(one.is_about(tried) for tried in self._failures)
        if again or len(self._failures) >= MOST_FAILURES:
            return None
        # Where the section bends, another turn's mean may lead there.
        for guess in one.centre:
            orbit = shoot(self.scene, guess, len(one.centre))
            if bool(orbit.stable):
                break
        else:
            self._failures.append(one.middle)
            return None
        alike = [i for i, other in enumerate(self.orbits) if _same(orbit, other)]
        if not alike:
            self.orbits.append(orbit)
            self._sections.append(section_of(orbit))
        return alike[0] if alike else len(self.orbits) - 1

    def surely_decays(self, number: int, one: Oscillation) -> bool:
        """Tell whether an oscillation about an orbit must decay: it is small, or keeps contact.

        The amplitude of a harmonic oscillation is the square root of 2 times its RMS.
        """
        least = float(self.orbits[number].least_penetration)
        return bool(one.spread < max(NEAR, least / np.sqrt(2)))

    def approached(self, before: _Oscillations, now: _Oscillations) -> int | None:
        """Return the orbit about which a motion oscillates less than it did.

        An oscillation in step with the shaft may seem to be about another orbit, which is unknown.
        """
        own = _shortest(now)
        tried = [own] if self.about(own, 0.0) is not None else now.values()
        for one in tried:
            place = self.about(one, 0.0)
            if place is not None and one.spread < before[len(one.centre)].spread:
                return place
        return None


def _same(one: PeriodicOrbit, other: PeriodicOrbit) -> bool:
    headline = one.scene.headline
    apart = abs(float(one[headline]) / float(other[headline]) - 1)
    short, long = sorted((one, other), key=lambda orbit: orbit.period)
    if long.period % short.period or apart >= SAME:
        return False
    section = np.tile(section_of(short), (long.period // short.period, 1))
    return distance(section_of(long), section) < NEAR


# What a design holds.
HELD = (
    "worst_rms",
    "likeliest_rms",
    "unsettled",
    "share",
    "share_error",
    "orbit_rms",
    "orbit_period",
    "label",
    "start_state",
)


@axes_first
def basin_map(
    machine: Machine | Callable[..., Scene],
    axes: Mapping[str, Any],
    *,
    starts: int = 32,
    spread: float = 0.5,
    turns: int = 1000,
    seed: int = 0,
    store: str | Path | None = None,
    scheduler: "str | distributed.Client | None" = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Find the stable orbits of every design of a grid, and how many random starts come to each.

    Each design is treated as by `jaxcrusher.coexisting_orbits`, with the same shifts of its own
    start: differences between designs do not come from other shifts. A design takes some seconds.

    **Arguments:**

    - `machine`, `axes`: as in `jaxcrusher.orbit_map`.
    - `starts`, `spread`, `turns`, `seed`: as in `jaxcrusher.coexisting_orbits`.
    - `store`: None, or a folder in which each finished design is kept, as a Zarr store. Killed at
      any moment and called again with the same arguments, the map goes on where it was.
    - `scheduler`: as in `jaxcrusher.orbit_map`; a worker looks at a design.
    - `progress`: called with the number of finished and of all designs, first at the start.

    **Returns:** an `xarray.Dataset` with a dimension for each axis: `worst_rms` and `likeliest_rms`
    (N; of the loudest orbit that any start came to, and of that to which most came), `unsettled`
    (the share of starts that came to none). With a dimension `orbit`, the most frequent first:
    `share`, `share_error` (its standard error), `orbit_rms` (N), `orbit_period` (turns); NaN and 0
    where there are fewer orbits. With a dimension `start`: `label`, the place of the orbit to which
    it came, -1 for none, and `start_state`, its section point.

    Raises ValueError for bad arguments, and as `jaxcrusher.coexisting_orbits` does; RuntimeError
    for workers that fail, and ImportError as `jaxcrusher.sweep` does.
    """
    require_set_up()
    _require_asked(starts, spread, turns, seed)
    grid = make_grid(machine_of(machine), axes)
    report = progress or (lambda finished, of: None)
    asked = {"starts": starts, "spread": spread, "turns": turns, "seed": seed}
    columns = {name: COLUMNS[name] for name in HELD}
    # The quiet orbit is among them without a start that came to it.
    size = initial_state(grid.scene(0)).size
    sizes = {"orbit": starts + 1, "start": starts, "coordinate": size}
    layout = Layout(grid, columns, (1,) * len(grid.shape), sizes)
    title = "Coexisting periodic orbits of machines over a grid of parameters"
    with (
        connected(scheduler) as client,
        opened(layout, store, title, grid.settings() | asked, asked) as kept,
    ):
        finished = len(kept.done)
        report(finished, grid.size)
        missing = [design for design in range(grid.size) if design not in kept.done]
        look = functools.partial(_looked_at, grid=grid, asked=asked)
        with computing(look, missing, "lanes", client, layout.name) as results:
            for design, row in results:
                cell = {name: np.reshape(v, layout.chunk + np.shape(v)) for name, v in row.items()}
                kept.write(design, cell, {})
                finished += 1
                report(finished, grid.size)
        found = kept.dataset()
        most = int((found.orbit_period > 0).sum("orbit").max())
        return found.isel(orbit=slice(0, most))


def _looked_at(design: int, grid: Grid, asked: Mapping[str, Any]) -> tuple[int, dict[str, Any]]:
    found = coexisting_orbits(grid.scene(design), **asked)
    return design, _row(found, asked["starts"] + 1)


def _row(found: CoexistingOrbits, most: int) -> dict[str, Any]:
    """Return the columns of one design, filled up to `most` orbits."""
    fill = (0, most - len(found.orbits))
    rms = np.array([float(orbit[orbit.scene.headline]) for orbit in found.orbits])
    shares = np.array(found.shares)
    reached = [*rms[shares > 0]]
    return {
        "share": np.pad(shares, fill, constant_values=np.nan),
        "share_error": np.pad(np.array(found.share_errors), fill, constant_values=np.nan),
        "orbit_rms": np.pad(rms, fill, constant_values=np.nan),
        "orbit_period": np.pad(np.array([orbit.period for orbit in found.orbits], int), fill),
        "label": found.labels,
        "start_state": found.starts,
        "worst_rms": max(reached, default=np.nan),
        "likeliest_rms": reached[0] if reached else np.nan,
        "unsettled": np.mean(found.labels < 0),
    }
