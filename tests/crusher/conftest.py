"""What the tests of the crusher's equations share."""

from types import SimpleNamespace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.crusher import observables as ob
from jaxcrusher.crusher.joints import JOINTS
from jaxcrusher.mechanism.drives import CrankState

# Shares of a turn at which power is looked at: at time zero the sine of an acceleration is zero.
INSTANTS = np.array([0.0, 0.13, 0.4, 0.77])


@pytest.fixture(scope="session")
def balance():
    """Power of a scene that is not accounted for, and the size of its terms, W.

    The pins are as at its start, the shaft has turned by each of `INSTANTS`; the worst one counts.
    """

    def at(time, scene):
        formulation = scene.formulation
        state = formulation.initial(turned(scene, time))

        def energy(time, state):
            s = formulation.snapshot(time, state, scene)
            parts = (ob.kinetic_energy, ob.potential_energy, ob.elastic_energy)
            return sum(part(s, scene) for part in parts)

        s = formulation.snapshot(time, state, scene)
        rate = formulation.rate(s, state, scene)
        _, change = jax.jvp(energy, (time, state), (jnp.array(1.0), rate))
        inputs = ob.drive_power(s, scene), ob.load_power(s, scene)
        losses = [ob.contact_loss(s, scene), ob.friction_loss(s, scene)]
        losses += [] if scene.rod is None else [ob.rod_loss(s, scene)]
        scale = sum(jnp.abs(power) for power in (*inputs, *losses))
        # Forces at speeds of about 1 m/s.
        forces = [ob.force_at(s, scene, joint) for joint in JOINTS]
        return change - sum(inputs) + sum(losses), scale + sum(forces)

    @eqx.filter_jit
    def of_scene(scene):
        times = 2 * jnp.pi * INSTANTS / scene.drive.speed
        difference, scale = jax.vmap(at, in_axes=(0, None))(times, scene)
        worst = jnp.argmax(jnp.abs(difference) / scale)
        return difference[worst], scale[worst]

    return of_scene


def turned(scene, time):
    """The scene whose start is the shaft's place at a time, prescribed or free."""
    drive = scene.drive

    def initial():
        free = drive.initial()
        return free if free is None else CrankState(drive.speed * time, free.relative_speed)

    def crank(_, state):
        return drive.crank(time, state)

    later = SimpleNamespace(initial=initial, crank=crank, speed=drive.speed)
    return eqx.tree_at(lambda s: s.drive, scene, later)
