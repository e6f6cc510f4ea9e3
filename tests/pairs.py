"""Cases of a parametrised test, of which some wait for `pytest --all`."""

import itertools

import pytest


def slow(*cases):
    """Mark cases of one argument as slow."""
    return [pytest.param(case, marks=pytest.mark.slow) for case in cases]


def crossed(*choices):
    """Return all combinations of choices; those that differ from the first in two are slow.

    A fault of one choice is seen beside the first of the others.
    """
    first, *others = itertools.product(*map(tuple, choices))
    found = [pytest.param(*first)]
    for case in others:
        far = sum(one != standard for one, standard in zip(case, first, strict=True)) > 1
        found.append(pytest.param(*case, marks=[pytest.mark.slow] if far else []))
    return found
