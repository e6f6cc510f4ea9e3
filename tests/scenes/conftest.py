"""Scene files know the package's own numbers alone here."""

import pytest

from jaxcrusher.scenes.parameters import CHAMBER, NUMBERS, PARAMETERS, SITE


@pytest.fixture(autouse=True)
def own_numbers(monkeypatch):
    """A design search that was imported before has made more names known."""
    for name in set(NUMBERS) - {*PARAMETERS, *CHAMBER, *SITE}:
        monkeypatch.delitem(NUMBERS, name)
