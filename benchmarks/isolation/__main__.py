"""`python -m benchmarks.isolation`: springs and counterweight of a block, against its amplitude."""

from benchmarks.start import start

if __name__ == "__main__":
    start("benchmarks.isolation", "isolation.md and .png")
