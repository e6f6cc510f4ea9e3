"""A differentiable simulator of a jaw crusher whose main bearing has clearance."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jaxcrusher.batch.engines import map_chunks as map_chunks
    from jaxcrusher.batch.engines import use_all_cores as use_all_cores
    from jaxcrusher.batch.large_sweep import sweep_to_store as sweep_to_store
    from jaxcrusher.batch.sweep import sweep as sweep
    from jaxcrusher.crusher.capacity import CrushingChamber as CrushingChamber
    from jaxcrusher.crusher.capacity import chamber_from_stroke as chamber_from_stroke
    from jaxcrusher.crusher.scene import Scene as Scene
    from jaxcrusher.dynamics.bifurcation import bifurcation as bifurcation
    from jaxcrusher.dynamics.regime import Regime as Regime
    from jaxcrusher.dynamics.regime import regime as regime
    from jaxcrusher.dynamics.slopes import GradientReport as GradientReport
    from jaxcrusher.dynamics.slopes import gradient_report as gradient_report
    from jaxcrusher.joint.validity import Validity as Validity
    from jaxcrusher.motion.method import Method as Method
    from jaxcrusher.motion.section import Section as Section
    from jaxcrusher.motion.section import poincare_section as poincare_section
    from jaxcrusher.motion.simulation import OUTPUTS as OUTPUTS
    from jaxcrusher.motion.simulation import Trajectory as Trajectory
    from jaxcrusher.motion.simulation import simulate as simulate
    from jaxcrusher.motion.statistics import STATISTICS as STATISTICS
    from jaxcrusher.motion.statistics import Statistics as Statistics
    from jaxcrusher.motion.statistics import statistics as statistics
    from jaxcrusher.scenes.paper import ideal_scene as ideal_scene
    from jaxcrusher.scenes.paper import paper_scene as paper_scene
    from jaxcrusher.scenes.parameters import PARAMETERS as PARAMETERS
    from jaxcrusher.scenes.parameters import PE250X400 as PE250X400
    from jaxcrusher.scenes.parameters import build_scene as build_scene
else:
    import ast
    import importlib

    # The lines above are read here, not run: a name is imported when it is first asked for. JAX
    # takes a second, and `--help`, or one part of the package, need not wait for all of it.
    _HOME = {
        line.names[0].name: line.module
        for line in ast.walk(ast.parse(__loader__.get_source(__name__)))
        if isinstance(line, ast.ImportFrom) and line.module.startswith("jaxcrusher.")
    }

    def __getattr__(name):
        if name not in _HOME:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        found = globals()[name] = getattr(importlib.import_module(_HOME[name]), name)
        return found

    def __dir__():
        return sorted(_HOME)
