"""What few nodes leave: the error that an orbit says bounds the one that more nodes show."""

import numpy as np
import pytest

import jaxcrusher as jc
from jaxcrusher.orbits.solving import orbit_nodes, with_statistics


def by_nodes(scene, nodes):
    return with_statistics(scene, *orbit_nodes(scene, None, 1, nodes), 1)


def apart(one, other):
    sizes, others = (np.sort(np.abs(orbit.multipliers)) for orbit in (one, other))
    return np.max(np.abs(sizes - others))


@pytest.mark.parametrize(
    ("speed", "clearance"), [(30.0, 0.06e-3), (27.9188406, 7.868e-5), (29.37, 3.6e-5)]
)
def test_the_error_of_the_rms_bounds_it(speed, clearance):
    """With 24 nodes the harmonics that they lack matter: without these it was 3.2 times too low."""
    scene = jc.paper_scene(speed, clearance)
    few, many = by_nodes(scene, 24), by_nodes(scene, 192)
    true = abs(float(few.foundation_rms / many.foundation_rms) - 1)
    assert true > 1e-9  # far above rounding
    assert true < few.error < 8 * true


def test_the_error_of_multipliers_knows_of_the_nodes():
    """Few nodes move their moduli by more than the steps do."""
    scene = jc.paper_scene(35.0, 0.1e-3)
    few, many = by_nodes(scene, 24), by_nodes(scene, 192)
    assert many.multipliers_error < 1e-6 < 1e-5 < apart(few, many)
    assert apart(few, many) < few.multipliers_error < 8 * apart(few, many)
