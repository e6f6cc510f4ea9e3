"""The gain of programs by lanes."""
