"""The equations of a crusher as they were derived by hand, once for each kind of scene.

The data are of the package before this room: open chain, free bodies, closed linkage and moving
frame, each by equations of its own.
"""

import json
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

import jaxcrusher as jc
from jaxcrusher.crusher.template import OBSERVABLES
from jaxcrusher.mechanism import observables as general
from jaxcrusher.mechanism.drives import GivenTorque
from tests.pairs import slow

DATA = json.loads(Path(__file__).with_name("derived_by_hand.json").read_text())
ENERGIES = {"kinetic": general.kinetic_energy, "potential": general.potential_energy}
ENERGIES |= {"elastic": general.elastic_energy}


# Of each kind of scene one; power, momentum and the other formulation see the rest too.
SOON = ["A, given speed", "A rod load, given torque", "ABC, given torque", "none, given speed"]
SOON += ["A frame, given torque", "BC frame rod, given speed"]
LATER = [kind for kind in DATA if kind not in SOON]


@pytest.mark.parametrize("kind", [*SOON, *slow(*LATER)])
def test_accelerations_reactions_and_energies(kind):
    scene = jc.build_scene({"speed": 30.0, "clearance": 6e-5, **DATA[kind]["values"]})
    if "torque" in kind:
        scene = eqx.tree_at(lambda s: s.drive, scene, GivenTorque(150.0, 30.0))
    start, unravel = ravel_pytree(scene.formulation.initial(scene))

    def seen(time, numbers):
        state = unravel(numbers)
        s = scene.formulation.snapshot(time, state, scene)
        found = {
            name: one(s, scene)
            for name, one in (OBSERVABLES | ENERGIES).items()
            if name in DATA[kind]["instants"][0]
        }
        rate = scene.formulation.rate(s, state, scene)
        return {"rate": ravel_pytree(rate)[0], **found}

    for one in DATA[kind]["instants"]:
        found = seen(
            jnp.asarray(one["time"]), jnp.asarray(one["state"], float).reshape(start.shape)
        )
        assert len(found) == len(one) - 2
        # Rounding of sums of forces; where a pin flies, its bore feels nothing.
        force = 1e-10 * one["foundation_force"]
        # The data smooth the length of a reaction that vanishes over 1e-6 N.
        smoothed = {"foundation_force": 1e-6}
        for name, value in found.items():
            size = np.abs(one[name]).max(initial=0.0)
            np.testing.assert_allclose(
                value,
                one[name],
                rtol=0,
                atol=1e-11 * size + force * (size < 1e-3) + smoothed.get(name, 0.0),
                err_msg=name,
            )
