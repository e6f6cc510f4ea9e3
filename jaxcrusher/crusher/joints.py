"""The three joints of the crusher, and something of each that has clearance."""

from collections.abc import Callable, Iterator
from typing import Any, Generic, TypeVar

import equinox as eqx

T = TypeVar("T")

# Names of the joints and their letters: the main bearing A (bore in the jaw, pin of the shaft), the
# elbow B (bore in the jaw, pin of the toggle), the pivot C (bore in the frame, pin of the toggle).
LETTERS = {"main": "A", "elbow": "B", "pivot": "C"}
JOINTS = tuple(LETTERS)


def before(joint: str) -> str:
    """Return the prefix of a joint's names, such as "elbow_"; the main joint has none."""
    return "" if joint == "main" else f"{joint}_"


class AtJoints(eqx.Module, Generic[T]):
    """One of a kind at each of `JOINTS`; None where the joint is ideal."""

    main: T | None = None
    elbow: T | None = None
    pivot: T | None = None

    def __getitem__(self, joint: str) -> T | None:
        return getattr(self, joint)

    def present(self) -> Iterator[tuple[str, T]]:
        """Names, and what is there, of the joints with clearance."""
        for name in JOINTS:
            one = self[name]
            if one is not None:
                yield name, one

    def map(self, function: Callable[..., Any], *others: "AtJoints[Any]") -> "AtJoints[Any]":
        """`function` of what is at each joint, in this and in others; None where nothing is."""
        return AtJoints(
            **{
                name: function(one, *(other[name] for other in others))
                for name, one in self.present()
            }
        )

    @property
    def count(self) -> int:
        """How many joints there is something at."""
        return sum(1 for _ in self.present())

    @property
    def only_main(self) -> bool:
        """Whether nothing is at elbow and pivot."""
        return self.elbow is None and self.pivot is None
