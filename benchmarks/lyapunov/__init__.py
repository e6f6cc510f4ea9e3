"""Measure largest Lyapunov exponents from tangents, beside published ones and nolds' estimators.

There are four systems of the field and a chaotic crusher; it takes some minutes. It needs nolds
(extra `bench`): 0.6.3 cannot be imported under Python 3.11, 0.6.2 can.
"""
