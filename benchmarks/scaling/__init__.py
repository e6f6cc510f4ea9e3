"""Cost over designs, turns and parameters."""
