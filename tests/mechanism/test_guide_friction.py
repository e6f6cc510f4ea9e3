"""Friction of guides without a gap: a closed form, its own feedback, and what it refuses."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.basics.plane import Arm, Vector
from jaxcrusher.joint.bristles import LuGre
from jaxcrusher.joint.friction import AmbrosioFriction, SurfaceSlip
from jaxcrusher.mechanism.acting import Push
from jaxcrusher.mechanism.drives import ConstantSpeed, GivenTorque
from jaxcrusher.mechanism.linkage import Body, Joint, Linkage, Point, Slide
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.topology import FRAME

CRANK, ROD, PUSH = 0.05, 0.12, 300.0


def law(coefficient):
    """Full friction from a speed on that the slow crank passes at once."""
    return AmbrosioFriction(SurfaceSlip(), coefficient, 0.0, 1e-9, 1e-10)


def two_sliders(length=None, off=0.0):
    """Two sliders on one crank, on slides at right angles."""
    bodies, joints, slides = {"crank": Body(0.3, 1e-4)}, {}, {}
    joints["O"] = Joint(Point(FRAME), Point("crank"))
    for name, along in (("a", Vector(1.0, 0.0)), ("b", Vector(0.0, 1.0))):
        bodies |= {f"rod_{name}": Body(0.1, 1e-4, Arm(0.06)), f"slider_{name}": Body(0.2, 1e-4)}
        joints[f"big_{name}"] = Joint(Point(f"rod_{name}"), Point("crank", Arm(CRANK)))
        pin = Point(f"slider_{name}", Arm(0.0, off))
        joints[f"wrist_{name}"] = Joint(Point(f"rod_{name}", Arm(ROD)), pin)
        slides[f"guide_{name}"] = Slide(f"slider_{name}", along, length=length)
    parts = Named(bodies), Named(joints), "crank", "O", (1, 1), 0.0
    return Linkage(*parts, slides=Named(slides))


def seen(coefficient, angle=0.7, length=None, off=0.0, drive=None, rubbing=("guide_a", "guide_b")):
    """An instant at a crank's angle; each slider is pushed towards the crank."""
    drive = ConstantSpeed(1e-3) if drive is None else drive
    scene = Scene(
        linkage=two_sliders(length, off),
        joints=Named(),
        drive=drive,
        pushes=(
            Push(Point("slider_a"), Vector(-PUSH, 0.0)),
            Push(Point("slider_b"), Vector(0.0, -PUSH)),
        ),
        guides=Named(dict.fromkeys(rubbing, law(coefficient))),
        start=None,
    )
    state = scene.formulation.initial(scene)
    if state.crank is not None:
        state = dataclasses.replace(
            state, crank=dataclasses.replace(state.crank, angle=jnp.asarray(angle))
        )
    time = jnp.asarray(angle) / drive.speed
    return scene, scene.formulation.snapshot(time, state, scene)


@pytest.mark.parametrize("angle", [0.7, 2.2, 3.6, 5.5])
@pytest.mark.parametrize("coefficient", [0.1, 0.9])
def test_a_slow_slider_follows_the_closed_form(angle, coefficient):
    """The rod carries F cos b = P +- mu |N|, the guide N = F sin b = P tan b / (1 -+ mu tan b).

    Inertia of 1e-6 m/s2 on 0.2 kg is 1e-9 of the push; the ramp of friction is full.
    """
    _, s = seen(coefficient, angle)
    slope = CRANK * np.sin(angle) / np.sqrt(ROD**2 - (CRANK * np.sin(angle)) ** 2)  # tan b
    speed = float(s.motion.velocity(Point("slider_a")).x)
    # The push leads back: friction helps it as the slider goes ahead, and hinders it else.
    drag = coefficient * np.sign(speed)
    force = PUSH / (1 - drag * abs(slope))
    at = s.accelerations.slides.at("guide_a")
    assert float(at.force) == pytest.approx(-force * slope, rel=1e-7)
    assert float(at.friction) == pytest.approx(drag * abs(force * slope), rel=1e-7)
    assert float(at.feedback) == pytest.approx(coefficient * abs(slope), rel=1e-7)


@pytest.mark.parametrize("length", [None, 0.06], ids=["middle", "ends"])
@pytest.mark.parametrize("free", [False, True], ids=["driven", "free"])
def test_friction_is_that_of_the_forces_it_brings_forth(length, free):
    """S = m sum |N_e| of the reactions under S, of two slides that a free crank couples."""
    drive = GivenTorque(5.0, 20.0) if free else ConstantSpeed(20.0)
    _, s = seen(0.3, 0.7, length, 0.01, drive)
    for name, slider in (("guide_a", "slider_a"), ("guide_b", "slider_b")):
        at = s.accelerations.slides.at(name)
        turning = 0.0 if length is None else at.moment / length
        ends = abs(at.force / 2 + turning) + abs(at.force / 2 - turning)
        ahead = s.motion.linkage.slides.at(name).direction
        speed = float(ahead.dot(s.motion.velocity(Point(slider))))
        # To rounding of forces of some 100 N.
        per_newton = law(0.3).force(jnp.ones(()), jnp.asarray(-speed))
        assert float(at.friction) == pytest.approx(float(per_newton * ends), rel=1e-12)


def test_a_moment_rubs_as_a_force_does():
    """A wrist off the line presses the ends to both edges: more friction than the force alone."""
    (_, middle), (_, ends) = seen(0.3, length=None, off=0.03), seen(0.3, length=0.04, off=0.03)
    one, other = (s.accelerations.slides.at("guide_a").friction for s in (middle, ends))
    assert abs(float(other)) > 1.5 * abs(float(one))


def test_a_slide_that_jams_is_outside_of_the_model():
    """At mu tan b = 1 friction brings forth itself; the limit is told with its share."""
    scene, s = seen(4.0, 1.5)
    share = float(s.accelerations.slides.at("guide_a").feedback)
    assert share > 1
    of, names = scene.limits["guide_a"]
    assert names == ("guide_a_feedback",)
    verdict = of(jnp.asarray(share))
    assert not bool(verdict.inside)
    assert "may jam" in verdict.remarks()[0]
    assert bool(of(jnp.asarray(0.99)).inside)


def test_a_scene_refuses_what_does_not_fit():
    scene, _ = seen(0.1)
    for change, words in (
        ({"guides": Named({"O": law(0.1)})}, "guides.*be of slides without a gap"),
        ({"guides": Named({"guide_a": LuGre(SurfaceSlip())})}, "remembers nothing"),
    ):
        with pytest.raises(ValueError, match=words):
            dataclasses.replace(scene, **change)
