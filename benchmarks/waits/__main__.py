"""`python -m benchmarks.waits`: first orbits, slopes of runs, and how times grow."""

from benchmarks.setting import set_up_to_time
from benchmarks.start import start

if __name__ == "__main__":
    start("benchmarks.waits", "waits.md", set_up_to_time)
