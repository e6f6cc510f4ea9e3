"""64-bit floats and all cores, before the first JAX computation."""

import jax

import jaxcrusher as jc

jc.use_all_cores()
jax.config.update("jax_enable_x64", True)
