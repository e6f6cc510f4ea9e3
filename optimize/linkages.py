"""The search over a linkage that is no crusher: a file of `kind = "linkage"`, and its numbers."""

from jaxcrusher.basics.checks import require
from jaxcrusher.mechanism.scene import require_clearance
from jaxcrusher.scenes.reader import read_machine
from optimize.design import Design
from optimize.options import Options
from optimize.searched import Searched, sets, startless, written_bounds
from optimize.sets import set_bounds

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
    found = startless(read_machine(options.scene, options.overrides))
    values, scene, free = found.values, found.scene(), {}
    for word in sets(options):
        free |= set_bounds(word, found)
    free |= written_bounds(options, found)
    for name, (_, high) in free.items():
        require(name in found.numbers, "design", "name numbers that the scene file gives", name)
        found.replace(**{name: high})  # which refuses a number without what it comes with
        joint, _, key = name.rpartition(".")
        if key == "clearance":
            require_clearance(high, values[f"{joint}.bore_radius"], f"{joint}.")
    require(not scene.is_ideal, "scene", "have a joint with clearance", "ideal joints")
    design = Design(free, found)
    reference = {name: float(values.get(name, 0.0)) for name in free}
    return Searched(found, design, scene, None, 0.0, reference, "scene file's choice")
