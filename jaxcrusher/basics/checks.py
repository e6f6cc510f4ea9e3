"""Checks of arguments, on the values that are known; values known only to `jax.jit` pass."""

import contextlib
import textwrap
from collections.abc import Callable, Iterable, Iterator
from difflib import get_close_matches

import jax
import jax.core
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, PyTree

from jaxcrusher.basics.processes import jax_is_stuck

# More choices than these are not listed to whoever misspells one.
SEVERAL = 8
# A value of several lines is told up to so many characters.
LONG = 100
TRACED = "traced by JAX, where a known value is needed"


def concrete(value) -> np.ndarray | None:
    """The value as a NumPy array, or None if it is traced."""
    return None if isinstance(value, jax.core.Tracer) else np.asarray(value)


def primal(value) -> np.ndarray | None:
    """The value as a NumPy array, without its derivatives; None under `jax.jit` or `jax.vmap`.

    It stays known where only `jax.grad` or another derivative traces it.
    """
    return concrete(jax.lax.stop_gradient(value) if concrete(value) is None else value)


def is_concrete(tree: PyTree) -> bool:
    """Whether no number of a tree is traced."""
    return not any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(tree))


def without_slopes(tree: PyTree) -> PyTree:
    """Return a tree without derivatives; a concrete tree is returned as it is, at no cost."""
    return tree if is_concrete(tree) else jax.lax.stop_gradient(tree)


def nan_unless(good: Bool[ArrayLike, "..."], tree: PyTree) -> PyTree:
    """Return a tree of floats that are NaN, with all their slopes, where `good` does not hold.

    `good` has the leading axes of every leaf. The NaN is a factor: `jnp.where` passes no derivative
    back to the branch not taken, so that in reverse mode a failure would have slopes of zero.
    """
    factor = jnp.where(good, 1.0, jnp.nan)
    axes = jnp.ndim(factor)
    return jax.tree.map(
        lambda leaf: jnp.expand_dims(factor, tuple(range(axes, jnp.ndim(leaf)))) * leaf, tree
    )


def all_finite(tree: PyTree) -> Bool[Array, ""]:
    """Tell whether every number of a tree is finite."""
    return jnp.all(jnp.array([jnp.all(jnp.isfinite(leaf)) for leaf in jax.tree.leaves(tree)]))


def number_in(text: str) -> float:
    """Return the number that a cell of a table holds; ValueError for a text that is none.

    Python reads 1_0 as ten, and no other program does.
    """
    if "_" in text:
        raise ValueError(f"{text!r} is no number")
    return float(text)


def require(condition: bool | np.bool, name: str, must: str, value: object) -> None:
    """Raise the one-line error of this package unless `condition` holds."""
    if not condition:
        given = TRACED if isinstance(value, jax.core.Tracer) else str(value)
        if "\n" in given:  # of a scene, or of a large array
            given = textwrap.shorten(given, LONG, placeholder=" ...")
        raise ValueError(f"Argument `{name}` must {must}, but is {given}.")


@contextlib.contextmanager
def renamed(**names: str) -> Iterator[None]:
    """Let errors inside call each argument of these names as its user does."""
    try:
        yield
    except ValueError as error:
        text = str(error)
        for name, called in names.items():
            text = text.replace(f"`{name}`", f"`{called}`")
        raise ValueError(text) from None


def require_own_process() -> None:
    """Refuse a process that was forked from one in which JAX had computed."""
    must = "be 'spawn', as of multiprocessing.get_context('spawn'), once JAX has computed"
    require(not jax_is_stuck(), "start_method", must, "'fork', after which JAX waits for ever")


def require_x64() -> None:
    """Refuse 32-bit floats: a penetration of 3e-6 m at 0.6 m has no digits in them."""
    require_own_process()
    require(
        jax.config.read("jax_enable_x64"),
        "jax_enable_x64",
        "be True (call jaxcrusher.set_up() first)",
        False,
    )


def require_double(name: str, tree: PyTree) -> None:
    """Check that every float of a PyTree, traced or not, has 64 bits."""
    for leaf in jax.tree.leaves(tree):
        kind = getattr(leaf, "dtype", np.dtype(float))
        good = not np.issubdtype(kind, np.floating) or kind == np.float64
        require(good, name, "hold 64-bit floats only", f"with {kind}")


def require_untraced(name: str, tree: PyTree, function: str, instead: str) -> None:
    """Check that no number is traced: a number that steers a search or a Python loop cannot be."""
    must = f"hold known numbers (jax.grad, jit and vmap go through {instead}, not {function})"
    require(is_concrete(tree), name, must, "traced")


def require_positive(name: str, value: ArrayLike, unit: str) -> None:
    """Check that every entry is a finite number > 0."""
    must = f"be finite and > 0 {unit}".rstrip()
    _require_each(name, value, lambda known: np.isfinite(known) & (known > 0), must)


def require_within(name: str, value: ArrayLike, low: float, high: float, unit: str = "") -> None:
    """Check that every entry is a number in [low, high]."""
    must = f"lie in [{low:g}, {high:g}] {unit}".rstrip()
    _require_each(name, value, lambda known: (known >= low) & (known <= high), must)


def _require_each(
    name: str, value: ArrayLike, good: Callable[[np.ndarray], np.ndarray], must: str
) -> None:
    """Refuse entries that are known, and are no numbers or not `good`."""
    known = primal(value)
    if known is None:
        return
    large = isinstance(value, int) and known.dtype == object
    require(not large, name, "be a float, or fit 64 bits as a whole number", "larger")
    numbers = np.issubdtype(known.dtype, np.number) or known.dtype == bool
    # Half a millisecond, so only where it is told.
    require(numbers, name, "be a number", "" if numbers else repr(value))
    # As they were given, or the numbers inside a tracer.
    shown = known if concrete(value) is None else value
    require(bool(np.all(good(known))), name, must, shown)


def require_whole(name: str, value: object, least: int) -> None:
    """Check for a Python int of at least `least`; JAX would trace a NumPy integer."""
    good = isinstance(value, int) and not isinstance(value, bool) and value >= least
    given = f"{value} of NumPy, without int()" if isinstance(value, np.integer) else value
    require(good, name, f"be a whole number >= {least}", given)


def require_kind(name: str, value: object, kind: type, example: str) -> None:
    """Check for an instance of `kind`, such as `example`; neither its class nor something else."""
    if isinstance(value, kind):
        return
    given = f"a {type(value).__name__}"
    if isinstance(value, type):
        given = f"the class {value.__name__}: call it"
    elif callable(value):
        given = f"a function, {getattr(value, '__name__', value)}: call it"
    raise ValueError(f"Argument `{name}` must be an instance, such as {example}, but is {given}.")


def require_names(name: str, value: object, choices: tuple) -> None:
    """Check for several of the named choices, not one string."""
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
    """Check for a named choice; of many, the error lists only those that are similar."""
    known = any(value is choice or (value == choice) is True for choice in choices)
    if not known:
        listed = ", ".join(repr(choice) for choice in choices)
        meant = _meant(value, choices)
        known = "a known name" if meant and len(choices) > SEVERAL else f"one of {listed}"
        given = TRACED if isinstance(value, jax.core.Tracer) else repr(value)
        raise ValueError(f"Argument `{name}` must be {known}, but is {given}{meant}.")


def require_known(name: object, names: Iterable[str]) -> None:
    """Check for a name of the package's own; the error lists similar names, or the first few."""
    names = tuple(names)
    if name not in names:
        more = f" and {len(names) - SEVERAL} more" if len(names) > SEVERAL else ""
        meant = _meant(name, names) or f"; there are {', '.join(names[:SEVERAL])}{more}"
        raise ValueError(f"Argument `{name}` must be a known name, but is not{meant}.")


def _meant(value: object, choices: Iterable[str]) -> str:
    """Return the known names that a misspelt one resembles."""
    near = get_close_matches(value, choices, n=2) if isinstance(value, str) else []
    return f" (is {' or '.join(map(repr, near))} meant?)" if near else ""
