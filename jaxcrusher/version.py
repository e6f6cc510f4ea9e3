"""The version of the package, also of a checkout that is not installed."""

__version__ = "0.2.0"
