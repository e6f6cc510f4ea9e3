"""How far an orbit is searched for, and what a search has done."""

import math
from typing import NamedTuple

from typing_extensions import override

from jaxcrusher.basics.checks import require_choice
from jaxcrusher.basics.integrate import Outcome
from jaxcrusher.orbits.solving import NODES
from jaxcrusher.periodic.collocation_problem import MOST_NODES


class Effort(NamedTuple):
    """The bounds of a search. They are counts: an answer is the same on every machine."""

    nodes: int  # a turn
    turns: int  # waited for
    longest: int  # period that a motion is looked at for, in turns
    steps: float  # of the integrator, in all
    shoots: bool

    @property
    def bounded(self) -> bool:
        """Tell whether the integrator's steps are bounded."""
        return math.isfinite(self.steps)


# A million steps take 1 to 2.5 s of a core.
EFFORTS = {
    "quick": Effort(NODES, turns=480, longest=4, steps=1e6, shoots=False),
    "usual": Effort(MOST_NODES, turns=1920, longest=4, steps=4e6, shoots=True),
    "thorough": Effort(MOST_NODES, turns=7680, longest=12, steps=math.inf, shoots=True),
}


# Turns of a wait between which the steps are counted: see `jaxcrusher.orbits.transient`.
PIECE = 24


class Budget:
    """What a search has done within the bounds of an effort."""

    def __init__(self, effort: str) -> None:
        require_choice("effort", effort, tuple(EFFORTS))
        self.effort, self.bounds = effort, EFFORTS[effort]
        self.nodes: set[int] = set()
        self.shots = self.turns = 0
        self.steps = self._pace = 0.0

    @property
    def most(self) -> int | None:
        """Return the most steps of a turn: more leave no piece of turns within the bound."""
        return int(self.bounds.steps / PIECE) if self.bounds.bounded else None

    def integrated(self, outcome: Outcome, turns: int) -> None:
        """Count the steps of so many turns."""
        self.steps += float(outcome.steps)
        self._pace = float(outcome.steps) / turns

    def affords(self, turns: float) -> bool:
        """Tell whether so many turns more, as long as the last ones, are within the bound."""
        return self.steps + turns * self._pace <= self.bounds.steps

    def spend(self, turns: float) -> None:
        """Count what costs as much as so many turns, as long as the last ones."""
        self.steps += turns * self._pace

    @override
    def __str__(self) -> str:
        """Say what was tried, and which effort goes further."""
        tried = [f"{' and '.join(map(str, sorted(self.nodes)))} nodes a turn"] if self.nodes else []
        tried += [f"a wait of {self.turns} turns"] if self.turns else []
        searches = "search" if self.shots == 1 else "searches"
        tried += [f"{self.shots} {searches} by shooting"] if self.shots else []
        words = f"Tried: {', '.join(tried)}."
        if not self.bounds.bounded:
            return words
        more, millions = EFFORTS["thorough"], f"{self.bounds.steps / 1e6:g} million"
        return (
            f'{words} effort="{self.effort}" ends after {millions} steps of the integrator; '
            f'effort="thorough" goes on to {more.nodes} nodes, {more.turns} turns and shooting.'
        )
