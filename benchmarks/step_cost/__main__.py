"""`python -m benchmarks.step_cost`: the cost of a step, beside other programs."""

from benchmarks.setting import set_up_on_one_core
from benchmarks.start import start

if __name__ == "__main__":
    start("benchmarks.step_cost", "step_cost.md and step_cost.csv", set_up_on_one_core)
