"""`python -m benchmarks.orbits`: a map of steady states, and a branch round its fold."""

from benchmarks.start import start

if __name__ == "__main__":
    start("benchmarks.orbits", "orbits.png")
