"""Measure the cost of a step on one core beside other programs; two minutes."""
