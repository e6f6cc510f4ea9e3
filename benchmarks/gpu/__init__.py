"""Measure sweeps on a GPU of NVIDIA's, beside the cores.

It needs CuPy and a card, and takes some minutes. At the end it writes gpu.md.
"""
