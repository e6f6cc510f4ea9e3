"""Runs that are killed at random moments and go on: whether they end with the same bits."""
