"""The design study: counterweight and links that shake the foundation least."""
