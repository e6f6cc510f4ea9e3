"""`python -m benchmarks.optimisers`: searches with gradients and without, at equal work."""

from benchmarks.start import start

if __name__ == "__main__":
    start("benchmarks.optimisers", "balance.md and .png")
