"""Mechanisms that are no crushers, for the tests of what holds for all of them."""

import pytest

from jaxcrusher.basics.plane import Arm, Vector
from jaxcrusher.joint.clearance import ClearanceJoint
from jaxcrusher.joint.friction import AmbrosioFriction, SurfaceSlip
from jaxcrusher.joint.guide import Guide
from jaxcrusher.joint.normal import ConstantImpactVelocity, LankaraniNikravesh
from jaxcrusher.mechanism.acting import Push
from jaxcrusher.mechanism.drives import ConstantSpeed
from jaxcrusher.mechanism.linkage import Body, Joint, Linkage, Point, Slide
from jaxcrusher.mechanism.motion import continued
from jaxcrusher.mechanism.named import Named
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.mechanism.topology import FRAME
from jaxcrusher.mechanism.triads import Guess

RUBBING = AmbrosioFriction(SurfaceSlip(), 0.1)


def bearing(clearance=1e-4):
    law = LankaraniNikravesh(1e11, 0.7, ConstantImpactVelocity(0.1), width=1e-8)
    return ClearanceJoint(0.02, clearance, law, RUBBING)


def gap(name, linkage):
    """What is loose at a joint, or at a slide."""
    if name in linkage.joints:
        return bearing()
    return Guide(1e-4, 2e-3, bearing().normal, RUBBING)


def four_bar():
    """Crank, coupler and rocker; mass centres off the lines between joints, and bent links."""
    bodies = {
        "crank": Body(2.0, 0.01, Arm(0.02, 0.01)),
        "coupler": Body(5.0, 0.2, Arm(0.15, 0.04)),
        "rocker": Body(4.0, 0.1, Arm(0.1, -0.02)),
    }
    joints = {
        "base": Joint(Point(FRAME), Point("crank")),
        "big end": Joint(Point("coupler"), Point("crank", Arm(0.05))),
        # Bent: this joint is not on the coupler's axis, nor the rocker's.
        "small end": Joint(Point("coupler", Arm(0.3, 0.06)), Point("rocker", Arm(0.2, 0.03))),
        "pivot": Joint(Point(FRAME, Arm(0.3, -0.05)), Point("rocker")),
    }
    return Linkage(Named(bodies), Named(joints), "crank", "base", (1,))


def six_bar():
    """The four-bar linkage, whose rocker drives a second dyad."""
    one = four_bar()
    more = {"link": Body(1.5, 0.02, Arm(0.1)), "lever": Body(3.0, 0.05, Arm(0.08, 0.01))}
    joints = {
        "upper": Joint(Point("rocker", Arm(0.25, 0.0)), Point("link")),
        "middle": Joint(Point("lever", Arm(0.16)), Point("link", Arm(0.22))),
        "foot": Joint(Point(FRAME, Arm(0.55, 0.0)), Point("lever")),
    }
    return Linkage(
        Named({**dict(one.bodies.items()), **more}),
        Named({**dict(one.joints.items()), **joints}),
        "crank",
        "base",
        (1, 1),
    )


def slider_crank():
    """Masses and lengths as of Flores, but an inclined slide, and mass centres off all lines."""
    bodies = {
        "crank": Body(0.3, 1e-4, Arm(0.02, 0.01)),
        "rod": Body(0.21, 2.5e-4, Arm(0.06, -0.01)),
        "slider": Body(0.14, 1e-4, Arm(-0.01, 0.02)),
    }
    joints = {
        "base": Joint(Point(FRAME), Point("crank")),
        "big end": Joint(Point("rod"), Point("crank", Arm(0.05))),
        "wrist": Joint(Point("rod", Arm(0.12)), Point("slider", Arm(0.01, -0.015))),
    }
    slides = {"guide": Slide("slider", Vector(3.0, 1.0), Arm(0.02, -0.01), 0.05, 0.03)}
    return Linkage(Named(bodies), Named(joints), "crank", "base", (1,), slides=Named(slides))


def press():
    """A slider before its link, a pin and a bore the other way round, and a dyad on the slider."""
    one = slider_crank()
    bodies = {
        "slider": one.bodies.at("slider"),
        "rod": one.bodies.at("rod"),
        "crank": one.bodies.at("crank"),
        "lever": Body(0.4, 2e-3, Arm(0.08, 0.01)),
        "link": Body(0.2, 1e-3, Arm(0.05)),
    }
    wrist = one.joints.at("wrist")
    joints = {
        **dict(one.joints.items()),
        "wrist": Joint(wrist.pin, wrist.bore),
        "upper": Joint(Point("slider", Arm(0.02, 0.01)), Point("link")),
        "middle": Joint(Point("lever", Arm(0.15)), Point("link", Arm(0.12))),
        "foot": Joint(Point(FRAME, Arm(0.25, 0.1)), Point("lever")),
    }
    return Linkage(Named(bodies), Named(joints), "crank", "base", (1, -1), slides=one.slides)


def stephenson():
    """A plate on three bent bars, of which one hangs on the crank: a triad, pins either way."""
    bodies = {
        "plate": Body(3.0, 0.05, Arm(0.05, 0.06)),
        "crank": Body(2.0, 0.01, Arm(0.02, 0.01)),
        "rod": Body(1.0, 0.02, Arm(0.1, 0.01)),
        "rocker": Body(2.0, 0.03, Arm(0.1, -0.02)),
        "upper": Body(2.0, 0.03, Arm(0.1, 0.02)),
    }
    joints = {
        "base": Joint(Point(FRAME), Point("crank")),
        "big end": Joint(Point("rod"), Point("crank", Arm(0.035))),
        "small end": Joint(Point("rod", Arm(0.25, 0.02)), Point("plate")),
        "middle": Joint(Point("plate", Arm(0.15)), Point("rocker", Arm(0.2))),
        "corner": Joint(Point("upper", Arm(0.22, 0.01)), Point("plate", Arm(0.07, 0.12))),
        "pivot": Joint(Point(FRAME, Arm(0.42, -0.2)), Point("rocker")),
        "ceiling": Joint(Point("upper"), Point(FRAME, Arm(0.36, 0.34))),
    }
    guesses = Named({"plate": Guess(Vector(0.27, 0.05), 0.1)})
    return Linkage(Named(bodies), Named(joints), "crank", "base", (), guesses=guesses)


def chain():
    """The same, and behind it a triad with a slider, and a dyad on the middle of that."""
    one = stephenson()
    more = {
        "strap": Body(0.5, 0.002, Arm(0.08)),
        "lever": Body(0.6, 0.003, Arm(0.1)),
        "slider": Body(0.5, 0.001, Arm(-0.01, 0.02)),
        "prop": Body(0.8, 0.004, Arm(0.1, 0.01)),
        "link": Body(0.7, 0.003, Arm(0.1)),
        "table": Body(1.0, 0.01, Arm(0.04, 0.03)),
    }
    joints = {
        "hook": Joint(Point("rocker", Arm(0.14, -0.03)), Point("link")),
        "edge": Joint(Point("table"), Point("link", Arm(0.18))),
        "foot": Joint(Point(FRAME, Arm(0.7, -0.3)), Point("prop")),
        "knee": Joint(Point("prop", Arm(0.22, 0.01)), Point("table", Arm(0.08, -0.02))),
        "wrist": Joint(Point("table", Arm(0.04, 0.12)), Point("slider", Arm(0.01, -0.015))),
        "eye": Joint(Point("table", Arm(0.1, 0.05)), Point("strap")),
        "end": Joint(Point("strap", Arm(0.15)), Point("lever", Arm(0.19))),
        "ground": Joint(Point(FRAME, Arm(0.87, -0.2)), Point("lever")),
    }
    slides = {"guide": Slide("slider", Vector(0.1, 1.0), Arm(0.65, 0.02), 0.05, 0.03)}
    return Linkage(
        Named({**dict(one.bodies.items()), **more}),
        Named({**dict(one.joints.items()), **joints}),
        "crank",
        "base",
        (1,),
        slides=Named(slides),
        guesses=Named({**dict(one.guesses.items()), "table": Guess(Vector(0.6, -0.05), 0.1)}),
    )


@pytest.fixture(scope="session")
def linkages():
    made = {"four-bar": four_bar(), "six-bar": six_bar()}
    made |= {"slider-crank": slider_crank(), "press": press()}
    return made | {"stephenson": continued(stephenson()), "chain": continued(chain())}


@pytest.fixture(scope="session")
def machine(linkages):
    """A function from a linkage's name and its loose joints to a scene; other slides may rub."""

    def made(name, loose=(), drive=None, rubbing=()):
        drive = ConstantSpeed(20.0) if drive is None else drive
        linkage = linkages[name]
        bearings = Named({n: gap(n, linkage) for n in loose})
        guides = Named(dict.fromkeys(rubbing, RUBBING))
        pulled = "rocker" if "rocker" in linkage.bodies else "slider"
        centre = Point(pulled, linkage.bodies.at(pulled).mass_centre)
        pull = Push(centre, Vector(-700.0, 200.0))
        acting = {"drive": drive, "pushes": (pull,), "start": None}
        return Scene(linkage=linkage, joints=bearings, guides=guides, **acting)

    return made
