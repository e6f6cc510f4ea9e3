"""A scene: who takes part. What it leaves out is None, and is never traced."""

from jaxcrusher.basics.checks import concrete, require, require_positive, require_x64
from jaxcrusher.crusher.drives import AbstractDrive
from jaxcrusher.crusher.formulations import ClosedLinkage
from jaxcrusher.crusher.interfaces import AbstractFormulation, AbstractScene, AbstractStart
from jaxcrusher.crusher.loads import AbstractLoad
from jaxcrusher.crusher.machine import Machine
from jaxcrusher.joint.clearance import ClearanceJoint


class Scene(AbstractScene):
    """A machine, what drives and loads it, its main joint (None: ideal) and how to solve it.

    Raises ValueError (concrete values only) if 64-bit floats are off, if the clearance is
    not inside (0, R_i), or if it lets the linkage reach a dead point.
    """

    machine: Machine
    drive: AbstractDrive
    joint: ClearanceJoint | None
    load: AbstractLoad | None
    formulation: AbstractFormulation
    start: AbstractStart | None

    def __check_init__(self):
        require_x64()
        if self.joint is not None:
            require_clearance(self.joint.clearance, self.joint.bore_radius)
            self.machine.require_assembly(self.joint.clearance)

    def ideal(self) -> "Scene":
        """The same machine, drive and load with an ideal joint: what a clearance adds to."""
        return Scene(self.machine, self.drive, None, self.load, ClosedLinkage(), None)


def require_clearance(clearance, bore_radius) -> None:
    """Check 0 < clearance < bore radius (m)."""
    require_positive("clearance", clearance, "m")
    known, bore = concrete(clearance), concrete(bore_radius)
    if known is not None and bore is not None:
        limit = f"be smaller than the bore radius {bore.min():g} m"
        require(bool((known < bore).all()), "clearance", limit, clearance)
