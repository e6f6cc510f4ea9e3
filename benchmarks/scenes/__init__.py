"""What a scene leaves out and does not pay."""
