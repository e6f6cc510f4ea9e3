"""Wear in A, B and C: its effect on the foundation and the joints, and its signs."""
