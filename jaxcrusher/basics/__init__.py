"""The ground floor: checks, plane vectors, smoothed corners, small linear systems."""
