"""`python -m benchmarks.work_precision`: error against run time, every program and scene."""

from benchmarks.setting import set_up_to_time
from benchmarks.start import start

if __name__ == "__main__":
    start("benchmarks.work_precision", "work_precision.md, .csv and its figures", set_up_to_time)
