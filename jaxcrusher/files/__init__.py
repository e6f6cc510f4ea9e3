"""Files that programs write: they survive a kill and say where they come from."""
