
from optimize.objectives import Objective

VARIATION = Objective(
    "N",
    "RMS of the foundation force about its mean",
    ("foundation_rms", "foundation_mean"),
    lambda found, scene, chamber: (found.foundation_rms**2 - found.foundation_mean**2) ** 0.5,
)
