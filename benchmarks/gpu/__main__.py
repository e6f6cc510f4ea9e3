"""`python -m benchmarks.gpu`: sweeps on a GPU, beside the cores."""

from benchmarks.start import start

if __name__ == "__main__":
    start("benchmarks.gpu", "gpu.md")
