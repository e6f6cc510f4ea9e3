"""Measure what a user waits for: first orbits of a process, slopes of runs, and growth; 10 min.

It fills the tables of docs/waits.md.
"""
