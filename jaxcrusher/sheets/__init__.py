"""Sheets of numbers from motions and orbits: loads, bearings, modes, severity, a rough feed."""
