"""`python -m benchmarks.slider_crank`: a slider-crank with clearance against EXUDYN and SciPy."""

from benchmarks.start import start

if __name__ == "__main__":
    start("benchmarks.slider_crank", "slider_crank.png")
