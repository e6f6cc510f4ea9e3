"""Laws of one's own, named `module:Class` in a description.

A law is an Equinox module in a file of the user's. Each of its fields is a number of the
description, with the unit of the field's metadata:

    stiffness: Scalar = eqx.field(converter=scalar, metadata={"unit": "N/m"})

What a joint knows (`stiffness`, `restitution`, `impact_velocity`, `width`, `clearance` and
`modulus` of a normal force, `slip` and `coefficient` of friction) it gives to fields of these
names. A `contact_law` may also be a whole bearing, which gets `bore_radius` and `norm_width` too.
"""

import ast
import dataclasses
import hashlib
import importlib
import inspect
import itertools
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import equinox as eqx
import numpy as np

from jaxcrusher.basics.checks import require
from jaxcrusher.crusher.loads import AbstractLoad
from jaxcrusher.joint.clearance import AbstractBearing
from jaxcrusher.joint.friction import AbstractFriction
from jaxcrusher.joint.normal import AbstractNormalForce
from jaxcrusher.scenes.parameters import (
    FILES,
    NUMBERS,
    PARAMETERS,
    WORN_JOINTS,
    Parameter,
    check_description,
)

# Choice -> what its class must be, and the section of its numbers.
_CONTACT = (AbstractNormalForce, AbstractBearing)
OPEN: dict[str, tuple[tuple[type[eqx.Module], ...], str]] = {
    "contact_law": (_CONTACT, "contact"),
    "friction_law": ((AbstractFriction,), "contact"),
    "load_law": ((AbstractLoad,), "crushing"),
    **{f"{joint}.contact_law": (_CONTACT, joint) for joint in WORN_JOINTS},
    **{f"{joint}.friction_law": ((AbstractFriction,), joint) for joint in WORN_JOINTS},
}
# Fields that are no numbers of a description.
_PARTS = ("impact_velocity", "slip", "normal", "friction", "norm_width")
_ANY = (-1e300, 1e300)


def is_own(name: str, value: Any) -> bool:
    """Return whether a value names a class."""
    return name in OPEN and isinstance(value, str) and ":" in value


def law_class(name: str, text: str, folder: Path = Path()) -> type[eqx.Module]:
    """Return the class of a law and make its numbers known by `NUMBERS`.

    Its module is looked for where Python looks, and then in `folder`. Raises ValueError of one line
    for a module or a class that is not there, and for a class of another kind.
    """
    module, _, of = text.partition(":")
    kinds, section = OPEN[name]
    try:
        found: Any = getattr(_imported(module, folder), of, None)
    except Exception as error:  # the module is the user's, and may do anything while it is imported
        why = str(error) if isinstance(error, ImportError) else f"{type(error).__name__}: {error}"
        raise ValueError(f"Argument `{name}` must name a module, but {text}: {why}.") from error
    good = isinstance(found, type) and issubclass(found, kinds) and not inspect.isabstract(found)
    listed = " or ".join(kind.__name__ for kind in kinds)
    require(good, name, f"name a class of {listed} as module:Class", text)
    for field in dataclasses.fields(found):
        if field.name not in _PARTS:
            _make_known(f"{section}.{field.name}", field, text)
    return found


def _imported(module: str, folder: Path) -> Any:
    """Import a module from where Python looks, and then from a folder."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        there = str(folder.absolute())
        if error.name != module.partition(".")[0] or there in sys.path:
            raise
        sys.path.append(there)
        importlib.invalidate_caches()
        return importlib.import_module(module)


def _make_known(name: str, field: dataclasses.Field, text: str) -> None:
    """Put a number of a law into the tables of numbers."""
    unit = field.metadata.get("unit", "1")
    meaning = field.metadata.get("meaning", f"{field.name} of {text}")
    default = field.default if isinstance(field.default, int | float) else np.nan
    known = PARAMETERS.get(name)
    if known is not None and known.limits is not _ANY:
        return  # one of the joint's own numbers, such as elbow.restitution
    scale = 1.0 if not default or np.isnan(default) else None
    PARAMETERS[name] = NUMBERS[name] = Parameter(float(default), unit, meaning, _ANY, scale)


def make_known(entries: Iterable[tuple[str, Any]], folder: Path = Path()) -> None:
    """Make the numbers of the laws known that a description names; as `law_class`."""
    for name, value in entries:
        for choice in value if isinstance(value, tuple | list) else (value,):
            if is_own(name, choice):
                law_class(name, choice, folder)


def check_described(values: Mapping[str, Any]) -> None:
    """Check a description, whose laws may be one's own; raises as `check_description` does.

    Raises ValueError too for a number that two laws of one joint would take.
    """
    make_known(values.items())
    taken: dict[str, str] = {}
    for name, text in values.items():
        for field in dataclasses.fields(law_class(name, text)) if is_own(name, text) else ():
            key = f"{OPEN[name][1]}.{field.name}"
            other = taken.setdefault(key, text)
            known = PARAMETERS.get(key)
            clash = other != text and key in values and known is not None and known.limits is _ANY
            require(not clash, key, "be a number of one law", f"of {other} and of {text}")
    check_description({name: value for name, value in values.items() if not is_own(name, value)})


def built(name: str, text: str, values: Mapping[str, Any], **known: Any) -> Any:
    """Return the law, of the description's numbers and of what the joint knows.

    Raises ValueError for a field that has neither a number nor a default.
    """
    made, (_, section) = law_class(name, text), OPEN[name]
    given = {}
    for field in dataclasses.fields(made):
        key = f"{section}.{field.name}"
        # Joints besides A have numbers and choices named as parts: what they stand for is known.
        if key in values and field.name not in _PARTS:
            given[field.name] = values[key]
        elif field.name in known:
            given[field.name] = known[field.name]
        else:
            bare = field.default is dataclasses.MISSING
            bare = bare and field.default_factory is dataclasses.MISSING
            require(not bare, key, f"be given for {text}", "missing")
    return made(**given)


def with_digests(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a description in which laws and files of one's own have a digest of their content.

    Results are kept by it: a law or a curve that changed makes another description.
    """
    told = dict(values)
    for name, value in values.items():
        if isinstance(value, tuple | list):
            told[name] = [with_digests({name: choice})[name] for choice in value]
        elif is_own(name, value):
            law = law_class(name, value)
            told[name] = f"{value} {_digest(_sources(law))}"
        elif name in FILES and isinstance(value, str):
            told[name] = f"{value} {_digest([Path(value)])}"
    return told


def _sources(law: type) -> list[Path]:
    """Return the file of a law, and those that it imports from beside it, however indirectly."""
    source = inspect.getsourcefile(law)
    if source is None:
        return []
    # The folder where its whole module name begins.
    root, found, left = Path(source).parents[law.__module__.count(".")], set(), [Path(source)]
    while left:
        path = left.pop()
        if path not in found:
            found.add(path)
            left += _imports(path, root)
    return sorted(found)


def _imports(path: Path, root: Path) -> list[Path]:
    """Return the files below a folder that a file imports."""
    names: list[tuple[Path, str]] = []
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            names += [(root, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            folder, module = path.parents[node.level - 1] if node.level else root, node.module or ""
            names += [(folder, module)]
            names += [(folder, f"{module}.{alias.name}".lstrip(".")) for alias in node.names]
    places = [folder.joinpath(*name.split(".")) for folder, name in names]
    files = [(place.with_suffix(".py"), place / "__init__.py") for place in places]
    return [path for path in itertools.chain(*files) if path.is_file()]


def _digest(paths: Iterable[Path]) -> str:
    content = b"".join(path.read_bytes() for path in paths if path.is_file())
    return hashlib.sha256(content).hexdigest()[:16]
