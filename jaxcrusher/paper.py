"""The scenes of Wang, Cui, Wang, Appl. Sci. 2023, 13, 238: the PE250x400 of Tables 1 and 2."""

from typing import Literal

from jaxtyping import Scalar

from jaxcrusher.checks import require_choice, require_positive, require_within, require_x64
from jaxcrusher.contact import (
    ConstantImpactVelocity,
    LankaraniNikravesh,
    TrackedImpactVelocity,
    cylinder_stiffness,
)
from jaxcrusher.drives import ConstantSpeed
from jaxcrusher.formulations import (
    ClosedLinkage,
    EccentricityFormulation,
    MultiplierFormulation,
)
from jaxcrusher.friction import AmbrosioFriction, CentreSlip, SurfaceSlip
from jaxcrusher.joint import ClearanceJoint
from jaxcrusher.loads import AbstractLoad, AlongJaw, ClosingStroke, NormalToJaw
from jaxcrusher.machine import pe250x400
from jaxcrusher.scene import Scene, require_clearance
from jaxcrusher.starts import Centred, InContact

BORE_RADIUS = 0.13  # R_i, m
RESTITUTION = 0.9  # c_e
LOAD = 8.8e3  # F_load, N

STARTS = {"centred": Centred, "contact": InContact}
SLIPS = {"centre": CentreSlip, "surface": SurfaceSlip}
LOADS = {"along_jaw": AlongJaw, "normal_to_jaw": NormalToJaw, "closing_stroke": ClosingStroke}
FORMULATIONS = {"eccentricity": EccentricityFormulation, "multiplier": MultiplierFormulation}

LoadName = Literal["along_jaw", "normal_to_jaw", "closing_stroke"] | None


def paper_scene(
    speed: float | Scalar,
    clearance: float | Scalar,
    *,
    start: Literal["centred", "contact"] = "centred",
    slip: Literal["centre", "surface"] = "centre",
    friction: float | Scalar | None = 0.1,
    load: LoadName = "along_jaw",
    impact_velocity: float | Scalar | Literal["tracked"] = 0.5,
    formulation: Literal["eccentricity", "multiplier"] = "eccentricity",
) -> Scene:
    """The paper's crusher with clearance in its main bearing.

    **Arguments:**

    - `speed`: of the shaft, rad/s, constant.
    - `clearance`: radial, R_i - R_j, m, in (0, 0.13).
    - `start`: `"centred"`, e = e' = 0 (the paper's); `"contact"`, resting in the bore.
    - `slip`: the reading of the slip speed, of the centres or of the surfaces.
    - `friction`: coefficient c_f, or None for no friction.
    - `load`: 8.8 kN `"along_jaw"` (18), `"normal_to_jaw"`, only on the `"closing_stroke"`, or None.
    - `impact_velocity`: of the Lankarani-Nikravesh law, m/s, or `"tracked"` per impact.
    - `formulation`: `"eccentricity"` (two degrees of freedom) or `"multiplier"` (the paper's).

    Numbers may be traced. Raises ValueError for a number outside its limits or an unknown name.
    """
    require_x64()
    require_positive("speed", speed, "rad/s")
    require_clearance(clearance, BORE_RADIUS)
    require_choice("start", start, tuple(STARTS))
    require_choice("slip", slip, tuple(SLIPS))
    require_choice("formulation", formulation, tuple(FORMULATIONS))
    if friction is not None:
        require_within("friction", friction, 0, 10)
    if isinstance(impact_velocity, str):
        require_choice("impact_velocity", impact_velocity, ("tracked", "a speed in m/s"))
        velocity = TrackedImpactVelocity()
    else:
        require_positive("impact_velocity", impact_velocity, "m/s")
        velocity = ConstantImpactVelocity(impact_velocity)
    stiffness = cylinder_stiffness(BORE_RADIUS, clearance)
    normal = LankaraniNikravesh(stiffness, RESTITUTION, velocity)
    law = None if friction is None else AmbrosioFriction(SLIPS[slip](), friction)
    return Scene(
        pe250x400(),
        ConstantSpeed(speed),
        ClearanceJoint(BORE_RADIUS, clearance, normal, law),
        _load(load),
        FORMULATIONS[formulation](),
        STARTS[start](),
    )


def ideal_scene(speed: float | Scalar, *, load: LoadName = "along_jaw") -> Scene:
    """The paper's crusher without clearance: the floor that a clearance adds to.

    `speed` in rad/s, constant. Raises ValueError as `paper_scene` does.
    """
    require_x64()
    require_positive("speed", speed, "rad/s")
    return Scene(pe250x400(), ConstantSpeed(speed), None, _load(load), ClosedLinkage(), None)


def _load(name: LoadName) -> AbstractLoad | None:
    require_choice("load", name, (*LOADS, None))
    return None if name is None else LOADS[name](LOAD)
