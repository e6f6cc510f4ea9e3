"""Ways to write the equations of motion; all give the same outputs."""

from jaxcrusher.formulations.closed_linkage import ClosedLinkage as ClosedLinkage
from jaxcrusher.formulations.eccentricity import EccentricityFormulation as EccentricityFormulation
from jaxcrusher.formulations.multiplier import MultiplierFormulation as MultiplierFormulation
