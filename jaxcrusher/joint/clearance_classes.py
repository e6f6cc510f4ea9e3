"""Classes of the radial internal clearance of bearings: ISO 5753, by the bore."""

import numpy as np

from jaxcrusher.basics.checks import require

SOURCE = "ISO 5753-1, spherical roller bearings with a cylindrical bore, from memory"
# Bore over and up to, mm -> bounds between C2, normal, C3, C4 and C5, um, of the diametral play.
_OVER = (24, 30, 40, 50, 65, 80, 100, 120, 140, 160, 180, 200, 225, 250, 280, 315, 355, 400, 450)
_UP_TO = (*_OVER[1:], 500)
_BOUNDS = (
    (15, 25, 40, 55, 75, 95),
    (15, 30, 45, 60, 80, 100),
    (20, 35, 55, 75, 100, 125),
    (20, 40, 65, 90, 120, 150),
    (30, 50, 80, 110, 145, 180),
    (35, 60, 100, 135, 180, 225),
    (40, 75, 120, 160, 210, 260),
    (50, 95, 145, 190, 240, 300),
    (60, 110, 170, 220, 280, 350),
    (65, 120, 180, 240, 310, 390),
    (70, 130, 200, 260, 340, 430),
    (80, 140, 220, 290, 380, 470),
    (90, 150, 240, 320, 420, 520),
    (100, 170, 260, 350, 460, 570),
    (110, 190, 280, 370, 500, 630),
    (120, 200, 310, 410, 550, 690),
    (130, 220, 340, 450, 600, 750),
    (140, 240, 370, 500, 660, 820),
    (140, 260, 410, 550, 720, 900),
)
CLASSES = ("less than C2", "C2", "normal", "C3", "C4", "C5", "more than C5")


def clearance_class(bore: float, clearance: float) -> tuple[str, str]:
    """Return the class of a radial clearance (m) for a bore (m), and the classes' diametral bounds.

    Raises ValueError for a bore that is not over 24 and up to 500 mm.
    """
    wide, play = 1e3 * bore, 2e6 * clearance
    inside = [i for i, end in enumerate(_UP_TO) if _OVER[i] < wide <= end]
    require(len(inside) == 1, "bore", "be over 24 and up to 500 mm", f"{wide:g} mm")
    bounds = _BOUNDS[inside[0]]
    _, low, high, loose, looser, _ = bounds
    told = f"normal {low} to {high}, C3 to {loose}, C4 to {looser} um"
    return CLASSES[int(np.searchsorted(bounds, play))], told
