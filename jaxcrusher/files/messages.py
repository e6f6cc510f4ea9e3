"""Messages of programs on standard error."""

import sys


def tell(line: str) -> None:
    """Print a line on standard error."""
    print(" ".join(line.split()), file=sys.stderr)
