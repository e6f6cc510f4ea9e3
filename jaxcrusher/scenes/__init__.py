"""Crushers by named numbers and choices: the paper's, one's own, from a file."""
