"""What every object says of itself at a prompt and in a notebook."""

from xml.etree import ElementTree

SVG = ".//{http://www.w3.org/2000/svg}svg"
# Of JAX's and Python's own texts, and of an object that cannot be said.
OF_PROGRAMS = ("f64[", "Array(", "<function", "array(", "traces or has replaced")


def check_told(told, *words, pictures=1):
    """Short, in words, with the headline first; in HTML too, with so many pictures."""
    lines = repr(told).splitlines()
    assert len(lines) <= 25 and max(map(len, lines)) <= 100, repr(told)
    for word in words:
        assert word in repr(told), repr(told)
    assert not [word for word in OF_PROGRAMS if word in repr(told)], repr(told)
    page = ElementTree.fromstring(told._repr_html_())
    text = " ".join(page.itertext())
    assert " ".join(lines[0].split()) in " ".join(text.split())
    assert len(page.findall(SVG)) == pictures
    assert "nan" not in told._repr_html_()
