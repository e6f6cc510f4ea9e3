"""HTML from Python values: every text is escaped, only `Html` is not."""

import html
import math
import numbers
from collections.abc import Iterable, Sequence


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


def as_text(value: object) -> str:
    """A value in words; what is not a number says so."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, numbers.Real) and not math.isfinite(value):
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


def section(title: str, *children: object) -> Html:
    """A section under its heading."""
    return element("section", element("h2", title), *children)


def missing(what: str) -> Html:
    """Says that the run did not come to something."""
    return element("p", f"No {what}: the run ended before it came to that.", class_="missing")
