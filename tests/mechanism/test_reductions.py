"""What is followed from step to step, against closed forms."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.basics.following import Following, Instant
from jaxcrusher.basics.integrate import (
    Carried,
    InitialValueProblem,
    Integration,
    integrate,
    pi_controller,
)
from jaxcrusher.mechanism.reductions import (
    LARGEST,
    LEAST,
    RisesAboveZero,
    ShareAboveZero,
    of_slices,
)

FOLLOWED = {
    "most": LARGEST,
    "least": LEAST,
    "share": ShareAboveZero(),
    "rises": RisesAboveZero(),
}


def followed(how, times, values):
    """The number of values at the ends of steps."""
    instants = [Instant(*map(jnp.asarray, pair)) for pair in zip(times, values, strict=True)]
    kept = tuple(map(jnp.asarray, how.begin()))
    befores = [instants[0], *instants]
    for before, start, end in zip(befores, instants, instants[1:], strict=False):
        kept = how.follow(kept, before, start, end)
    return float(how.of_kept(kept, times[-1] - times[0]))


def test_the_top_of_a_parabola_is_found_between_uneven_steps():
    times = np.array([0.0, 0.1, 0.7, 0.75, 1.5])
    for middle in (0.4, 0.72, 1.0):
        values = 3 - 2 * (times - middle) ** 2
        assert followed(LARGEST, times, values) == pytest.approx(3, rel=1e-12)
        assert followed(LEAST, times, -values) == pytest.approx(-3, rel=1e-12)


@pytest.mark.parametrize("sign", [1, -1])
def test_no_top_rises_above_a_corner(sign):
    """A load that ends at once, or begins so: a parabola through long and short steps rises 0.2."""
    times = np.array([0.0, 1, 2, 2.02, 2.04, 2.06, 3])
    load = 1 + 0.1 * times - 50 * np.maximum(times - 2, 0)
    times, load = (times, load) if sign > 0 else (-times[::-1], load[::-1])
    assert followed(LARGEST, times, load) == pytest.approx(1.2, rel=1e-12)
    assert followed(LEAST, times, -load) == pytest.approx(-1.2, rel=1e-12)


@pytest.mark.parametrize("values", [[5.0, 2, 1], [1.0, 2, 5], [2.0, 2, 2], [-3.0, -2, -1]])
def test_an_end_may_be_the_largest(values):
    """Where no step comes before or after there is no parabola, nor on level ground."""
    assert followed(LARGEST, [0.0, 1.0, 3.0], values) == max(values)
    assert followed(LEAST, [0.0, 1.0, 3.0], values) == min(values)


def test_shares_and_rises_of_straight_lines_are_exact():
    times, values = [0.0, 1, 2, 4, 5, 6], [-1.0, 3, 1, -1, 0, 2]
    # 3/4 of the first second, the next, half of two seconds, none, and all of the last.
    share = ShareAboveZero()
    assert followed(share, times, values) == pytest.approx((0.75 + 1 + 1 + 0 + 1) / 6, rel=1e-15)
    for seed in range(20):  # a whole is 1 exactly, whatever the sum of all steps is rounded to
        steps = np.random.default_rng(seed).uniform(1e-4, 0.1, 100)
        assert followed(share, np.cumsum(steps), np.ones(100)) == 1
    assert followed(share, times[:3], np.zeros(3)) == 0
    # A turn is 2 pi long.
    assert followed(RisesAboveZero(), times, values) == pytest.approx(2 * 2 * np.pi / 6)


def test_what_is_no_number_is_seen():
    for name in ("most", "least", "share"):
        found = followed(FOLLOWED[name], [0.0, 1, 2, 3], [1.0, np.nan, 2, 3])
        assert np.isnan(found), name


def test_slices_make_a_turn():
    values = jnp.array([3.0, 1.0, 4.0, 2.0])
    expected = {"most": 4.0, "least": 1.0, "share": 2.5, "rises": 2.5}
    for name, number in expected.items():
        assert float(of_slices(FOLLOWED[name], values, 2)) == number, name


# A mass of 1 kg on Hertz's spring: F = K d^1.5.
STIFFNESS, GAP = 1.4e8, 1e-4


def _force(y):
    depth = jnp.maximum(y.motion[0], 0.0)
    return STIFFNESS * depth * jnp.sqrt(depth + 1e-300)


def impact(speed, **how):
    """The numbers of an impact that begins after a flight through the gap, over 5 ms."""

    def summarise(seen, end, kept):
        return {name: one.of_kept(kept[name], 5e-3) for name, one in FOLLOWED.items()}

    def follow(kept, *instants):
        def of(name, seen):
            places = (Instant(at.time, at.seen[seen]) for at in instants)
            return FOLLOWED[name].follow(kept[name], *places)

        return {name: of(name, "force" if name == "most" else "place") for name in FOLLOWED}

    problem = InitialValueProblem(
        lambda speed: Carried((jnp.asarray(-GAP), speed), None),
        lambda time, y, speed: Carried((y.motion[1], -_force(y)), None),
        lambda time, y, speed: None,
        summarise,
        Following(
            lambda speed: {name: one.begin() for name, one in FOLLOWED.items()},
            lambda time, y, speed: {"force": _force(y), "place": y.motion[0]},
            follow,
        ),
    )
    method = Integration(diffrax.Tsit5(), pi_controller(1e-9), 10_000, 1e-6, **how)
    found, _ = integrate(speed, jnp.array([[5e-3]]), problem=problem, method=method)
    return {name: value[0] for name, value in found.items()}


@pytest.mark.parametrize("adjoint", [None, diffrax.RecursiveCheckpointAdjoint()])
def test_a_hertzian_impact_is_that_of_the_closed_form(adjoint):
    """d_max = (5 m v^2 / (4 K))^(2/5), and 2.9432 d_max / v in contact (Goldsmith, Impact, 1960).

    The force rises as the speed to 6/5. The one instant that is saved is long after the impact.
    """
    values, slopes = jax.value_and_grad(lambda v: impact(v, adjoint=adjoint)["most"])(1.0)
    found = impact(1.0, adjoint=adjoint)
    depth = (5 / (4 * STIFFNESS)) ** 0.4
    # Parabolas through steps that resolve the impact to 1e-9; the factor has five digits.
    assert float(values) == pytest.approx(STIFFNESS * depth**1.5, rel=1e-4)
    assert float(slopes) == pytest.approx(1.2 * STIFFNESS * depth**1.5, rel=2e-3)
    assert float(found["share"]) == pytest.approx(2.9432 * depth / 5e-3, rel=1e-4)
    assert float(found["rises"]) == pytest.approx(2 * np.pi / 5e-3)  # one in this time
    # Back at the speed that it came with, after the flight and the contact.
    left = 5e-3 - GAP - 2.9432 * depth
    assert float(found["least"]) == pytest.approx(-left, rel=1e-4)
