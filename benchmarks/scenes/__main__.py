"""`python -m benchmarks.scenes`: the savings of each thing left out of a scene."""

from benchmarks.setting import set_up_to_time
from benchmarks.start import start

if __name__ == "__main__":
    start("benchmarks.scenes", "scenes.md and scenes.csv", set_up_to_time)
