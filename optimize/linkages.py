"""The search over a linkage that is no crusher: a file of `kind = "linkage"`, and its numbers."""

from jaxcrusher.basics.checks import require
from jaxcrusher.mechanism.scene import require_clearance
from jaxcrusher.scenes.described import described
from optimize.design import Design
from optimize.options import Options
from optimize.searched import Searched, sets, written_bounds

# Options of a crusher: a linkage has its numbers and laws by --set and --design alone.
_OF_A_CRUSHER = (
    "speed",
    "clearance",
    "capacity_floor",
    "bulk_density",
    "slip",
    "friction",
    "load_law",
    "impact_velocity",
)


def linkage(options: Options) -> Searched:
    """Return the linkage of a scene file, with the numbers that lines `--design` free.

    It is compared with the file's own numbers. Raises ValueError of one line for options of a
    crusher, no line `--design`, a number that the file does not have, and ideal joints.
    """
    for name in _OF_A_CRUSHER:
        value = getattr(options, name)
        must = "not be given with a linkage, whose numbers --set and --design name"
        require(value == getattr(Options, name), name, must, value)
    must = "free a number of a linkage, as in --design joints.B.clearance 0.05mm 0.5mm"
    require(len(options.design) > 0, "design", must, "missing")
    require(not sets(options), "design", "be NAME LOW HIGH: sets are a crusher's", sets(options))
    found = described(options.scene, options.overrides)
    # The search tries both starts itself.
    values = {name: value for name, value in found.values.items() if name != "start"}
    free = written_bounds(options)
    for name, (_, high) in free.items():
        require(name in values, "design", "name numbers that the scene file gives", name)
        joint, _, key = name.rpartition(".")
        if key == "clearance":
            require_clearance(high, values[f"{joint}.bore_radius"], f"{joint}.")
    require(not found.scene.is_ideal, "scene", "have a joint with clearance", "ideal joints")
    fixed = {name: value for name, value in values.items() if name not in free}
    design = Design(free, fixed, make=found.make)
    reference = {name: float(values[name]) for name in free}
    title = "scene file's choice"
    return Searched(values, design, found.scene, None, 0.0, reference, title, found.defaults)
