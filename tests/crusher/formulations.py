"""A crusher by both formulations, each with its ledger of energy."""

import numpy as np

import jaxcrusher as jc


def forces_by_both(values):
    """The force on the foundation over 10 ms; the ledgers close, and friction takes energy."""
    forces = []
    for formulation in ("eccentricity", "multiplier"):
        scene = jc.build_scene(values | {"formulation": formulation})
        outputs = ("foundation_force", "energy")
        motion = jc.simulate(scene, np.linspace(0, 0.01, 6), outputs=outputs)
        forces.append(motion.foundation_force)
        assert motion.energy.friction_loss[-1] > 0
        # Joules, of some 10 kJ.
        assert np.max(np.abs(motion.energy.imbalance)) < 1e-9
    return forces
