"""Cross-checks against other programs, and measurements of error and run time."""
