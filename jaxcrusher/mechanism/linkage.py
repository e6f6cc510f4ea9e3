"""A planar linkage as it is drawn: bodies, what holds them together, and the crank."""

import functools
import operator

import equinox as eqx
from jaxtyping import Scalar

from jaxcrusher.basics.checks import concrete, is_concrete, require, require_positive
from jaxcrusher.basics.plane import Arm, Vector, optional_scalar, scalar
from jaxcrusher.basics.record import Record
from jaxcrusher.basics.smooth import norm
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.topology import FRAME, Dyad, Ends, Triad, dyads_of, groups_of, triads_of
from jaxcrusher.mechanism.triads import Course, Guess


class Body(Record):
    """A rigid body: its mass, its mass centre, and its inertia about the mass centre."""

    mass: Scalar = eqx.field(converter=scalar)  # kg
    inertia: Scalar = eqx.field(converter=scalar)  # kg m2
    mass_centre: Arm = Arm()  # from the body's origin, m


class Point(Record):
    """A point that is fixed to a body, or to the frame."""

    body: str = eqx.field(static=True)
    arm: Arm = Arm()


class Joint(Record):
    """A revolute joint: the centre of a bore in one body, that of a pin on another one."""

    bore: Point
    pin: Point


def require_direction(along: Vector, name: str = "along") -> None:
    """Raise ValueError for a known vector without length."""
    parts = [concrete(part) for part in (along.x, along.y)]
    good = any(part is None or bool((part != 0).all()) for part in parts)
    require(good, name, "be a direction", "zero")


class Slide(Record):
    """A slide in the frame: its body moves along a line, and does not turn.

    The body's origin moves on the line through a point of the frame, and its axes stay those of the
    frame, unless its guide has a gap. The body bears on its guide at two ends, `length` apart; with
    None it bears in its middle alone. Raises ValueError (concrete values only) for a direction
    without length, and for sizes that are not positive.
    """

    body: str = eqx.field(static=True)
    along: Vector  # ahead on the line, of any length
    through: Arm = Arm()  # from the frame's origin, m
    length: Scalar | None = eqx.field(converter=optional_scalar, default=None)  # of the body, m
    height: Scalar | None = eqx.field(converter=optional_scalar, default=None)  # across, m

    def __check_init__(self):
        require_direction(self.along)
        for name, size in (("length", self.length), ("height", self.height)):
            if size is not None:
                require_positive(name, size, "m")

    @property
    def direction(self) -> Vector:
        """Return the unit vector ahead on the line."""
        return self.along / norm(self.along, 0.0)

    @property
    def half_length(self) -> Scalar:
        """Return the lever of an end of the body about its origin, m."""
        assert self.length is not None, "the body bears in its middle alone"
        return self.length / 2

    @property
    def half_sizes(self) -> Vector:
        """Return half of the body's length and of its height, m."""
        assert self.height is not None, "the body has no height"
        return Vector(self.half_length, self.height / 2)

    @property
    def ends(self) -> Joint:
        """Return what may part along the line alone: a point of the frame, the body's origin."""
        return Joint(Point(FRAME, self.through), Point(self.body))


class Linkage(Record):
    """Bodies, joints and slides on a frame.

    The `crank` turns in the frame about the joint `bearing`. All other bodies form dyads or triads.
    A dyad is a pair that meets in a joint; each of the two hangs on a body before them by another
    joint, or one of them on the frame by a slide. In a triad a middle body meets three others, each
    of which hangs on a body before them, or on the frame by a slide. `sides` gives for each dyad,
    in the order of `dyads`, where it meets. Two links meet on one side of the line from their first
    to their second outer joint: 1 left, -1 right. A link and a slider meet ahead (1) or behind
    (-1), along the slide, of the foot of the perpendicular from the link's outer joint. `guesses`
    gives a rough pose of each triad's middle body at crank angle zero, and
    `jaxcrusher.mechanism.motion.continued` adds the `courses` from there. Frame and crank have
    their origins where their axes begin; the crank's angle is that of its x axis.

    Raises ValueError for a joint or a slide of an unknown body, for one that no group needs, for
    bodies that form no groups, for a wrong count of `sides`, for a triad without a guess and a
    guess without a triad, for a body that has the frame's name, for a bearing that does not join
    crank and frame, and (concrete values only) for a link whose two joints coincide and for a
    mass or an inertia that is not positive.
    """

    bodies: Named[Body]
    joints: Named[Joint]
    crank: str = eqx.field(static=True)
    bearing: str = eqx.field(static=True)
    sides: tuple[int, ...] = eqx.field(static=True)
    gravity: Scalar = eqx.field(converter=scalar, default=9.81)  # m/s2
    slides: Named[Slide] = eqx.field(default_factory=Named)
    guesses: Named[Guess] = eqx.field(default_factory=Named)
    courses: Named[Course] = eqx.field(default_factory=Named)  # of the guessed bodies

    def __check_init__(self):
        twice = set(self.joints.names) & set(self.slides.names)
        require(not twice, "slides", "have names that no joint has", ", ".join(twice))
        names = self.ends, self.slides.names, self.bodies.names, self.crank
        links = _links_of(*names, self.bearing, self.sides)
        middles = {triad.middle for triad in self.triads}
        for body in sorted(middles ^ {*self.guesses.names}):
            must = "tell of the body in the middle of each triad where it is at crank angle zero"
            require(False, "guesses", must, f"{'without' if body in middles else 'of'} {body}")
        for triad in self.triads:
            arms = [self.side_of(leg.meeting, triad.middle) for leg in triad.legs]
            known = any((arms[0] - arm).squared() is not None for arm in arms[1:])
            must = "have joints that are apart"
            require(known, f"bodies.{triad.middle}", must, "with all at its origin")
        for name, body in self.bodies.items() if is_concrete(self.bodies) else ():
            require_positive(f"bodies.{name}.mass", body.mass, "kg")
            require_positive(f"bodies.{name}.inertia", body.inertia, "kg m2")
        for body, joint, other in links:
            arms = self.side_of(joint, body), self.side_of(other, body)
            if is_concrete(arms):
                squared = (arms[0] - arms[1]).squared()
                known = concrete(0.0 if squared is None else squared)
                good = known is None or bool((known != 0).all())
                must = f"have its joints {joint} and {other} apart"
                require(good, f"bodies.{body}", must, "with both at one point")

    @property
    def ends(self) -> Ends:
        """Return name, bore's body and pin's body of each joint, and of each slide the same."""
        every = [*self.joints.items(), *((name, one.ends) for name, one in self.slides.items())]
        return tuple((name, one.bore.body, one.pin.body) for name, one in every)

    @property
    def mass(self) -> Scalar:
        """Return the mass of all bodies, kg."""
        return functools.reduce(operator.add, (body.mass for body in self.bodies.values))

    @property
    def groups(self) -> tuple[Dyad | Triad, ...]:
        """Return the dyads and triads, in the order in which they are placed."""
        return groups_of(self.ends, self.slides.names, self.bodies.names, self.crank)

    @property
    def dyads(self) -> tuple[Dyad, ...]:
        """Return the pairs of bodies among the groups."""
        return dyads_of(self.groups)

    @property
    def triads(self) -> tuple[Triad, ...]:
        """Return the groups of four bodies."""
        return triads_of(self.groups)

    def side_of(self, joint: str, body: str) -> Arm:
        """Return where a joint is on one of its two bodies."""
        one = self.joints.at(joint)
        return one.bore.arm if one.bore.body == body else one.pin.arm

    def centre(self, body: str) -> Point:
        """Return the mass centre of a body."""
        return Point(body, self.bodies.at(body).mass_centre)


@functools.cache
def _links_of(
    ends: Ends,
    slides: tuple[str, ...],
    bodies: tuple[str, ...],
    crank: str,
    bearing: str,
    sides: tuple[int, ...],
) -> tuple[tuple[str, str, str], ...]:
    """Return bodies that are links, each with two of its joints, which must be apart.

    Raises ValueError unless all bodies are held, and each dyad has a side.
    """
    require(FRAME not in bodies, "bodies", f"have other names than {FRAME!r}", repr(FRAME))
    held = any(n == bearing and {crank, FRAME} == {*both} for n, *both in ends)
    require(held, "bearing", f"join {crank} and {FRAME}", bearing)
    known = {FRAME, *bodies}
    for name, *both in ends:
        for body in both:
            must = f"join bodies that there are: {', '.join(sorted(known))}"
            require(body in known, name, must, f"at {body}")
    groups = groups_of(ends, slides, bodies, crank)
    dyads, legs = dyads_of(groups), [leg for group in groups for leg in group.legs]
    used = {bearing}.union(*((leg.joint, leg.meeting) for leg in legs))
    more = [name for name, *_ in ends if name not in used]
    must = "be the crank's bearing, six of each triad and three of each dyad"
    require(not more, "joints", must, f"also {', '.join(more)}")
    require(len(sides) == len(dyads), "sides", "hold one of each dyad", sides)
    good = all(side in (-1, 1) for side in sides)
    require(good, "sides", "hold 1 or -1 of each dyad", sides)
    links = [(leg.body, leg.joint, leg.meeting) for leg in legs]
    links += [(crank, name, bearing) for name, *both in ends if crank in both]
    return tuple(one for one in links if one[1] != one[2] and one[1] not in slides)
