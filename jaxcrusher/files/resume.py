"""Go on with the results of an earlier run only if it had the same settings."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from jaxcrusher.files.results import as_kept, results_folder, tell, write_json

SETTINGS = "settings.json"
REMEDY = "Choose another, or delete it."


def begin(folder: Path, settings: Mapping[str, Any], *written: str) -> Path:
    """Return the folder of a run that writes `written` (patterns of names), made if need be.

    `settings` decide the results and are stored beside them. Files of `written` from a run with the
    same settings are removed: nothing there is older than the run. Raises ValueError for results
    of other settings, naming what differs, and for results without settings.
    """
    kept = results_folder(folder) / SETTINGS
    old = sorted({path for pattern in written for path in folder.glob(pattern)})
    if earlier(kept, settings, "name") is None and old:
        raise ValueError(
            f"Argument `name` must be new, but {folder} holds {old[0].name} of an unknown run. "
            f"{REMEDY}"
        )
    for path in old:
        path.unlink()
    write_json(kept, {"settings": settings})
    return folder


def begin_beside(
    folder: Path, settings: Mapping[str, Any], *written: str, spared: Iterable[str] = ()
) -> Path:
    """Do as `begin`, and keep the results of a run with other settings beside the new ones.

    With the same settings, files that are `spared` and not `written` stay.
    """
    keep_beside(folder / SETTINGS, settings, *written, *spared)
    return begin(folder, settings, *written)


def keep_beside(path: Path, settings: Mapping[str, Any], *written: str) -> None:
    """Move the results of a run with other settings to a folder `earlier/N` beside them.

    `path` is the JSON file that holds the settings, and `written` are patterns of names. A file of
    settings that cannot be read stays, and `begin` or `earlier` refuses it.
    """
    try:
        before = json.loads(path.read_bytes())["settings"]
    except (OSError, ValueError, KeyError, TypeError):
        return
    if before == as_kept(settings):
        return
    folder = path.parent / "earlier"
    numbers = [int(one.name) for one in folder.glob("*") if one.name.isdecimal()]
    aside = folder / str(max(numbers, default=0) + 1)
    aside.mkdir(parents=True)
    patterns = dict.fromkeys((path.name, *written))
    for old in sorted(one for pattern in patterns for one in path.parent.glob(pattern)):
        old.rename(aside / old.name)
    tell(f"{path.parent}: results of other settings are kept in {aside}.")


def earlier(path: Path, settings: Mapping[str, Any], argument: str) -> dict[str, Any] | None:
    """Return the content of a JSON file with the same `settings`, or None if there is none.

    Raises ValueError for a file that cannot be read and for other settings, naming what differs
    and the `argument` that chooses the file.
    """
    if not path.exists():
        return None
    try:
        content = json.loads(path.read_bytes())
        before = dict(content["settings"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ValueError(
            f"Argument `{argument}` must be that of a run that can be read, but {path} is not: "
            f"{type(error).__name__}: {error}. {REMEDY}"
        ) from None
    require_same(path, before, as_kept(settings), argument)
    return content


def require_same(
    path: Path, before: Mapping[str, Any], now: Mapping[str, Any], argument: str
) -> None:
    """ValueError that names the settings, as JSON keeps them, in which `path` differs from now."""
    then, here = _flat(before), _flat(now)
    differ = ", ".join(
        f"{name} {_short(then.get(name), here.get(name))} (now "
        f"{_short(here.get(name), then.get(name))})"
        for name in {**then, **here}
        if then.get(name) != here.get(name)
    )
    if differ:
        raise ValueError(
            f"Argument `{argument}` must be new for other settings, but {path} has results of "
            f"{differ}. {REMEDY}"
        )


def _flat(settings: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested settings by dotted names."""
    flat = {}
    for name, value in settings.items():
        inner = isinstance(value, Mapping)
        flat |= _flat(value, f"{prefix}{name}.") if inner else {prefix + name: value}
    return flat


def _short(value: Any, other: Any) -> str:
    """Return a value as text, a number with the digits that tell it from the `other` one."""
    rounded = f"{value:.6g}" if isinstance(value, float) else ""
    if rounded and not (isinstance(other, float) and rounded == f"{other:.6g}"):
        return rounded
    text = "none" if value is None else json.dumps(value)
    return text if len(text) <= 60 else f"{text[:28]} ... {text[-28:]}"
