"""`python -m benchmarks.smoothing`: the error of each smoothing width, against its run time."""

from benchmarks.start import start

if __name__ == "__main__":
    start("benchmarks.smoothing", "smoothing.md, .csv and .png")
