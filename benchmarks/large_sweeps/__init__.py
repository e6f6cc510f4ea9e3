"""Sweeps of many designs."""
