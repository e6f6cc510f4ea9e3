"""Error against run time: this package's formulations and solvers beside other programs."""
