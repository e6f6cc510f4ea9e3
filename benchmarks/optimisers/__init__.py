"""Compare two gradient searches with two that have no gradients, at equal work; ten minutes.

The problems are those of `python -m optimize.run --design balance` and `--design machine`. L-BFGS-B
is SciPy's, Adam that of optax, CMA-ES that of cma (Hansen), the model-based search that of
Py-BOBYQA (Cartis, Fiala, Marteau, Roberts 2019).
"""
