"""The kind of a motion, and the worth of a slope."""
