"""The jobs of `python -m jaxcrusher`, one module a command."""
