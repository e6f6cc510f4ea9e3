"""The design search: driving speed and clearance that shake the foundation least."""
