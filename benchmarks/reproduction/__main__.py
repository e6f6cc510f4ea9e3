"""`python -m benchmarks.reproduction`: the paper's figures and numbers."""

from benchmarks.start import start

if __name__ == "__main__":
    start("benchmarks.reproduction", "the figures and of claims.md")
