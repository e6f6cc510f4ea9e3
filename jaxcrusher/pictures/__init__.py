"""Figures, the mechanism, and its film."""
