"""`python -m benchmarks.scaling`: cost by designs, turns, cores and differentiated parameters."""

from benchmarks.start import start

if __name__ == "__main__":
    start("benchmarks.scaling", "scaling.md, .csv and .png")
