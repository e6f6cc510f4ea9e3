"""The function that integrates in place of diffrax while a function is traced."""

import jax

# None, or a function of args, times, the state at the start, problem and method. JAX compares
# programs by it too, and forgets all of them when it is made: so before the first is traced.
integrator = jax.make_user_context(None)
