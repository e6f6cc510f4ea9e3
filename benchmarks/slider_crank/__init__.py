"""Print a slider-crank with clearance beside EXUDYN and SciPy, and draw it; some minutes.

It shows the joint of this package in another mechanism, and needs EXUDYN (extra `bench`).
"""
