"""A machine on its supports that is run up, or down, through its natural frequencies."""

import numpy as np
from jaxtyping import Complex, Float

from jaxcrusher.basics.checks import require_positive
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.orbits.natural_modes import linearised

# Instants a turn at the running speed, and at least so many in each of the highest order.
STEPS, OF_AN_ORDER = 128, 32


def run_up(
    scene: AbstractScene,
    force: Complex[np.ndarray, "3 orders"],
    seconds: float,
    *,
    down: bool = False,
) -> Float[np.ndarray, "times 3"]:
    """Return the displacements x, y (m) and the rotation (rad) of G while the speed changes.

    The speed grows evenly from zero to the running speed in the given time, or falls evenly
    (`down`). The block is linear about its standing place, and the machine on it is a force.

    **Arguments:**

    - `scene`: with a frame on supports.
    - `force`: complex amplitudes of Fx, Fy (N) and of the moment about G (N m) on a frame that
      stands still, at the running speed, of the orders 1, 2 and so on: the force is the real part
      of the sum of `force[:, k - 1] exp(i k theta)`. Forces of inertia fall with the square of
      the speed, and the moment of the weights that move does not.
    - `seconds`: the time of the run, s.

    Raises ValueError for a time that is not positive, and as `natural_modes` does.
    """
    import scipy.signal  # takes a second, and the module is imported with every load sheet

    require_positive("seconds", seconds, "s")
    mass, damping, stiffness = linearised(scene)
    speed = float(scene.drive.speed)
    steps = max(STEPS, OF_AN_ORDER * force.shape[1])
    count = int(np.ceil(seconds * speed / (2 * np.pi) * steps)) + 1
    times = np.linspace(0.0, seconds, count)
    share = 1 - times / seconds if down else times / seconds
    # The angle is counted from standstill, so that a run down is a run up in reverse.
    angle = share**2 * speed * seconds / 2 * (-1 if down else 1)
    orders = np.arange(1, force.shape[1] + 1)
    turning = np.exp(1j * orders[:, None] * angle)
    weights = np.zeros_like(force)
    weights[2] = moment_of_weights(scene, force[0])
    # At each instant as at a constant speed.
    applied = np.real(share**2 * ((force - weights) @ turning) + weights @ turning)
    flexible = np.linalg.inv(mass)
    system = np.block([[np.zeros((3, 3)), np.eye(3)], [-flexible @ stiffness, -flexible @ damping]])
    pushed = np.vstack([np.zeros((3, 3)), flexible])
    # It begins at rest under the weights, or in the steady state of the running speed.
    start = np.concatenate([np.linalg.solve(stiffness, applied[:, 0]), np.zeros(3)])
    if down:
        start = np.zeros(6)
        for order, amplitude in zip(orders, force.T, strict=True):
            rate = order * speed
            dynamic = stiffness - rate**2 * mass + 1j * rate * damping
            moved = np.linalg.solve(dynamic, amplitude * np.exp(1j * order * angle[0]))
            start += np.concatenate([np.real(moved), np.real(1j * rate * moved)])
    shown = np.eye(3, 6), np.zeros((3, 3))
    _, seen, _ = scipy.signal.lsim((system, pushed, *shown), applied.T, times, X0=start)
    return seen


def moment_of_weights(
    scene: AbstractScene, sideways: Complex[np.ndarray, " orders"]
) -> Complex[np.ndarray, " orders"]:
    """Return the moment (N m) of the bodies' weights on a frame that stands still.

    `sideways` are the amplitudes of the force Fx on it, of the orders 1, 2 and so on: the inertia
    of bodies that swing sideways, whose weights swing with them.
    """
    rates = float(scene.drive.speed) * np.arange(1, len(sideways) + 1)
    return -float(scene.linkage.gravity) * sideways / rates**2
