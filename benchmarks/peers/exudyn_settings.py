"""How EXUDYN integrates motions with contact: fixed steps of generalised-alpha."""

# EXUDYN's stubs take modules for types, and lack some settings.
# pyright: reportAttributeAccessIssue=false

import exudyn


def settings(end: float, step: float, every: float) -> exudyn.SimulationSettings:
    """To `end` in steps of `step`, sensors written every `every` (s).

    With its own choice of steps and iterations EXUDYN stops at the first impact.
    """
    chosen = exudyn.SimulationSettings()
    chosen.timeIntegration.numberOfSteps = round(end / step)
    chosen.timeIntegration.endTime = end
    chosen.timeIntegration.adaptiveStep = False
    chosen.timeIntegration.verboseMode = 0
    chosen.timeIntegration.discontinuous.useRecommendedStepSize = False
    chosen.timeIntegration.discontinuous.maxIterations = 8
    chosen.timeIntegration.discontinuous.ignoreMaxIterations = True
    chosen.timeIntegration.discontinuous.iterationTolerance = 1e3
    chosen.solution.file.write = False
    chosen.solution.sensors.writePeriod = every
    return chosen


def solve(system, chosen: exudyn.SimulationSettings) -> None:
    """Integrate `system`; RuntimeError if it stops early."""
    if not system.SolveDynamic(chosen):
        raise RuntimeError("EXUDYN stopped before the end")
