"""The laws and methods that a description chooses by name, the paper's first."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from jaxcrusher.crusher.loads import (
    AlongJaw,
    ByAngle,
    ClosingStroke,
    CrushingBed,
    NormalToJaw,
    along_jaw,
    normal_to_jaw,
)
from jaxcrusher.joint.friction import AmbrosioFriction, CentreSlip, SurfaceSlip
from jaxcrusher.joint.normal import (
    ConstantImpactVelocity,
    Flores,
    Gonthier,
    HuGuo,
    HuntCrossley,
    LankaraniNikravesh,
    TrackedImpactVelocity,
    ZhiyingQishao,
)
from jaxcrusher.joint.rollers import RollerBearing
from jaxcrusher.mechanism.eccentricity import EccentricityFormulation
from jaxcrusher.mechanism.multiplier import MultiplierFormulation
from jaxcrusher.mechanism.starts import Centred, InContact

# Name of a choice -> name of a law -> its class, or the function that it stands for.
_LAWS: dict[str, dict[str, Any]] = {
    "start": {"centred": Centred, "contact": InContact},
    "slip": {"centre": CentreSlip, "surface": SurfaceSlip},
    "load_law": {
        "along_jaw": AlongJaw,
        "normal_to_jaw": NormalToJaw,
        "closing_stroke": ClosingStroke,
        "by_angle": ByAngle,
        "chamber": CrushingBed,
        "none": None,
    },
    "load_direction": {"normal_to_jaw": normal_to_jaw, "along_jaw": along_jaw},
    "contact_law": {
        "lankarani_nikravesh": LankaraniNikravesh,
        "hunt_crossley": HuntCrossley,
        "flores": Flores,
        "gonthier": Gonthier,
        "zhiying_qishao": ZhiyingQishao,
        "hu_guo": HuGuo,
        "rollers": RollerBearing,
    },
    "friction_law": {"ambrosio": AmbrosioFriction},
    "impact_law": {"constant": ConstantImpactVelocity, "tracked": TrackedImpactVelocity},
    "formulation": {"eccentricity": EccentricityFormulation, "multiplier": MultiplierFormulation},
}
LAWS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {name: MappingProxyType(laws) for name, laws in _LAWS.items()}
)
