"""What everything rests on: checks, plane vectors, smoothed corners, small linear systems."""
