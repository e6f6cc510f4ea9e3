"""The lowest layer: checks, plane vectors, smoothed corners, small linear systems."""
