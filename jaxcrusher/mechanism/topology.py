"""Which body hangs on which one: dyads by which bodies are placed, trees of those held together.

It knows names alone. A joint is its name, the body of its bore and the body of its pin; a slide is
the same, of the frame and its slider.
"""

import functools
import itertools
from typing import NamedTuple

from jaxcrusher.basics.checks import require

FRAME = "frame"

Ends = tuple[tuple[str, str, str], ...]


class Dyad(NamedTuple):
    """Two bodies that meet in a joint, each hanging on a body before them by another one.

    They are two links, or a link and then a slider, whose other joint is its slide.
    """

    first: str
    second: str
    first_joint: str
    second_joint: str
    meeting: str


class Branch(NamedTuple):
    """A body of a tree, what it hangs on, and by which joint."""

    body: str
    parent: str
    joint: str


class Tree(NamedTuple):
    """Bodies that joints hold together: one to begin with, and each behind what it hangs on."""

    base: str
    branches: tuple[Branch, ...]

    @property
    def bodies(self) -> tuple[str, ...]:
        """Return all bodies, the base first."""
        return self.base, *(one.body for one in self.branches)

    def beyond(self, body: str) -> list[str]:
        """Return a body, and all that hangs on it."""
        found = [body]
        for one in self.branches:
            if one.parent in found:
                found.append(one.body)
        return found


def other_body(ends: Ends, joint: str, body: str) -> str:
    """Return the other one of the two bodies of a joint."""
    bore, pin = next(both for name, *both in ends if name == joint)
    return pin if bore == body else bore


@functools.cache
def dyads_of(
    ends: Ends, slides: tuple[str, ...], bodies: tuple[str, ...], crank: str
) -> tuple[Dyad, ...]:
    """Return the dyads that bodies behind frame and crank are placed by, in their order."""
    placed, left, found = {FRAME, crank}, [body for body in bodies if body != crank], []
    while left:
        pairs = itertools.combinations(left, 2)
        dyad = next((one for pair in pairs if (one := _dyad(ends, slides, pair, placed))), None)
        must = (
            "form dyads, pairs that meet in a joint and hang on bodies before them by another, "
            "or one of them by a slide"
        )
        require(dyad is not None, "bodies", must, ", ".join(left))
        assert dyad is not None
        found.append(dyad)
        placed |= {dyad.first, dyad.second}
        left = [body for body in left if body not in placed]
    return tuple(found)


def _dyad(
    ends: Ends, slides: tuple[str, ...], pair: tuple[str, str], placed: set[str]
) -> Dyad | None:
    first, second = pair
    meeting = [name for name, *both in ends if set(both) == set(pair)]
    outer = [
        [name for name, *both in ends if body in both and other_body(ends, name, body) in placed]
        for body in pair
    ]
    if not all((meeting, *outer)):
        return None
    by = [names[0] for names in outer]
    if by[0] in slides:
        first, second, by = second, first, by[::-1]
    if by[0] in slides:
        return None  # two sliders cannot move
    return Dyad(first, second, by[0], by[1], meeting[0])


@functools.cache
def forest(
    ends: Ends, bodies: tuple[str, ...], loose: tuple[str, ...]
) -> tuple[tuple[Tree, ...], tuple[str, ...]]:
    """Return the trees that are left where loose joints are cut, and the joints that close loops.

    The first tree begins with the frame. A joint closes a loop where both of its bodies already
    hang on others.
    """
    held = [(name, both) for name, *both in ends if name not in loose]
    trees: list[Tree] = []
    reached: set[str] = set()
    for base in (FRAME, *bodies):
        if base in reached:
            continue
        reached.add(base)
        waiting, branches = [base], []
        for parent in waiting:
            for name, both in held:
                body = other_body(ends, name, parent) if parent in both else parent
                if body not in reached:
                    reached.add(body)
                    branches.append(Branch(body, parent, name))
                    waiting.append(body)
        trees.append(Tree(base, tuple(branches)))
    used = {one.joint for tree in trees for one in tree.branches}
    return tuple(trees), tuple(name for name, _ in held if name not in used)
