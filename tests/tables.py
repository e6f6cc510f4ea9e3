"""Tables of results as tests read them."""

import csv
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar, cast

Row = TypeVar("Row")


def read_table(path: Path, kind: type[Row]) -> list[Row]:
    """The rows of a table that `write_table` made of instances of a dataclass, `kind`.

    Numbers are read as such where the class says float or int, and the rest is text.
    """
    types = {field.name: field.type for field in fields(cast(Any, kind))}
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = csv.DictReader(line for line in lines if not line.startswith("#"))
    return [kind(**{name: _read(text, types[name]) for name, text in r.items()}) for r in rows]


def _read(text: str, kind: Any) -> Any:
    if kind is str:
        return text
    if text == "":
        return None
    return float(text) if kind is float else int(text)
