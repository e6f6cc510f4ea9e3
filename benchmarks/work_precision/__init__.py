"""Measure error against run time of this package and of other programs; ten minutes.

It writes work_precision.csv as it goes, then the page and its figures, and needs the extra `bench`.
"""
