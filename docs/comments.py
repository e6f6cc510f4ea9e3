"""A Griffe extension: comments beside fields and above constants are their documentation.

The code writes units and the equations' symbols there. The fields of a class become one table. An
override without a docstring has that of what it overrides.
"""

from pathlib import Path

import griffe


class Comments(griffe.Extension):
    """Comments become documentation where there is no docstring."""

    def on_attribute_instance(self, *, attr: griffe.Attribute, **_) -> None:
        """Read the comment of one field or constant."""
        text = _comment(attr)
        if attr.docstring is None and text:
            attr.docstring = griffe.Docstring(text, lineno=attr.lineno, parent=attr)

    def on_class_members(self, *, cls: griffe.Class, **_) -> None:
        """Gather the fields of a class in one table."""
        fields = [
            field
            for field in cls.attributes.values()
            if "property" not in field.labels and not field.name.startswith("_")
        ]
        if not fields or cls.docstring is None:
            return
        rows = [
            griffe.DocstringAttribute(
                field.name,
                annotation=field.annotation,
                value=field.value,
                description=field.docstring.value if field.docstring else "",
            )
            for field in fields
        ]
        cls.docstring.parsed.append(griffe.DocstringSectionAttributes(rows))
        for field in fields:
            # A field that stands in a stub is no member of the class itself.
            cls.members.pop(field.name, None)

    def on_class(self, *, cls: griffe.Class, **_) -> None:
        """Give overrides the docstrings that they inherit."""
        for name, member in cls.members.items():
            above = (base.members.get(name) for base in cls.mro())
            if not member.is_alias and member.docstring is None:
                member.docstring = next((one.docstring for one in above if one is not None), None)


def _comment(attr: griffe.Attribute) -> str:
    """Return the comment at the end of the definition's last line, or those directly above it."""
    assert isinstance(attr.filepath, Path)
    assert attr.lineno is not None and attr.endlineno is not None
    lines = attr.lines_collection[attr.filepath]
    text = lines[attr.endlineno - 1].partition("  # ")[2]
    if not text:
        first = attr.lineno - 1
        while first > 0 and lines[first - 1].startswith("# "):
            first -= 1
        text = " ".join(line[2:] for line in lines[first : attr.lineno - 1])
    return "" if text.startswith(("fmt:", "pyright:")) else text
