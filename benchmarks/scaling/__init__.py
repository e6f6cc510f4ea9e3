"""Measure how the cost grows with designs, turns, cores and differentiated parameters.

Measurements run in processes of their own, pinned to one core or to two; they take twelve minutes.
Each is written to scaling.csv as it comes, at the end scaling.md and scaling.png.
"""
