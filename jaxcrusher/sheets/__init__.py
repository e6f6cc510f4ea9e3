"""Numbers from motions and orbits: loads, bearings, wear, modes, severity, a rough feed."""
