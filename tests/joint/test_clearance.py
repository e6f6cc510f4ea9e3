"""What a contact does to bore and pin: its power is what the losses and the spring take."""

import jax.numpy as jnp
import pytest

import jaxcrusher as jc
from jaxcrusher.basics.plane import Vector

# e in m, e' in m/s, and both spins in rad/s.
PLACES = (
    ((6.2e-5, 1e-6), (0.02, 0.3), 1.5, 30.0),
    ((-3e-5, 5.5e-5), (0.3, 0.2), -4.0, 30.0),
    ((1e-5, -7e-5), (0.4, -0.2), 2.0, -11.0),
)


@pytest.mark.parametrize("slip", ["centre", "surface"])
@pytest.mark.parametrize(("at", "rate", "bearing_spin", "journal_spin"), PLACES)
def test_power_of_a_contact(at, rate, bearing_spin, journal_spin, slip):
    """Forces and moments on both bodies take what spring, damping and friction get."""
    joint = jc.build_scene({"slip": slip}).joints.at("main")
    e, change = (Vector(*map(jnp.asarray, of)) for of in (at, rate))
    contact = joint.contact(e, change, bearing_spin, journal_spin, None)
    assert float(contact.normal_force) > 100 and abs(float(contact.friction_force)) > 1
    taken = contact.force.dot(change)
    taken -= contact.bearing_moment * bearing_spin + contact.journal_moment * journal_spin
    stored = joint.normal.elastic_force(contact.penetration) * contact.penetration_rate
    # Rounding of the largest of them.
    size = abs(contact.force.dot(change)) + abs(contact.bearing_moment * journal_spin)
    known = stored + contact.normal_loss + contact.friction_loss
    assert float(taken) == pytest.approx(float(known), abs=1e-9 * float(size))
