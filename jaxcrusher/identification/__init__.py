"""Numbers of a machine from measured vibration, and vibration from tolerances of numbers."""
