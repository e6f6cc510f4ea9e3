"""What tells one computation from another."""

import functools

import jax
import jax.numpy as jnp
import numpy as np

import jaxcrusher as jc
from jaxcrusher.files.journal import Journal, finished, text_of


def test_text_holds_every_value_and_no_address():
    """Long arrays too: one that is cut short would let two computations meet."""
    numbers = np.linspace(0.0, 1.0, 3000)
    changed = numbers.copy()
    changed[1500] = np.nextafter(changed[1500], 1.0)
    assert text_of({"x": numbers}) == text_of({"x": numbers.copy()}) != text_of({"x": changed})
    added = [text_of(functools.partial(lambda x, y: x + y, 1.0)) for _ in range(2)]
    assert added[0] == added[1] != text_of(functools.partial(lambda x, y: x + y, 2.0))


def test_text_holds_the_code_of_functions_and_what_they_close_over():
    """A formula that was mended under its name was answered by what the first one gave."""

    def texts(power, step=1):
        def loop(x):
            return x if x > 9 else loop(x + step)  # closes over itself

        inner = lambda x: loop(x) ** power  # noqa: E731
        return [text_of({"f": one}) for one in (inner, jax.jit(inner), functools.partial(inner))]

    assert texts(2) == texts(2) and len(set(texts(2))) == 3
    for others in (texts(3), texts(2, step=2)):
        assert not set(texts(2)) & set(others)
    assert text_of(lambda x: x + 1) != text_of(lambda x: x - 1)
    # The package's own are told by its sources, and those of JAX by its version.
    for known in (jc.statistics, jnp.mean, jax.jit(jnp.mean)):
        assert "at 0x" not in text_of(known) and len(text_of(known)) < 60


def test_what_is_kept_is_not_computed_again(tmp_path):
    """Unless one of its inputs is another, or its file is damaged."""
    journal, computed = Journal(tmp_path), []

    def kept(function, *inputs):
        place = journal.place(function, inputs)
        if (found := finished(place)) is None:
            computed.append(function)
            found = {"sum": np.sum(inputs)}
            journal.keep(place, found)
        return float(found["sum"])

    assert [kept("sum", 1.0, 2.0), kept("sum", 1.0, 2.0)] == [3.0, 3.0] and len(computed) == 1
    assert [kept("sum", 1.0, 3.0), kept("add", 1.0, 2.0)] == [4.0, 3.0] and len(computed) == 3
    for file in tmp_path.iterdir():
        file.write_bytes(b"damaged")
    assert kept("sum", 1.0, 2.0) == 3.0 and len(computed) == 4
    journal.discard()
    assert not tmp_path.exists()


def test_no_damaged_bit_of_a_chunk_passes(tmp_path):
    """One in the table of contents of NumPy's file left an array out, or raised another error."""
    place = tmp_path / "chunk"
    Journal(tmp_path).keep(place, {"a": np.arange(3.0), "why": np.array(["no", "yes"])})
    whole = place.read_bytes()
    assert (found := finished(place)) is not None and list(found["why"]) == ["no", "yes"]
    for n in range(len(whole)):
        place.write_bytes(whole[:n] + bytes([whole[n] ^ 8]) + whole[n + 1 :])
        assert finished(place) is None, n
        place.write_bytes(whole[:n])
        assert finished(place) is None, n
