"""`python -m benchmarks.slider_crank`: compare with EXUDYN and SciPy, and draw."""

import jax

from benchmarks.slider_crank.report import report
from jaxcrusher.batch.engines import use_all_cores

if __name__ == "__main__":
    use_all_cores()
    jax.config.update("jax_enable_x64", True)
    report()
