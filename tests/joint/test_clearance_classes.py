"""Classes of clearance, from the table that makers print."""

import pytest

from jaxcrusher.joint.rollers import clearance_class


@pytest.mark.parametrize(
    ("bore", "play", "named"),
    [
        # 22324, copied a second time: normal 75 to 120, C3 to 160, C4 to 210, C5 to 260 um.
        (120, 30, "less than C2"),
        (120, 60, "C2"),
        (120, 100, "normal"),
        (120, 140, "C3"),
        (120, 200, "C4"),
        (120, 250, "C5"),
        (120, 270, "more than C5"),
        # A bound belongs to the tighter of two classes, and the least one to C2.
        (30, 14.999, "less than C2"),
        (30, 15, "C2"),
        (30, 25, "C2"),
        # A bore belongs to the row that it ends.
        (121, 140, "normal"),
        (320, 400, "C3"),
        (25, 50, "C3"),
    ],
)
def test_class_of_a_play(bore, play, named):
    assert clearance_class(1e-3 * bore, 0.5e-6 * play)[0] == named


def test_bounds_are_told_and_grow_with_the_bore():
    assert clearance_class(0.12, 1e-4)[1] == "normal 75 to 120, C3 to 160, C4 to 210 um"
    with pytest.raises(ValueError, match="`bore` must be over 24 and up to 500 mm, but is 20 mm"):
        clearance_class(0.02, 1e-5)
