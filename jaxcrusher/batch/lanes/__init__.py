"""Batches on a CPU: the equations of the package compiled to loops over lanes of designs."""
