"""The version of the package, also of a checkout that is not installed, and those of others."""

from importlib import import_module, metadata

__version__ = "0.2.0"


def version_of(package: str) -> str:
    """Return the version of a package, also of a copy without metadata, as bundlers make them."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return import_module(package).__version__
