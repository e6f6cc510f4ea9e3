"""Rooms that the package itself calls most get and return what their signatures say."""

import os
import pathlib

import pytest

from tests.processes import ended

ROOT = pathlib.Path(__file__).parents[2]


@pytest.mark.slow
def test_quick_tests_of_these_rooms_pass_with_their_signatures_checked(called_most):
    words = "-m pytest -o addopts= -q --tb=short".split()
    rooms = [f"tests/{room}" for room in called_most]
    run = ended(*words, *rooms, cwd=ROOT, env=os.environ | {"JAXCRUSHER_CHECKED": "all"})
    assert run.returncode == 0, run.stdout[-3000:]
