"""Find the periodic motion that a machine settles on, and slopes along it."""
