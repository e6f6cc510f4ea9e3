"""Indicators of chaos against published values."""
