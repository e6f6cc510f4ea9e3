"""`python -m benchmarks.slider_crank`: compare with EXUDYN and SciPy, and draw."""

from benchmarks.slider_crank.report import report
from jaxcrusher.basics.setup import set_up

if __name__ == "__main__":
    set_up()
    report()
