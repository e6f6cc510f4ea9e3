"""The cost of sweeps of many designs."""
