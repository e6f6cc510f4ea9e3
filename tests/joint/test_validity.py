"""What the contact model assumes of a bearing's fit."""

import jax.numpy as jnp
import pytest

import jaxcrusher as jc
from jaxcrusher.joint.validity import validity


@pytest.mark.parametrize(
    ("clearance", "fits"), [(0.12e-3, True), (1.29e-3, True), (1.31e-3, False)]
)
def test_a_wide_clearance_is_outside_the_model(clearance, fits):
    """A hundredth of the bore's 130 mm, though the contact is narrow and the approach slow."""
    found = validity(jc.paper_scene(30.0, clearance).joint, jnp.array(0.01), jnp.array(0.001))
    assert bool(found.hertzian) and bool(found.elastic)
    assert bool(found.fitting) == bool(found.inside) == fits
    assert [line.startswith("clearance 0.01") for line in found.remarks()] == [True] * (not fits)
    assert float(found.clearance_ratio) == pytest.approx(clearance / 0.13)


def test_an_ideal_joint_is_inside_and_has_no_restitution():
    found = validity(None, jnp.array(0.0), jnp.array(0.0))
    assert bool(found.inside) and found.remarks() == []
    assert jnp.isnan(found.delivered_restitution) and jnp.isnan(found.asked_restitution)
