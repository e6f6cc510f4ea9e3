"""A differentiable simulator of a jaw crusher whose main bearing has clearance."""

from jaxcrusher.paper import ideal_scene as ideal_scene
from jaxcrusher.paper import paper_scene as paper_scene
from jaxcrusher.simulate import OUTPUTS as OUTPUTS
from jaxcrusher.simulate import Trajectory as Trajectory
from jaxcrusher.simulate import simulate as simulate
from jaxcrusher.statistics import STATISTICS as STATISTICS
from jaxcrusher.statistics import Statistics as Statistics
from jaxcrusher.statistics import statistics as statistics
