"""Natural frequencies and damping of a machine that stands on its supports."""

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float, Scalar

from jaxcrusher.basics.checks import require, require_untraced
from jaxcrusher.basics.plane import Vector
from jaxcrusher.basics.setup import require_set_up
from jaxcrusher.crusher.foundation import frame_at
from jaxcrusher.crusher.joints import AtJoints
from jaxcrusher.crusher.scene import Scene, require_scene
from jaxcrusher.crusher.snapshot import bodies_of, chain_of, crank_motion, mass_centres
from jaxcrusher.files.table import Column, dataset

COORDINATES = ("x", "y", "rotation")
COLUMNS = {
    "frequency": Column("Hz", "frequency"),
    "damped_frequency": Column("Hz", "frequency of free vibration"),
    "damping_ratio": Column("1", "damping ratio"),
    "share": Column("1", "share of the kinetic energy", dims=("coordinate",)),
}
# Newton's steps to where the machine stands; its last one, as a share of the sag.
STEPS, STANDING = 50, 1e-12


def natural_modes(scene: Scene) -> xr.Dataset:
    """Return the natural modes of the machine at rest on its supports, the slowest first.

    Shaft, jaw and toggle stand still in the frame, the shaft at angle zero and its pins in the
    middle of their bores. The equations are linear about the place where the springs carry all
    weight; weight that leans counts too.

    **Arguments:**

    - `scene`: with a frame on supports, and with concrete values.

    **Returns:** an `xarray.Dataset` of the dimension `mode`: `frequency` (Hz) is the modulus of the
    eigenvalue over 2 pi, `damping_ratio` its negative real part over its modulus, and
    `damped_frequency` (Hz) its imaginary part over 2 pi. A pair of real eigenvalues is one mode, at
    the root of their product, with a damping ratio of 1 or more. `share(mode, coordinate)` is how
    much of the kinetic energy is in x, y and rotation of the frame's G.

    Raises ValueError for a clamped frame, under `jax.jit`, and for a machine that topples.
    """
    require_set_up()
    require_scene(scene)
    require(scene.supports is not None, "scene", "have a frame on supports", "clamped")
    require_untraced("scene", scene, "natural_modes", "jaxcrusher.periodic_orbit")
    matrices = [np.asarray(one) for one in _linearised(scene)]
    *_, left = matrices
    toppled = "stand on its supports, and does not topple"
    mass, damping, stiffness = matrices[:3]
    upright = np.isfinite(stiffness).all() and np.linalg.eigvalsh(stiffness).min() > 0
    require(bool(upright and left <= STANDING), "scene", toppled, "one that falls")
    inverse = np.linalg.inv(mass)
    upper = np.hstack([np.zeros((3, 3)), np.eye(3)])
    lower = np.hstack([-inverse @ stiffness, -inverse @ damping])
    found, vectors = np.linalg.eig(np.vstack([upper, lower]))
    values = np.asarray(found, complex)
    modes = [(one, other, k) for one, other, k in _pairs(values)]
    modes.sort(key=lambda mode: abs(mode[0] * mode[1]))
    sizes = np.sqrt([abs(one * other) for one, other, _ in modes])
    sums = np.array([(one + other).real for one, other, _ in modes])
    energies = [np.diag(mass) * np.abs(vectors[:3, k]) ** 2 for _, _, k in modes]
    turns = 2 * np.pi
    told = {
        "frequency": sizes / turns,
        "damped_frequency": np.array([abs(np.imag(values)[k]) for _, _, k in modes]) / turns,
        "damping_ratio": -sums / (2 * sizes),
        "share": np.array([one / one.sum() for one in energies]),
    }
    return dataset(("mode",), told, COLUMNS, {"coordinate": list(COORDINATES)})


def _pairs(values: np.ndarray) -> list[tuple[complex, complex, int]]:
    """Return eigenvalues two by two with the place of one: conjugates, and real ones in order."""
    found = [(values[k], np.conj(values[k]), int(k)) for k in np.flatnonzero(np.imag(values) > 0)]
    real = np.flatnonzero(np.imag(values) == 0)
    real = real[np.argsort(np.abs(values[real]))]
    # The slowest of overdamped motions goes with the fastest.
    for slow, fast in zip(real[: len(real) // 2], real[::-1], strict=False):
        found.append((values[slow], values[fast], int(slow)))
    return found


@jax.jit
def _linearised(scene: Scene) -> tuple[Array, Array, Array, Scalar]:
    """Return the matrices of mass, damping and stiffness, and the last step of finding the place.

    The coordinates are displacement and rotation of G.
    """
    foundation, machine = scene.supports, scene.machine
    assert foundation is not None
    still = jnp.zeros_like(scene.drive.speed)
    shaft, none = crank_motion(still, still), AtJoints()
    arms = [
        place - foundation.point
        for place in mass_centres(machine, shaft, chain_of(machine, shaft, none, none))
    ]
    bodies = list(zip(bodies_of(machine), arms, strict=True))

    def at(q: Float[Array, "3"], rate: Float[Array, "3"]):
        return frame_at(Vector(q[0], q[1]), q[2], Vector(rate[0], rate[1]), rate[2])

    def potential(q: Float[Array, "3"]) -> Scalar:
        frame = at(q, jnp.zeros(3))
        height = foundation.mass * q[1]
        for body, arm in bodies:
            height = height + body.mass * (q[1] + arm.along(frame.axis).y)
        return foundation.elastic_energy(frame) + machine.gravity * height

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

    bend = jax.hessian(potential)

    def newton(_, both: tuple[Array, Array]) -> tuple[Array, Array]:
        step = -jnp.linalg.solve(bend(both[0]), jax.grad(potential)(both[0]))
        return both[0] + step, step

    q, step = jax.lax.fori_loop(0, STEPS, newton, (jnp.zeros(3), jnp.ones(3)))
    left = jnp.max(jnp.abs(step)) / (jnp.max(jnp.abs(q)) + 1e-9)
    rest = jnp.zeros(3)
    return jax.hessian(kinetic)(rest, q), jax.hessian(dissipated)(rest, q), bend(q), left
