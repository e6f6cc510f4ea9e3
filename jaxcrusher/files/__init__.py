"""What programs write: files that survive, results with their provenance."""
