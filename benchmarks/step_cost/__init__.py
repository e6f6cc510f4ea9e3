"""Measure the cost of a step beside other programs, and how many steps it takes; four minutes.

Every measurement runs in a process of its own, on one core.
"""
