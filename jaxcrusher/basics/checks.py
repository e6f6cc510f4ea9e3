"""Checks of arguments, on the values that are concrete; traced values pass."""

from collections.abc import Iterable

import jax
import jax.core
import numpy as np
from jaxtyping import ArrayLike, PyTree


def concrete(value) -> np.ndarray | None:
    """The value as a NumPy array, or None if it is traced."""
    return None if isinstance(value, jax.core.Tracer) else np.asarray(value)


def require(condition: bool | np.bool, name: str, must: str, value: object) -> None:
    """Raise the one-line error of this package unless `condition` holds."""
    if not condition:
        raise ValueError(f"Argument `{name}` must {must}, but is {value}.")


def require_x64() -> None:
    """Refuse 32-bit floats: a penetration of 3e-6 m at 0.6 m has no digits in them."""
    require(
        jax.config.read("jax_enable_x64"),
        "jax_enable_x64",
        "be True (call jaxcrusher.set_up() first)",
        False,
    )


def require_double(name: str, tree: PyTree) -> None:
    """Every float of a PyTree, traced or not, with 64 bits."""
    for leaf in jax.tree.leaves(tree):
        kind = getattr(leaf, "dtype", np.dtype(float))
        good = not np.issubdtype(kind, np.floating) or kind == np.float64
        require(good, name, "hold 64-bit floats only", f"with {kind}")


def require_positive(name: str, value: ArrayLike, unit: str) -> None:
    """Every entry finite and > 0."""
    known = concrete(value)
    if known is not None:
        good = bool(np.all(np.isfinite(known) & (known > 0)))
        require(good, name, f"be finite and > 0 {unit}".rstrip(), value)


def require_within(name: str, value: ArrayLike, low: float, high: float, unit: str = "") -> None:
    """Every entry in [low, high]."""
    known = concrete(value)
    if known is not None:
        good = bool(np.all((known >= low) & (known <= high)))
        require(good, name, f"lie in [{low:g}, {high:g}] {unit}".rstrip(), value)


def require_whole(name: str, value: object, least: int) -> None:
    """A whole number, at least `least`."""
    good = isinstance(value, int) and not isinstance(value, bool) and value >= least
    require(good, name, f"be a whole number >= {least}", value)


def require_kind(name: str, value: object, kind: type, example: str) -> None:
    """An instance of `kind`, such as `example`; neither its class nor something else."""
    if isinstance(value, kind):
        return
    given = f"a {type(value).__name__}"
    if isinstance(value, type):
        given = f"the class {value.__name__}: call it"
    elif callable(value):
        given = f"a function, {getattr(value, '__name__', value)}: call it"
    raise ValueError(f"Argument `{name}` must be an instance, such as {example}, but is {given}.")


def require_names(name: str, value: object, choices: tuple) -> None:
    """Several of the named choices, not one string."""
    if isinstance(value, str):
        raise ValueError(
            f"Argument `{name}` must be names in a tuple, such as ({value!r},), but is the string "
            f"{value!r}."
        )
    good = isinstance(value, Iterable)
    require(good, name, "be names in a tuple", f"a {type(value).__name__}")
    for one in value:  # pyright: ignore
        require_choice(name, one, choices)


def require_choice(name: str, value: object, choices: tuple) -> None:
    """One of the named choices."""
    known = any(value is choice or (value == choice) is True for choice in choices)
    if not known:
        listed = ", ".join(repr(choice) for choice in choices)
        raise ValueError(f"Argument `{name}` must be one of {listed}, but is {value!r}.")
