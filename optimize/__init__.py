"""The design search: parameters of a machine that shake its foundation least."""
