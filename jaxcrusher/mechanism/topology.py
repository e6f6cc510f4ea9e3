"""Which body hangs on which: groups to place bodies, and trees of bodies held together.

It knows names alone. A joint is its name, the body of its bore and the body of its pin; a slide is
its name, the frame and its slider.
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

    @property
    def legs(self) -> "tuple[Leg, ...]":
        """Return the two bodies with their joints."""
        return (
            Leg(self.first, self.first_joint, self.meeting),
            Leg(self.second, self.second_joint, self.meeting),
        )

    @property
    def bodies(self) -> tuple[str, ...]:
        """Return both bodies."""
        return self.first, self.second


class Leg(NamedTuple):
    """A body of a group, the joint or slide that it hangs by, and the joint where it meets."""

    body: str
    joint: str
    meeting: str


class Triad(NamedTuple):
    """A body in the middle that meets three others, each hanging on a body before them."""

    middle: str
    legs: tuple[Leg, ...]

    @property
    def bodies(self) -> tuple[str, ...]:
        """Return all four, the middle first."""
        return self.middle, *(leg.body for leg in self.legs)


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
def groups_of(
    ends: Ends, slides: tuple[str, ...], bodies: tuple[str, ...], crank: str
) -> tuple[Dyad | Triad, ...]:
    """Return the groups that place the bodies behind frame and crank, in their order.

    A triad is formed only where no dyad can be placed.
    """
    placed, left, found = {FRAME, crank}, [body for body in bodies if body != crank], []
    while left:
        pairs = itertools.combinations(left, 2)
        group = next((one for pair in pairs if (one := _dyad(ends, slides, pair, placed))), None)
        if group is None:
            group = next((one for body in left if (one := _triad(ends, body, left, placed))), None)
        must = (
            "form dyads, pairs that meet in a joint and hang on bodies before them by another, "
            "or one of them by a slide, or triads, a body that meets three which hang so"
        )
        require(group is not None, "bodies", must, ", ".join(left))
        assert group is not None
        found.append(group)
        placed |= {*group.bodies}
        left = [body for body in left if body not in placed]
    return tuple(found)


def dyads_of(groups: tuple[Dyad | Triad, ...]) -> tuple[Dyad, ...]:
    """Return the dyads among groups."""
    return tuple(one for one in groups if isinstance(one, Dyad))


def triads_of(groups: tuple[Dyad | Triad, ...]) -> tuple[Triad, ...]:
    """Return the triads among groups."""
    return tuple(one for one in groups if isinstance(one, Triad))


def _hanging(ends: Ends, body: str, placed: set[str]) -> list[str]:
    """Return the joints by which a body hangs on one that is placed."""
    return [n for n, *both in ends if body in both and other_body(ends, n, body) in placed]


def _dyad(
    ends: Ends, slides: tuple[str, ...], pair: tuple[str, str], placed: set[str]
) -> Dyad | None:
    first, second = pair
    meeting = [name for name, *both in ends if set(both) == set(pair)]
    outer = [_hanging(ends, body, placed) for body in pair]
    if not all((meeting, *outer)):
        return None
    by = [names[0] for names in outer]
    if by[0] in slides:
        first, second, by = second, first, by[::-1]
    if by[0] in slides:
        return None  # two sliders cannot move
    return Dyad(first, second, by[0], by[1], meeting[0])


def _triad(ends: Ends, middle: str, left: list[str], placed: set[str]) -> Triad | None:
    legs = []
    for body in left:
        meeting = [name for name, *both in ends if {*both} == {body, middle}]
        hanging = _hanging(ends, body, placed)
        if meeting and hanging:
            legs.append(Leg(body, hanging[0], meeting[0]))
    return Triad(middle, tuple(legs[:3])) if len(legs) >= 3 else None


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
