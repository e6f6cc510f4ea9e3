"""A planar linkage as it is drawn: bodies, joints between them, and the crank that drives it."""

import equinox as eqx
from jaxtyping import Scalar

from jaxcrusher.basics.checks import require
from jaxcrusher.basics.plane import scalar
from jaxcrusher.mechanism.arms import Arm
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.topology import FRAME, Dyad, dyads_of


class Body(eqx.Module):
    """A rigid body: its mass, its inertia about its mass centre, and where that is."""

    mass: Scalar = eqx.field(converter=scalar)  # kg
    inertia: Scalar = eqx.field(converter=scalar)  # kg m2
    mass_centre: Arm = Arm()  # from the body's origin, m


class Point(eqx.Module):
    """A point that is fixed to a body, or to the frame."""

    body: str = eqx.field(static=True)
    arm: Arm = Arm()


class Joint(eqx.Module):
    """A revolute joint: the centre of a bore in one body, that of a pin on another one."""

    bore: Point
    pin: Point


class Linkage(eqx.Module):
    """Bodies and joints on a frame.

    The `crank` turns in the frame about the joint `bearing`; all other bodies are dyads: pairs that
    meet in a joint, each of which hangs on a body before them by another joint. `sides` says of
    each dyad, in the order of `dyads`, on which side of the line from its first to its second outer
    joint they meet: 1 left, -1 right. Frame and crank have their origins where their axes begin;
    the crank's angle is that of its x axis.

    Raises ValueError for a joint of a body that there is not, for bodies that are no dyads, and for
    another count of `sides`.
    """

    bodies: Named[Body]
    joints: Named[Joint]
    crank: str = eqx.field(static=True)
    bearing: str = eqx.field(static=True)
    sides: tuple[int, ...] = eqx.field(static=True)
    gravity: Scalar = eqx.field(converter=scalar, default=9.81)  # m/s2

    def __check_init__(self):
        known = {FRAME, *self.bodies.names}
        for name, joint in self.joints.items():
            for point in (joint.bore, joint.pin):
                must = f"join bodies that there are: {', '.join(sorted(known))}"
                require(point.body in known, name, must, f"at {point.body}")
        require(len(self.sides) == len(self.dyads), "sides", "hold one of each dyad", self.sides)
        good = all(side in (-1, 1) for side in self.sides)
        require(good, "sides", "hold 1 or -1 of each dyad", self.sides)

    @property
    def ends(self) -> tuple[tuple[str, str, str], ...]:
        """Return name, bore's body and pin's body of each joint."""
        return tuple((name, one.bore.body, one.pin.body) for name, one in self.joints.items())

    @property
    def dyads(self) -> tuple[Dyad, ...]:
        """Return the pairs of bodies, in the order in which they are placed."""
        return dyads_of(self.ends, self.bodies.names, self.crank)

    def side_of(self, joint: str, body: str) -> Arm:
        """Return where a joint is on one of its two bodies."""
        one = self.joint(joint)
        return one.bore.arm if one.bore.body == body else one.pin.arm

    def joint(self, name: str) -> Joint:
        """Return a joint, which there is."""
        found = self.joints[name]
        assert found is not None, name
        return found

    def body(self, name: str) -> Body:
        """Return a body, which there is."""
        found = self.bodies[name]
        assert found is not None, name
        return found
