"""What tells one computation from another."""

import functools

import numpy as np

from jaxcrusher.files.journal import Journal, text_of


def test_text_holds_every_value_and_no_address():
    """Long arrays too: one that is cut short would let two computations meet."""
    numbers = np.linspace(0.0, 1.0, 3000)
    changed = numbers.copy()
    changed[1500] = np.nextafter(changed[1500], 1.0)
    assert text_of({"x": numbers}) == text_of({"x": numbers.copy()}) != text_of({"x": changed})
    added = [text_of(functools.partial(lambda x, y: x + y, 1.0)) for _ in range(2)]
    assert added[0] == added[1] != text_of(functools.partial(lambda x, y: x + y, 2.0))


def test_what_is_kept_is_not_computed_again(tmp_path):
    """Unless one of its inputs is another, or its file is damaged."""
    journal, computed = Journal(tmp_path), []

    def kept(function, *inputs):
        def compute():
            computed.append(function)
            return {"sum": np.sum(inputs)}

        return float(journal.kept(function, inputs, compute)["sum"])

    assert [kept("sum", 1.0, 2.0), kept("sum", 1.0, 2.0)] == [3.0, 3.0] and len(computed) == 1
    assert [kept("sum", 1.0, 3.0), kept("add", 1.0, 2.0)] == [4.0, 3.0] and len(computed) == 3
    for file in tmp_path.iterdir():
        file.write_bytes(b"damaged")
    assert kept("sum", 1.0, 2.0) == 3.0 and len(computed) == 4
    journal.discard()
    assert not tmp_path.exists()
