"""The machines compared: the PE250x400 at 30 rad/s, new but for the joints that are worn."""

from dataclasses import dataclass

from benchmarks.peers.free_bodies import PREFIXES
from jaxcrusher.scenes.parameters import Value

SPEED = 30.0
# Radial clearances (m) of each joint when new, and as it wears.
NEW = 0.03e-3
WORN = {"A": (0.06e-3, 0.12e-3), "B": (0.1e-3, 0.2e-3, 0.5e-3), "C": (0.1e-3, 0.2e-3, 0.5e-3)}
# The crushing force of 8.8 kN along the jaw, as in the paper, or across it, against the toggle.
ALONG, ACROSS = "along_jaw", "normal_to_jaw"


@dataclass(frozen=True)
class Case:
    """Which joints are worn, and the clearance (m) of each that is loose, by letter."""

    worn: str  # "none", "A", "B", "C" or "all"
    clearances: dict[str, float]

    def description(self, load: str, slip: str = "centre") -> dict[str, Value]:
        """Return the description for `jaxcrusher.build_scene`; friction is the paper's 0.1."""
        found: dict[str, Value] = {"speed": SPEED, "load_law": load, "start": "contact"}
        if "A" not in self.clearances:
            found["joint"] = "ideal"
        for letter, clearance in self.clearances.items():
            prefix = PREFIXES[letter]
            found |= {f"{prefix}clearance": clearance, f"{prefix}slip": slip}
        return found


def together() -> list[Case]:
    """Return machines with all three joints loose: new, one of them worn, and all worn."""
    new = dict.fromkeys("ABC", NEW)
    worn = [Case(joint, new | {joint: c}) for joint, wear in WORN.items() for c in wear]
    return [Case("none", new), *worn, Case("all", {j: wear[-1] for j, wear in WORN.items()})]


def alone(joint: str) -> list[Case]:
    """Return machines with one joint loose, new and worn out, and the others ideal."""
    return [Case(joint, {joint: clearance}) for clearance in (NEW, WORN[joint][-1])]
