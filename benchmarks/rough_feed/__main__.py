"""`python -m benchmarks.rough_feed`: at which scatter and bandwidth the quiet motion is lost."""

from benchmarks.start import start

if __name__ == "__main__":
    start("benchmarks.rough_feed", "rough_feed.png")
