"""Motions integrated in time: trajectories, statistics, sections, tangents."""
