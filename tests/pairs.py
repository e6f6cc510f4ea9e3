"""Cases of a parametrised test, of which some wait for `pytest --all`."""

import itertools

import pytest


def slow(*cases):
    """Mark cases as slow, of which a tuple is one of several arguments."""
    every = (case if isinstance(case, tuple) else (case,) for case in cases)
    return [pytest.param(*case, marks=pytest.mark.slow) for case in every]


def crossed(*choices, later=()):
    """Return all combinations of choices; those that differ from the first in two are slow.

    A fault of one choice is seen beside the first of the others. With a choice of `later`, whose
    parts others have too, all are slow.
    """
    first, *others = itertools.product(*choices)
    found = [first]
    for case in others:
        far = sum(one != standard for one, standard in zip(case, first, strict=True)) > 1
        found += slow(case) if far or any(one in later for one in case) else [case]
    return found
