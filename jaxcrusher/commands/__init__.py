"""The commands of `python -m jaxcrusher`, one module for each command."""
