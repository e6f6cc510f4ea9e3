"""The crusher's motion as an ordinary differential equation, and what is observed along it."""

import numpy as np

from benchmarks.peers.equations import (
    Chain,
    Crusher,
    Shaft,
    Touch,
    assemble,
    contact,
    cross,
    histories,
    to_move,
)


def forces(crusher, shaft: Shaft, chain: Chain, force, point, accelerations, spin_rate) -> dict:
    """Return all reactions for `force` on the jaw at `point`, and the torque the shaft takes."""
    at_o = shaft.reaction(crusher, force, spin_rate)
    at_b, at_c = chain.reactions(crusher, force, accelerations)
    moment = shaft.moment(crusher, force, point)
    return {
        "bearing_reaction": at_o,
        "elbow_reaction": at_b,
        "toggle_reaction": at_c,
        "foundation_force": abs(at_o) + abs(at_c),
        "drive_torque": crusher.shaft_inertia * spin_rate - moment,
    }


def ideal(crusher: Crusher, times) -> dict[str, np.ndarray]:
    """Return reactions (N), torque (N m) of the ideal joint at `times` (s), in closed form.

    The pin's acceleration gives the chain's; the chain's is linear in the force at A.
    """
    rows = []
    for time in np.asarray(times).tolist():
        shaft = Shaft(crusher, crusher.speed * time, crusher.speed)
        angles = assemble(crusher, shaft.pin)
        spins = to_move(Chain(crusher, angles, (0.0, 0.0)), shaft.pin_velocity)
        chain = Chain(crusher, angles, spins)
        wanted = to_move(chain, -(crusher.speed**2) * shaft.to_pin - chain.still_a)
        free, by_x, by_y = (
            np.array(chain.accelerations(crusher, force, 0.0)) for force in (0j, 1 + 0j, 1j)
        )
        matrix = np.stack([by_x - free, by_y - free], axis=1)
        force = complex(*np.linalg.solve(matrix, np.array(wanted) - free))
        rows.append(forces(crusher, shaft, chain, force, shaft.pin, wanted, 0.0))
    return histories(rows)


class Motion:
    """A motion with clearance: y = (theta3, theta2, theta3', theta2'[, theta1, theta1'])."""

    def __init__(
        self, crusher: Crusher, torque: float | None = None, e: complex = 0j, rate: complex = 0j
    ):
        """Start at eccentricity `e` (m) and `rate` (m/s).

        Driven at constant speed, or with the shaft free under `torque` (N m).
        """
        self.crusher, self.torque = crusher, torque
        shaft = Shaft(crusher, 0.0, crusher.speed)
        angles = assemble(crusher, shaft.pin - e)
        spins = to_move(Chain(crusher, angles, (0.0, 0.0)), shaft.pin_velocity - rate)
        free = () if torque is None else (0.0, crusher.speed)
        self.start = np.array([*angles, *spins, *free])

    def _parts(self, time: float, y) -> tuple[Shaft, Chain, Touch]:
        c = self.crusher
        t3, t2, w3, w2, *free = y.tolist()
        shaft = Shaft(c, *(free or (c.speed * time, c.speed)))
        chain = Chain(c, (t3, t2), (w3, w2))
        return (
            shaft,
            chain,
            contact(c, shaft.pin, shaft.pin_velocity, chain.a, chain.velocity_a, w2, shaft.spin),
        )

    def _accelerations(self, shaft: Shaft, chain: Chain, touch: Touch):
        c = self.crusher
        moment = cross(touch.point - chain.a, touch.force)
        of_chain = chain.accelerations(c, touch.force, moment)
        if self.torque is None:
            return of_chain, 0.0
        on_shaft = self.torque + shaft.moment(c, touch.force, touch.point)
        return of_chain, on_shaft / c.shaft_inertia

    def field(self, time: float, y) -> list[float]:
        """Return the rate y'."""
        parts = self._parts(time, y)
        of_chain, spin_rate = self._accelerations(*parts)
        free = () if self.torque is None else (parts[0].spin, spin_rate)
        return [*y[2:4], *of_chain, *free]

    def corners(self, time: float, y) -> list[float]:
        """Return what passes zero at the law's corner: the penetration, m; negative in flight."""
        return [self._parts(time, y)[2].depth]

    def observe(self, times, states) -> dict[str, np.ndarray]:
        """Return histories at `times` (s) along `states`: forces in N, eccentricity in m."""
        rows = []
        for time, y in zip(np.asarray(times).tolist(), states, strict=True):
            shaft, chain, touch = self._parts(time, y)
            of_chain, spin_rate = self._accelerations(shaft, chain, touch)
            known = {
                "contact_force": abs(touch.force),
                "normal_force": touch.normal,
                "friction_force": touch.tangential,
                "eccentricity": touch.eccentricity,
                "shaft_speed": shaft.spin,
            }
            rows.append(
                known
                | forces(self.crusher, shaft, chain, touch.force, touch.point, of_chain, spin_rate)
            )
        return histories(rows)
