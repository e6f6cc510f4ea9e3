"""Redraw every figure of the paper's results and check its numbers; about five minutes.

It needs EXUDYN (extra `bench`).
"""
