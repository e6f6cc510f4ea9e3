"""Checks of arguments: what passes, what is refused, and in which words."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcrusher.basics.checks import (
    nan_unless,
    require_choice,
    require_known,
    require_names,
    require_positive,
    require_whole,
    require_within,
)

NAMES = ("one", "two")
FINE = [
    (require_choice, "two", NAMES),
    (require_choice, "".join("one"), NAMES),  # equal, and another object
    (require_names, ("two", "one"), NAMES),
    (require_names, [], NAMES),
    (require_positive, 1e-300, "m"),
    (require_positive, np.array([1.0, 2.0]), "m"),
    (require_positive, jnp.array(3), "m"),
    (require_within, 0.0, 0.0, 1.0),
    (require_within, 1.0, 0.0, 1.0),
    (require_whole, 2, 2),
]
REFUSED = [
    (require_choice, ("three", NAMES), "must be one of 'one', 'two', but is 'three'."),
    (require_choice, ("ones", NAMES), r"but is 'ones' \(is 'one' meant\?\)"),
    # An array is none of them, whatever it equals entry by entry.
    (require_choice, (np.array(["one"]), NAMES), "must be one of"),
    (require_choice, ("x1", tuple(f"x{i}" for i in range(2, 12))), "must be a known name"),
    (require_names, ("one", NAMES), r"such as \('one',\), but is the string 'one'"),
    (require_names, (3, NAMES), "must be names in a tuple, but is a int"),
    (require_names, (("one", "three"), NAMES), "must be one of"),
    (require_positive, (0.0, "m"), "must be finite and > 0 m, but is 0.0"),
    (require_positive, (np.inf, ""), "must be finite and > 0, but is inf"),
    (require_positive, (np.array([1.0, -1.0]), "m"), "must be finite and > 0 m"),
    (require_positive, (-np.ones((40, 2)), "m"), r"but is \[\[-1. -1.\] \[.{60,90} \.\.\.\.$"),
    (require_positive, ("1", "m"), "must be a number, but is '1'"),
    # NumPy has no whole number for them, and Python does not write the second one.
    (require_positive, (2**64, "m"), "must be a float, or fit 64 bits as a whole number, but is"),
    (require_within, (-(16**5000), -1.0, 1.0), "must be a float, or fit 64 bits as a whole"),
    (require_within, (-1e-9, 0.0, 1.0), r"must lie in \[0, 1\], but is -1e-09"),
    (require_within, (1.0 + 1e-9, 0.0, 1.0, "m"), r"must lie in \[0, 1\] m, but is"),
    (require_within, (np.nan, 0.0, 1.0), r"must lie in \[0, 1\], but is nan"),
    (require_whole, (1, 2), "must be a whole number >= 2, but is 1"),
    (require_whole, (2.0, 2), "must be a whole number >= 2, but is 2.0"),
    (require_whole, (True, 0), "must be a whole number >= 0, but is True"),
    (require_whole, (np.int64(5), 1), "must be a whole number >= 1, but is 5 of NumPy, without"),
]


@pytest.mark.parametrize(("check", "value", "limits"), [(c, v, limits) for c, v, *limits in FINE])
def test_what_passes(check, value, limits):
    check("x", value, *limits)


@pytest.mark.parametrize(("check", "given", "words"), REFUSED)
def test_what_is_refused(unchecked, check, given, words):
    with pytest.raises(ValueError, match=words) as error:
        check("x", *given)
    assert str(error.value).startswith("Argument `x` ") and "\n" not in str(error.value)


@pytest.mark.parametrize(("check", "limits"), [(require_choice, (NAMES,)), (require_whole, (1,))])
def test_what_steers_python_cannot_be_traced(check, limits):
    with pytest.raises(ValueError, match="but is traced by JAX, where a known value is needed"):
        jax.jit(lambda x: check("x", x, *limits))(1)


def test_a_name_that_is_not_known():
    require_known("one", iter(NAMES))
    with pytest.raises(ValueError, match=r"`onne` must be a known name, but is not \(is 'one'"):
        require_known("onne", NAMES)
    with pytest.raises(ValueError, match="but is not; there are one, two"):
        require_known("x", NAMES)


def test_a_failure_is_nan_and_its_slopes_are_in_either_mode():
    """In its lane alone, of a number and of a number for each of a row."""

    def found(x):
        return nan_unless(x > 0, {"one": 3 * x, "row": jnp.stack([x, x**2])})

    at = jnp.array([1.0, -1.0, jnp.nan, 2.0])
    for slopes in (jax.jacrev(found), jax.jacfwd(found), jax.jit(jax.jacrev(found)), found):
        for leaf in jax.tree.leaves(jax.vmap(slopes)(at)):
            rows = np.isnan(leaf).reshape(4, -1)
            assert rows[1:3].all() and not rows[[0, 3]].any()
