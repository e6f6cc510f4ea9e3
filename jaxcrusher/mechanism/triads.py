"""Where the middle body of a triad is: three lines that hold it, and Newton's method.

A link holds a joint of the middle body at its length from a base; a slide holds the joint on a
line. With u from the base to the joint and the unit vector n along the link, or across the slide,
the gaps are (u . u - l^2) / 2 l and n . u. The middle body's origin moves by v and it turns by w:

    n . v + w (a x n) = -gap,    a from the origin to the joint, once for each of the three.

They are lines of force, which hold the body unless they meet in one point, a dead point. There are
up to six assemblies, without a closed form; a guess at crank angle zero selects the one to follow.
"""

import abc

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Scalar
from typing_extensions import override

from jaxcrusher.basics.periodic_spline import PeriodicSeries, series_through
from jaxcrusher.basics.plane import Arm, Vector, direction, minus, or_zero, plus, scalar, total
from jaxcrusher.basics.record import Record

# Newton's steps: three from the guess, two more with derivatives. The last one may begin this share
# of the middle body's size off, and so ends at rounding.
SEARCHING, POLISHING, NEAR = 3, 2, 1e-9
SEEKING = 40  # steps from a guess by hand
ORDERS = 8  # of the series that guesses round a turn


class AbstractHold(Record):
    """What holds one joint of the middle body."""

    arm: eqx.AbstractVar[Arm]  # of the joint
    base: eqx.AbstractVar[Vector | None]  # where the link hangs, or where the slide begins, m
    rate: eqx.AbstractVar[Vector | None]  # m/s

    @abc.abstractmethod
    def normal(self, u: Vector) -> Vector:
        """Return the unit vector n, of u from the base to the joint."""

    @abc.abstractmethod
    def gap(self, u: Vector) -> Scalar:
        """Return how far the joint is off, along n, m."""


class Rod(AbstractHold):
    """A link between its two joints."""

    arm: Arm
    base: Vector | None
    rate: Vector | None
    length: Scalar

    @override
    def normal(self, u: Vector) -> Vector:
        return (1 / self.length) * u

    @override
    def gap(self, u: Vector) -> Scalar:
        return 0.5 * ((1 / self.length) * u.dot(u) - self.length)


class Rail(AbstractHold):
    """A slide."""

    arm: Arm
    base: Vector | None
    rate: Vector | None
    across: Vector

    @override
    def normal(self, u: Vector) -> Vector:
        return self.across

    @override
    def gap(self, u: Vector) -> Scalar:
        return self.across.dot(u)


Holds = list[AbstractHold]


class Lines:
    """The three lines of force on a middle body where it is."""

    def __init__(self, holds: Holds, spot: "Spot"):
        self.holds = holds
        self.arms = [hold.arm.along(spot.axis) for hold in holds]
        at = [plus(spot.place, arm) for arm in self.arms]
        self.reaches = [or_zero(minus(x, h.base)) for x, h in zip(at, holds, strict=True)]
        self.normals = [hold.normal(u) for hold, u in zip(holds, self.reaches, strict=True)]
        both = zip(self.arms, self.normals, strict=True)
        self.moments = [None if arm is None else arm.cross(normal) for arm, normal in both]
        n = self.normals
        self.crossings = [n[1].cross(n[2]), n[2].cross(n[0]), n[0].cross(n[1])]

    @property
    def gaps(self) -> list[Scalar]:
        """Return how far its joints are off, m."""
        return [hold.gap(u) for hold, u in zip(self.holds, self.reaches, strict=True)]

    @property
    def determinant(self) -> Scalar:
        """Return the determinant of the three equations, m."""
        parts = zip(self.moments, self.crossings, strict=True)
        found = total(None if moment is None else moment * c for moment, c in parts)
        assert found is not None, "not all joints lie in the origin"
        return found

    def solve(self, right: list[Scalar | None]) -> tuple[Vector, Scalar]:
        """Return v and w by the adjugate matrix; what is None on the right is zero."""
        n, m, b = self.normals, self.moments, right
        turn = total([_times(*both) for both in zip(b, self.crossings, strict=True)])
        shares = [minus(_times(b[i - 2], m[i - 1]), _times(b[i - 1], m[i - 2])) for i in range(3)]
        step = total([None if s is None else s * one for s, one in zip(shares, n, strict=True)])
        inverse = 1 / self.determinant
        return inverse * or_zero(step).perp(), inverse * (0.0 if turn is None else turn)


def _times(one: Scalar | None, other: Scalar | None) -> Scalar | None:
    return None if one is None or other is None else one * other


class AbstractCourse(Record):
    """Where to look for the middle body."""

    @abc.abstractmethod
    def placed(self, holds: Holds, angle: Scalar) -> "Spot":
        """Return where it is at an angle of the crank (rad); NaN where it is not found."""


class Spot(AbstractCourse):
    """Where a middle body is: its origin and its x axis. It is looked for nearby."""

    place: Vector  # m
    axis: Vector

    @override
    def placed(self, holds: Holds, angle: Scalar) -> "Spot":
        """Return where it is near this spot.

        Each step squares the error e. A step that is differentiated also turns its derivatives e'
        and e'' into 2 e e' and 2 (e'^2 + e e''). After the steps without derivatives e is some 1e-8
        of the size and e' is as large as the motion; two more steps give first and second
        derivatives to rounding, as by the implicit function theorem.
        """
        held, spot = jax.lax.stop_gradient((holds, self))
        for _ in range(SEARCHING):
            spot = spot.nearer(held)
        spot = jax.lax.stop_gradient(spot)
        for _ in range(POLISHING - 1):
            spot = spot.nearer(holds)
        return spot.nearer(holds, NEAR)

    def nearer(self, holds: Holds, within: float | None = None) -> "Spot":
        """Return the spot after a step; NaN where it begins further off than `within` sizes."""
        lines = Lines(holds, self)
        gaps = lines.gaps
        if within is not None:
            off = sum(gap**2 for gap in gaps)
            gaps[0] = jnp.where(off < within**2 * size_squared(holds), gaps[0], jnp.nan)
        return self.moved(*lines.solve([-gap for gap in gaps]))

    def moved(self, step: Vector, turn: Scalar) -> "Spot":
        """Return the spot after a step (m) and a turn (rad).

        The axis is near its length of 1, and so Newton's step for the inverse of a root is enough.
        """
        axis = self.axis + turn * self.axis.perp()
        return Spot(self.place + step, (1.5 - 0.5 * axis.dot(axis)) * axis)

    def strode(self, holds: Holds) -> "Spot":
        """Return the spot after a step of at most a third of the body's size and a third of 1."""
        lines = Lines(holds, self)
        step, turn = lines.solve([-gap for gap in lines.gaps])
        share = 1 / jnp.sqrt(1 + 9 * (turn**2 + step.dot(step) / size_squared(holds)))
        return self.moved(share * step, share * turn)


def size_squared(holds: Holds) -> Scalar:
    """Return the sum of the squared distances of the first joint from the others, m2."""
    found = total((holds[0].arm - hold.arm).squared() for hold in holds[1:])
    assert found is not None, "not all joints lie in one point"
    return found


class Guess(AbstractCourse):
    """Roughly where a middle body is at crank angle zero: its origin, and its x axis' angle."""

    place: Vector  # m
    angle: Scalar = eqx.field(converter=scalar)  # rad

    @override
    def placed(self, holds: Holds, angle: Scalar) -> Spot:
        begin = Spot(self.place, direction(self.angle))
        # What comes back has the types of what goes in.
        found = jax.lax.fori_loop(0, SEEKING, lambda _, spot: spot.strode(holds), begin)
        return found.placed(holds, angle)


class Course(AbstractCourse):
    """Where a middle body of ideal joints is round a turn of the crank, to some 1e-2 of its size.

    A Fourier series each of x, y, cosine and sine, so that turns of the body need no counting.
    """

    series: tuple[PeriodicSeries, ...]

    @override
    def placed(self, holds: Holds, angle: Scalar) -> Spot:
        held = jax.lax.stop_gradient(angle)
        x, y, cosine, sine = (one(held) for one in jax.lax.stop_gradient(self.series))
        return Spot(Vector(x, y), Vector(cosine, sine)).placed(holds, angle)


def course_through(spots: Spot) -> Course:
    """Return the course through spots at evenly spaced angles of one turn, from zero."""
    parts = spots.place.x, spots.place.y, spots.axis.x, spots.axis.y
    return Course(tuple(series_through(part, ORDERS + 1) for part in parts))
