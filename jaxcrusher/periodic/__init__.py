"""Periodic orbits of forced systems x'' = f(t, x, x', args), their multipliers and branches."""
