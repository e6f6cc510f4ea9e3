"""The decay of swings that are known by hand."""

import numpy as np
import pytest

from optimize.decay import TURNS, measured

ANGLE = 1.04  # of the crusher's swing in a turn


def swinging(rate: float, angle: float = ANGLE) -> np.ndarray:
    """Points of an ellipse, 0.05 clearances long, whose size falls by `rate` a turn."""
    turn = np.arange(TURNS)
    size = 0.05 * (1 - rate) ** turn
    return size[:, None] * np.stack([np.cos(angle * turn), 0.3 * np.sin(angle * turn)], axis=1)


@pytest.mark.parametrize("rate", [2e-4, 4e-3])
def test_decay_of_a_swing(rate):
    """The phase leaves a part's average 1 / (60 turns x 2 sin(angle)) = 1 % off at most."""
    found = measured(swinging(rate))
    assert abs(found.rate - rate) < 3 * found.error + rate**2
    assert found.error < 0.01 / TURNS * 3
    assert found.first == pytest.approx(0.05 * np.sqrt(1.09 / 2 / 2) * np.exp(-30 * rate), rel=0.02)
    assert found.last < found.first


def test_a_swing_that_does_not_die_is_told():
    found = measured(swinging(0.0))
    assert abs(found.rate) < 3 * found.error < 1e-4
