"""A machine on its supports: natural frequencies and damping, and how it is run up and down."""

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
import xarray as xr
from jaxtyping import Array, Complex, Float, Scalar

from jaxcrusher.basics.checks import require, require_positive, require_untraced
from jaxcrusher.basics.plane import Vector
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.files.table import Column, dataset
from jaxcrusher.mechanism.motion import ideal_at_rest
from jaxcrusher.mechanism.scene import Scene, require_scene
from jaxcrusher.mechanism.snapshot import frame_at

COORDINATES = ("x", "y", "rotation")
COLUMNS = {
    "frequency": Column("Hz", "natural frequency without damping"),
    "damping_ratio": Column("1", "damping ratio of the mode"),
    "share": Column("1", "share of the kinetic energy", dims=("coordinate",)),
    "shape": Column("m, rad", "motion of G, of modal mass 1 kg m2", dims=("coordinate",)),
}
FREE_COLUMNS = {
    "decay": Column("1/s", "rate of decay of a free motion"),
    "damped_frequency": Column("Hz", "frequency of free vibration; 0 is overdamped"),
}
# Newton's steps to where the machine stands; its last one, as a share of the sag.
STEPS, STANDING = 50, 1e-12
# Rounding of the eigenvalues, over the largest of the matrix, which is normal without damping, and
# that of a double eigenvalue, its root.
UNDAMPED, CRITICAL = 1e-13, 1e-6
# Instants of a run-up in a turn at the running speed, and at least so many in each of the highest
# order.
INSTANTS, OF_AN_ORDER = 128, 32


def natural_modes(scene: Scene) -> xr.Dataset:
    """Return the natural modes of the machine at rest on its supports, the slowest first.

    Its bodies stand still in the frame, the crank at angle zero and its pins in the
    middle of their bores. The equations are linear about the place where the springs carry all
    weight; weight that leans counts too.

    **Arguments:**

    - `scene`: with a frame on supports, and with concrete values.

    **Returns:** an `xarray.Dataset`. Its dimension `mode` has the modes of M q'' + K q = 0:
    `frequency` (Hz) is the natural frequency without damping, which a speed is compared with, and
    `shape(mode, coordinate)` is the motion in x, y (m) and rotation (rad) of the frame's G that has
    a modal mass of 1 kg m2. `share(mode, coordinate)` is how much of the kinetic energy is in each.
    `damping_ratio` is shape' C shape / (2 omega), which leaves out that the dampers couple the
    modes (Clough and Penzien, Dynamics of Structures, chapter 12).

    The dimension `free` has the free motions with damping, which are the eigenvalues of M, C and K
    together, by their modulus: `decay` (1/s) is the negative real part, and `damped_frequency` (Hz)
    is the imaginary part over 2 pi. It is zero for an overdamped motion, which does not vibrate.
    There are three free motions, and one more for each overdamped pair.

    Raises ValueError for a clamped frame, under `jax.jit`, and for a machine that topples.
    """
    mass, damping, stiffness = mass_damping_stiffness(scene)
    squares, shapes = scipy.linalg.eigh(stiffness, mass)
    rates, dampers = np.sqrt(squares), shapes.T @ damping @ shapes
    energies = np.diag(mass) * shapes.T**2
    told = {
        "frequency": rates / (2 * np.pi),
        "damping_ratio": np.diag(dampers) / (2 * rates),
        "share": energies / energies.sum(axis=1, keepdims=True),
        "shape": shapes.T,
    }
    decay, damped = _free(rates, dampers)
    free = dataset(("free",), {"decay": decay, "damped_frequency": damped}, FREE_COLUMNS, {})
    return dataset(("mode",), told, COLUMNS, {"coordinate": list(COORDINATES)}).merge(free)


def mass_damping_stiffness(scene: Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return mass, damping and stiffness about the standing place, for x, y (m) and rotation of G.

    Raises ValueError as `natural_modes` does.
    """
    require_set_up()
    require_scene(scene)
    require(scene.supports is not None, "scene", "have a frame on supports", "clamped")
    require_untraced("scene", scene, "natural_modes", "jaxcrusher.periodic_orbit")
    mass, damping, stiffness, left = (np.asarray(one) for one in _mass_damping_stiffness(scene))
    toppled = "stand on its supports, and does not topple"
    upright = np.isfinite(stiffness).all() and np.linalg.eigvalsh(stiffness).min() > 0
    require(bool(upright and left <= STANDING), "scene", toppled, "one that falls")
    return mass, damping, stiffness


def amplification(ratio: float, damping_ratio: float) -> float:
    """Return the amplitude of a mode under an oscillating force over its static displacement.

    `ratio` is the frequency of the force over the natural frequency: 1 / |1 - ratio^2 + 2 i zeta
    ratio| (Clough and Penzien, Dynamics of Structures, chapter 3).
    """
    return 1 / abs(1 - ratio**2 + 2j * damping_ratio * ratio)


def shares_of_energy(
    scene: Scene,
    force: Complex[np.ndarray, "3 orders"],
    rates: Float[np.ndarray, " orders"],
) -> Float[np.ndarray, "modes orders"]:
    """Return the share of the block's kinetic energy that each mode has at each frequency.

    The block is linear, the coupling of modes by dampers is kept, and the energies of the modes of
    M q'' + K q = 0 add up to the whole. A block that nothing moves has no shares: all are zero.

    **Arguments:**

    - `scene`: with a frame on supports.
    - `force`: complex amplitudes of Fx, Fy (N) and of the moment about G (N m) that excite it.
    - `rates`: their circular frequencies, rad/s.

    Raises ValueError as `natural_modes` does.
    """
    mass, damping, stiffness = mass_damping_stiffness(scene)
    _, shapes = scipy.linalg.eigh(stiffness, mass)
    moved = [
        np.linalg.solve(stiffness - rate**2 * mass + 1j * rate * damping, amplitude)
        for rate, amplitude in zip(rates, force.T, strict=True)
    ]
    energies = np.abs(rates * (shapes.T @ mass @ np.transpose(moved))) ** 2
    return energies / (energies.sum() or 1.0)


def _free(rates: np.ndarray, dampers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return decay (1/s) and frequency (Hz) of each free motion, the slowest first.

    `rates` (rad/s) are those of the modes without damping, `dampers` (1/s) couple them.
    """
    # Of the modes' velocities and of their displacements times their rates.
    matrix = np.block([[np.zeros((3, 3)), np.diag(rates)], [-np.diag(rates), -dampers]])
    values = np.linalg.eigvals(matrix)
    size, decay, swing = np.abs(values), -np.real(values), np.imag(values)
    decay = np.where(np.abs(decay) > UNDAMPED * np.abs(matrix).max(), decay, 0.0)
    swing = np.where(np.abs(swing) > CRITICAL * size, swing, 0.0)
    kept = [k for k in np.argsort(size) if swing[k] >= 0]  # one of each pair
    return decay[kept], swing[kept] / (2 * np.pi)


@jax.jit
def _mass_damping_stiffness(scene: Scene) -> tuple[Array, Array, Array, Scalar]:
    """Return the matrices of mass, damping and stiffness, and the last step of finding the place.

    The coordinates are displacement and rotation of G.
    """
    foundation, linkage = scene.supports, scene.linkage
    assert foundation is not None
    at_rest = ideal_at_rest(linkage, 0.0)
    bodies = [
        (body, at_rest.centre(name) - foundation.point) for name, body in linkage.bodies.items()
    ]

    def at(q: Float[Array, "3"], rate: Float[Array, "3"]):
        return frame_at(Vector(q[0], q[1]), q[2], Vector(rate[0], rate[1]), rate[2])

    def potential(q: Float[Array, "3"]) -> Scalar:
        frame = at(q, jnp.zeros(3))
        height = foundation.mass * q[1]
        for body, arm in bodies:
            height = height + body.mass * (q[1] + arm.along(frame.axis).y)
        return foundation.elastic_energy(frame) + linkage.gravity * height

    def kinetic(rate: Float[Array, "3"], q: Float[Array, "3"]) -> Scalar:
        frame = at(q, rate)
        total = foundation.mass * frame.velocity.dot(frame.velocity)
        total = total + foundation.inertia * frame.spin**2
        for body, arm in bodies:
            velocity = frame.velocity + frame.spin * arm.along(frame.axis).perp()
            total = total + body.mass * velocity.dot(velocity) + body.inertia * frame.spin**2
        return total / 2

    def dissipated(rate: Float[Array, "3"], q: Float[Array, "3"]) -> Scalar:
        return foundation.loss(at(q, rate)) / 2

    stiffness = jax.hessian(potential)

    def newton(_, both: tuple[Array, Array]) -> tuple[Array, Array]:
        step = -jnp.linalg.solve(stiffness(both[0]), jax.grad(potential)(both[0]))
        return both[0] + step, step

    q, step = jax.lax.fori_loop(0, STEPS, newton, (jnp.zeros(3), jnp.ones(3)))
    left = jnp.max(jnp.abs(step)) / (jnp.max(jnp.abs(q)) + 1e-9)
    rest = jnp.zeros(3)
    return jax.hessian(kinetic)(rest, q), jax.hessian(dissipated)(rest, q), stiffness(q), left


def run_up(
    scene: Scene,
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
    mass, damping, stiffness = mass_damping_stiffness(scene)
    speed = float(scene.drive.speed)
    steps = max(INSTANTS, OF_AN_ORDER * force.shape[1])
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
    scene: Scene, sideways: Complex[np.ndarray, " orders"]
) -> Complex[np.ndarray, " orders"]:
    """Return the moment (N m) of the bodies' weights on a frame that stands still.

    `sideways` are the amplitudes of the force Fx on it, of the orders 1, 2 and so on: the inertia
    of bodies that swing sideways, whose weights swing with them.
    """
    rates = float(scene.drive.speed) * np.arange(1, len(sideways) + 1)
    return -float(scene.linkage.gravity) * sideways / rates**2
