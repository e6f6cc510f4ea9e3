"""What the tests of the crusher's equations share."""

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest

from jaxcrusher.crusher import observables as ob
from jaxcrusher.crusher.joints import JOINTS


@pytest.fixture(scope="session")
def balance():
    """Power of a scene at its start that is not accounted for, and the size of its terms, W."""

    @eqx.filter_jit
    def of_scene(scene):
        formulation, time = scene.formulation, jnp.array(0.0)
        state = formulation.initial(scene)

        def energy(time, state):
            s = formulation.snapshot(time, state, scene)
            parts = (ob.kinetic_energy, ob.potential_energy, ob.elastic_energy)
            return sum(part(s, scene) for part in parts)

        s = formulation.snapshot(time, state, scene)
        rate = formulation.rate(s, state, scene)
        _, change = jax.jvp(energy, (time, state), (jnp.array(1.0), rate))
        inputs = ob.drive_power(s, scene), ob.load_power(s, scene)
        losses = ob.contact_loss(s, scene), ob.friction_loss(s, scene)
        scale = sum(jnp.abs(power) for power in (*inputs, *losses))
        # Forces at speeds of about 1 m/s.
        forces = [ob.force_at(s, scene, joint) for joint in JOINTS]
        return change - sum(inputs) + sum(losses), scale + sum(forces)

    return of_scene
