"""`python -m benchmarks.step_cost`: the cost of a step, beside other programs."""

from benchmarks.start import start

if __name__ == "__main__":
    start("benchmarks.step_cost", "step_cost.md and its data")
