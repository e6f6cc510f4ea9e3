"""Scene files know the package's own numbers and choices alone here."""

import pytest

from jaxcrusher.scenes.parameters import CHAMBER, CHOICES, NUMBERS, OF_LINKAGES, PARAMETERS, SITE


@pytest.fixture(autouse=True)
def own_numbers(monkeypatch):
    """A design search that was imported before has made more names known."""
    for name in set(NUMBERS) - {*PARAMETERS, *CHAMBER, *SITE}:
        monkeypatch.delitem(NUMBERS, name)
    for name in [name for name in CHOICES if name.startswith(OF_LINKAGES)]:
        monkeypatch.delitem(CHOICES, name)
