"""Ways to write the equations of motion; all give the same outputs."""

from jaxcrusher.crusher.formulations.closed_linkage import ClosedLinkage as ClosedLinkage
from jaxcrusher.crusher.formulations.eccentricity import (
    EccentricityFormulation as EccentricityFormulation,
)
from jaxcrusher.crusher.formulations.multiplier import (
    MultiplierFormulation as MultiplierFormulation,
)
