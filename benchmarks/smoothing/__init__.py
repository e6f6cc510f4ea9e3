"""Measure the error of each smoothing width against its run time; two minutes.

The reference is SciPy's DOP853 on the published laws without smoothing, stopped at every touch. The
motion is the first 20 ms of a centred start with surface slip: impacts and free flight.
"""
