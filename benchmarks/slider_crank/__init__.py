"""A slider-crank with clearance: the joint of this package in another mechanism."""
