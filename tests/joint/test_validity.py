"""What the contact model assumes of a bearing's fit."""

import jax.numpy as jnp
import pytest

import jaxcrusher as jc
from jaxcrusher.joint.validity import RollerLoad, Tautness, Turning, validity


@pytest.mark.parametrize(
    ("clearance", "fits"), [(0.12e-3, True), (1.29e-3, True), (1.31e-3, False)]
)
def test_a_wide_clearance_is_outside_the_model(clearance, fits):
    """A hundredth of the bore's 130 mm, though the contact is narrow and the approach slow."""
    found = validity(
        jc.paper_scene(30.0, clearance).joints.at("main"), jnp.array(0.01), jnp.array(0.001)
    )
    assert bool(found.hertzian) and bool(found.elastic)
    assert bool(found.fitting) == bool(found.inside) == fits
    assert [line.startswith("clearance 0.01") for line in found.remarks()] == [True] * (not fits)
    assert float(found.clearance_ratio) == pytest.approx(clearance / 0.13)


def test_an_ideal_joint_is_inside_and_has_no_restitution():
    found = validity(None, jnp.array(0.0), jnp.array(0.0))
    assert bool(found.inside) and found.remarks() == []
    assert found.delivered_restitution is None and found.asked_restitution is None
    assert bool(found.restitution_kept)


def test_rollers_have_no_restitution():
    joint = jc.build_scene({"contact_law": "rollers"}).joints.at("main")
    found = validity(joint, jnp.array(0.1), jnp.array(1.0))
    assert found.delivered_restitution is None and bool(found.restitution_kept)
    assert found.remarks() == ["approaches at 19.6 times the elastic limit"]


def test_the_width_that_is_said_is_half_of_the_contact_s():
    """Hertz's half-width sqrt(R delta) of 0.6 bore radii: the contact itself is 1.2 wide."""
    joint = jc.paper_scene(30.0, 0.06e-3).joints.at("main")
    bore, pin = 0.13, 0.13 - 0.06e-3
    depth = (0.6 * bore) ** 2 * (bore - pin) / (bore * pin)
    found = validity(joint, jnp.array(depth / 0.06e-3), jnp.array(0.001))
    assert found.remarks() == ["contact of half-width 0.60 radii: not Hertzian"]


@pytest.mark.parametrize(
    ("of", "beyond"),
    [
        (RollerLoad(jnp.array(0.9), jnp.array(0.8)), None),
        (
            RollerLoad(jnp.array(1.21), jnp.array(0.5)),
            "0.50 of the static rating, 1.21 of its pressure",
        ),
        (
            RollerLoad(jnp.array(0.7), jnp.array(2.0)),
            "2.00 of the static rating, 0.70 of its pressure",
        ),
        (Turning(jnp.array(0.1)), None),
        (
            Turning(jnp.array(0.0)),
            "comes to rest, where friction without stiction does not hold it",
        ),
        (Tautness(jnp.array(0.0)), None),
        (Tautness(jnp.array(-12.34)), "slack, short of tension by 12.3 N"),
    ],
)
def test_rollers_rod_and_shaft_say_what_is_beyond_their_limits(of, beyond):
    assert bool(of.inside) == (beyond is None)
    assert of.remarks() == ([] if beyond is None else [beyond])
