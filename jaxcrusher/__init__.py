"""A differentiable simulator of a jaw crusher whose main bearing has clearance."""

from jaxcrusher.batch import map_chunks as map_chunks
from jaxcrusher.batch import use_all_cores as use_all_cores
from jaxcrusher.bifurcation import bifurcation as bifurcation
from jaxcrusher.capacity import CrushingChamber as CrushingChamber
from jaxcrusher.capacity import chamber_from_stroke as chamber_from_stroke
from jaxcrusher.description import PARAMETERS as PARAMETERS
from jaxcrusher.description import PE250X400 as PE250X400
from jaxcrusher.description import build_scene as build_scene
from jaxcrusher.gradient import GradientReport as GradientReport
from jaxcrusher.gradient import gradient_report as gradient_report
from jaxcrusher.large_sweep import sweep_to_store as sweep_to_store
from jaxcrusher.paper import ideal_scene as ideal_scene
from jaxcrusher.paper import paper_scene as paper_scene
from jaxcrusher.regime import Regime as Regime
from jaxcrusher.regime import regime as regime
from jaxcrusher.scene import Scene as Scene
from jaxcrusher.section import Section as Section
from jaxcrusher.section import poincare_section as poincare_section
from jaxcrusher.simulate import OUTPUTS as OUTPUTS
from jaxcrusher.simulate import Trajectory as Trajectory
from jaxcrusher.simulate import simulate as simulate
from jaxcrusher.statistics import STATISTICS as STATISTICS
from jaxcrusher.statistics import Statistics as Statistics
from jaxcrusher.statistics import statistics as statistics
from jaxcrusher.sweep import sweep as sweep
from jaxcrusher.validity import Validity as Validity
