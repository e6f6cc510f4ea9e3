"""HTML from Python values: every text is escaped, only `Html` is not."""

import html
import math
import numbers
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

# Of the numbers under a key: the unit they are shown in, and what they are multiplied by.
Units = Mapping[str, tuple[str, float]]


class Html(str):
    """Text that is HTML already."""


def element(name: str, *children: object, **attributes: str) -> Html:
    """One element around its children; `class_` stands for `class`, `_` in names for `-`."""
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{html.escape(value)}"'
        for key, value in attributes.items()
    )
    return Html(f"<{name}{written}>{join(children)}</{name}>")


def join(children: Iterable[object]) -> Html:
    """Children side by side."""
    return Html("".join(as_html(child) for child in children))


def as_html(value: object) -> Html:
    """HTML as it is, everything else as escaped text."""
    return value if isinstance(value, Html) else Html(html.escape(as_text(value)))


def known(value: object) -> bool:
    """Neither None nor a number that is not finite."""
    return not (value is None or (isinstance(value, numbers.Real) and not math.isfinite(value)))


def as_text(value: object) -> str:
    """A value in words; what is not a number says so."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not known(value):
        return "no value"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def table(
    headings: Sequence[object], rows: Iterable[Sequence[object]], *, caption: str = ""
) -> Html:
    """A table; numbers align right. The first column names its row."""
    head = element("tr", *(element("th", heading, scope="col") for heading in headings))
    body = [
        element("tr", element("th", row[0], scope="row"), *(_cell(value) for value in row[1:]))
        for row in rows
    ]
    title = element("caption", caption) if caption else ""
    whole = element("table", title, element("thead", head), element("tbody", *body))
    return element("div", whole, class_="wide")


def _cell(value: object) -> Html:
    if isinstance(value, numbers.Real) and not isinstance(value, bool):
        return element("td", value, class_="number")
    return element("td", value)


def nested(value: object, units: Units = MappingProxyType({})) -> Html:
    """Any content of a JSON file: mappings and lists of mappings as tables, others as text."""
    if isinstance(value, Mapping):
        rows = [
            element(
                "tr",
                element("th", _with_unit(key, units), scope="row"),
                element("td", nested(_scaled(key, entry, units), units)),
            )
            for key, entry in value.items()
        ]
        return element("table", *rows) if rows else Html("none")
    if isinstance(value, list | tuple):
        if value and all(isinstance(entry, Mapping) for entry in value):
            return records(value, units)
        if any(isinstance(entry, Mapping | list | tuple) for entry in value):
            return element("ol", *(element("li", nested(entry, units)) for entry in value))
        return as_html(", ".join(as_text(entry) for entry in value) or "none")
    return as_html(value)


def records(rows: Sequence[Mapping], units: Units = MappingProxyType({})) -> Html:
    """A list of mappings as one table, with a column for every key of any of them."""
    keys = list(dict.fromkeys(key for row in rows for key in row))

    def entry(row: Mapping, key: str) -> object:
        value = _scaled(key, row.get(key, ""), units)
        return nested(value, units) if isinstance(value, Mapping | list | tuple) else value

    numbered = ((i + 1, *(entry(row, key) for key in keys)) for i, row in enumerate(rows))
    return table(["", *(_with_unit(key, units) for key in keys)], numbered)


def _with_unit(key: object, units: Units) -> str:
    return f"{key}, {units[str(key)][0]}" if str(key) in units else str(key)


def _scaled(key: object, value: object, units: Units) -> object:
    """A number, or a list of them, in the unit of its key."""
    if isinstance(value, list | tuple):
        return [_scaled(key, entry, units) for entry in value]
    if str(key) not in units or isinstance(value, bool) or not isinstance(value, int | float):
        return value
    return value * units[str(key)][1]


def section(title: str, *children: object) -> Html:
    """A section under its heading."""
    return element("section", element("h2", title), *children)


def missing(what: str) -> Html:
    """Says that the run did not come to something."""
    return element("p", f"No {what}: the run ended before it came to that.", class_="missing")
