"""Scene files know the package's own numbers alone here."""

import pytest

from jaxcrusher.scenes.parameters import CHAMBER, NUMBERS, PARAMETERS


@pytest.fixture(autouse=True)
def own_numbers(monkeypatch):
    """A design search that was imported before has made more names known."""
    for name in set(NUMBERS) - {*PARAMETERS, *CHAMBER}:
        monkeypatch.delitem(NUMBERS, name)
