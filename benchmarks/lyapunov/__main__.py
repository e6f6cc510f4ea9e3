"""`python -m benchmarks.lyapunov`: exponents from tangents against those from a series alone."""

from benchmarks.start import start

if __name__ == "__main__":
    start("benchmarks.lyapunov", "lyapunov.md")
