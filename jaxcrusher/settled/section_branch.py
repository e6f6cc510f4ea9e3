"""Branches of orbits by the integrator: of the section points that repeat after some turns.

As `jaxcrusher.settled.branch`, but each point is Newton's method on the map from section to
section, so that contact may be lost on the way. The map's derivatives hold the multipliers.
"""

import itertools
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Complex, Float
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import root_scalar

from jaxcrusher.motion.tangents import Build, chain, tangents
from jaxcrusher.settled.branch import (
    EASY,
    ENDS,
    GROWTH,
    LEAST_COSINE,
    MOST_CORRECTIONS,
    SHRINKAGE,
    leaves_circle,
    test_functions,
)
from jaxcrusher.settled.shooting import solved

# Of Newton's last step, in clearances and m/s, and the integrations' tolerance.
CLOSURE, RTOL = 1e-7, 1e-10
# First, longest and shortest step, in clearances, m/s and the parameter's scale together.
STEP, LONGEST, SHORTEST = 0.02, 0.4, 2e-5
# Whose derivatives are integrated too, and are not looked at.
METRIC = "foundation_rms"
# A step that ends further off the tangent, as a share of it, may have hopped to another branch:
# where these fold a state differs by thousandths of a clearance.
STRAIGHT = 0.1
# Two states so near, in clearances and m/s, are one; points followed back to where they part.
ALIKE, BACK = 1e-3, 12
SHORTER = "The orbit repeats after fewer turns, which were doubled."
DOUBLING = "period doubling"
# Of what is located, as a share of the step that holds it.
LOCATED = 1e-9


@dataclass(frozen=True)
class SectionPoint:
    """A point of a branch, and the branch's direction there."""

    state: Float[np.ndarray, " dims"]
    value: float  # of the parameter, in its scale
    along: Float[np.ndarray, " n"]  # of both, of length one
    multipliers: Complex[np.ndarray, " dims"]
    turns: int  # after which it repeats already
    corrections: int

    @property
    def place(self) -> Float[np.ndarray, " n"]:
        """Both."""
        return np.append(self.state, self.value)

    def tests(self) -> dict[str, float]:
        """What changes its sign where the branch changes."""
        found = test_functions(float(self.along[-1]), self.multipliers, 1.0)
        return {kind: value for kind, value in found.items() if kind != "monitor"}


@dataclass(frozen=True)
class SectionBranches:
    """Of the orbits of `build`, a scene of one number, after `period` turns.

    `scale` is what a change of the number is small against, as a section point in clearances and
    m/s is of order one.
    """

    build: Build
    period: int
    scale: float

    def correct(
        self, guess: Float[np.ndarray, " n"], along: Float[np.ndarray, " n"]
    ) -> SectionPoint | None:
        """The point of the branch straight across `along` from a guess; None if there is none."""
        place, dims = guess, guess.size - 1
        for step in range(1, MOST_CORRECTIONS + 1):
            ends, matrix, forcing = self._turns(place)
            if not np.isfinite(matrix).all():
                return None
            rows = np.hstack([matrix - np.eye(dims), self.scale * forcing])
            left = np.append(ends[-1] - place[:-1], along @ (place - guess))
            change = solved(np.vstack([rows, along]), -left)
            if not np.isfinite(change).all():
                return None
            place = place + change
            if np.max(np.abs(change)) < CLOSURE:
                onward = np.linalg.svd(rows)[2][-1]
                onward = onward if onward @ along > 0 else -onward
                values = np.linalg.eigvals(matrix).astype(complex)
                apart = np.max(np.abs(np.array(ends) - ends[-1]), axis=1)
                turns = 1 + int(np.argmax(apart < ALIKE))
                return SectionPoint(place[:-1], float(place[-1]), onward, values, turns, step)
        return None

    def _turns(
        self, place: Float[np.ndarray, " n"]
    ) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
        """The state after each turn, and the derivatives of the last by state and number."""
        state, ends = place[:-1], []
        matrix, forcing = np.eye(state.size), np.zeros((state.size, 1))
        for _ in range(self.period):
            number = jnp.asarray(self.scale * place[-1:])
            parts = tangents(self.build, number, METRIC, state, 1, RTOL)
            by_state, by_number = chain(parts)
            matrix, forcing = by_state @ matrix, by_state @ forcing + by_number
            state = parts.state
            ends.append(state)
        return ends, matrix, forcing

    def follow(
        self,
        state: Float[np.ndarray, " dims"],
        start: float,
        bounds: tuple[float, float],
        *,
        upwards: bool,
        points: int,
    ) -> tuple[list[SectionPoint], str]:
        """The branch through the orbit near `state`, none if there is none, and why it ends.

        The last point may be of an orbit of fewer turns, which this one came from by doubling.
        """
        onward = np.append(np.zeros(len(state)), 1.0 if upwards else -1.0)
        here = self.correct(np.append(state, start / self.scale), onward)
        if here is None:
            return [], ENDS[3]
        found, length = [here], STEP
        while len(found) < points:
            there = self.correct(here.place + length * here.along, here.along)
            if there is None or not self._reached(here, there, length):
                length *= SHRINKAGE
                if length < SHORTEST:
                    return found, ENDS[3]
                continue
            found.append(there)
            if there.turns < self.period:
                return found, SHORTER
            if not bounds[0] <= self.scale * there.value <= bounds[1]:
                return found, ENDS[1]
            here = there
            length = min(length * (GROWTH if here.corrections <= EASY else 1.0), LONGEST)
        return found, ENDS[0]

    def _reached(self, here: SectionPoint, there: SectionPoint, length: float) -> bool:
        """Whether a step has stayed on its branch."""
        astray = np.linalg.norm(there.place - here.place - length * here.along)
        return bool(there.along @ here.along >= LEAST_COSINE and astray <= STRAIGHT * length)

    def origin(self, branch: list[SectionPoint]) -> tuple["SectionBranches", SectionPoint | None]:
        """Where a branch that `follow` ended at fewer turns came from: these are doubled there.

        With it the branch of fewer turns, which is followed back for that.
        """
        last = branch[-1]
        shorter = replace(self, period=last.turns)
        upwards = bool(last.value < branch[-2].value)
        everywhere = -np.inf, np.inf
        back, _ = shorter.follow(
            last.state, self.scale * last.value, everywhere, upwards=upwards, points=BACK
        )
        doublings = [one for kind, one in shorter.special_points(back) if kind == DOUBLING]
        return shorter, doublings[0] if doublings else None

    def special_points(self, branch: list[SectionPoint]) -> list[tuple[str, SectionPoint | None]]:
        """Folds, period doublings and Neimark-Sacker points; None for one that is not located."""
        found = []
        if branch[-1].turns < self.period:
            branch = branch[:-1]
        for here, there in itertools.pairwise(branch):
            before, after = here.tests(), there.tests()
            for kind in before:
                if not before[kind] * after[kind] < 0:
                    continue
                place = self._located(here, there, kind)
                if place is not None and place.turns < self.period:
                    # It turns back in the orbit that it came from, and goes on a turn later.
                    kind = DOUBLING
                if place is None or kind != "Neimark-Sacker" or leaves_circle(place.multipliers):
                    found.append((kind, place))
        return found

    def _located(self, here: SectionPoint, there: SectionPoint, kind: str) -> SectionPoint | None:
        """Between two points, on planes across the line that joins them."""
        chord = there.place - here.place
        size = float(np.linalg.norm(chord))
        across = chord / size
        # A cubic through both, along the branch at both ends, is near it in between.
        ends = [size * one.along / (one.along @ across) for one in (here, there)]
        curve = CubicHermiteSpline([0, 1], [here.place, there.place], ends)
        last = here

        def test(share: float) -> float:
            nonlocal last
            found = self.correct(curve(share), across)
            if found is None:
                return np.nan
            last = found
            return found.tests()[kind]

        try:
            root_scalar(test, bracket=(0.0, 1.0), method="brentq", xtol=LOCATED)
        except ValueError:
            return None
        return last
