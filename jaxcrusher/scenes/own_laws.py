"""Laws of your own, named `module:Class` in a description.

A law is an Equinox module in your file. Each of its fields is a number of the
description, with the SI unit of the field's metadata:

    stiffness: Scalar = eqx.field(converter=scalar, metadata={"unit": "N/m"})

A joint fills fields of these names: `stiffness`, `restitution`, `impact_velocity`, `width`,
`clearance` and `modulus` of a normal force, `slip` and `coefficient` of friction. A `contact_law`
may also be a whole bearing, which gets `bore_radius` and `norm_width` too.
"""

import ast
import dataclasses
import hashlib
import importlib
import inspect
import itertools
import sys
from collections.abc import Container, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import equinox as eqx
import numpy as np

from jaxcrusher.basics.checks import require, require_choice, require_known
from jaxcrusher.crusher.loads import AbstractLoad
from jaxcrusher.joint.clearance import AbstractBearing
from jaxcrusher.joint.friction import AbstractFriction
from jaxcrusher.joint.normal import AbstractNormalForce
from jaxcrusher.scenes.parameters import (
    CHOICES,
    FILES,
    NUMBERS,
    POINTS,
    Parameter,
    check_number,
    refuse_others,
)
from jaxcrusher.scenes.units import size_of

# Last word of a choice -> what its class must be, and where its numbers stand if it has no prefix.
_KINDS: dict[str, tuple[tuple[type[eqx.Module], ...], str]] = {
    "contact_law": ((AbstractNormalForce, AbstractBearing), "contact"),
    "friction_law": ((AbstractFriction,), "contact"),
    "load_law": ((AbstractLoad,), "crushing"),
}
# Fields that are no numbers of a description.
_PARTS = ("impact_velocity", "slip", "normal", "friction", "norm_width")
_ANY = (-1e300, 1e300)


def is_own(name: str, value: Any) -> bool:
    """Return whether a value names a class."""
    return name.rpartition(".")[2] in _KINDS and isinstance(value, str) and ":" in value


def law_class(name: str, text: str, folder: Path = Path()) -> type[eqx.Module]:
    """Return the class of a law.

    Its module is searched on Python's path, and then in `folder`. Raises ValueError of one line
    for a missing module or class, and for a class of another kind.
    """
    module, _, of = text.partition(":")
    kinds, _ = _KINDS[name.rpartition(".")[2]]
    try:
        found: Any = getattr(_imported(module, folder), of, None)
    except Exception as error:  # the module is the user's, and may do anything while it is imported
        why = str(error) if isinstance(error, ImportError) else f"{type(error).__name__}: {error}"
        raise ValueError(f"Argument `{name}` must name a module, but {text}: {why}.") from error
    good = isinstance(found, type) and issubclass(found, kinds) and not inspect.isabstract(found)
    listed = " or ".join(kind.__name__ for kind in kinds)
    require(good, name, f"name a class of {listed} as module:Class", text)
    return found


def _section(name: str) -> str:
    """Return where the numbers of a law stand: `contact`, or `elbow` of its own contact law."""
    head, _, last = name.rpartition(".")
    return head or _KINDS[last][1]


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


def law_numbers(values: Mapping[str, Any], known: Container[str] = NUMBERS) -> dict[str, Parameter]:
    """Return the numbers, by name, of your own laws that a description chooses.

    A choice may be a row of several laws. Numbers that are `known` already, such as
    elbow.restitution, are left out. Raises ValueError as `law_class` does, and for a field whose
    unit is not an SI unit.
    """
    return {
        key: _number(key, field, text)
        for key, field, text in _fields(values)
        if field.name not in _PARTS and key not in known
    }


def _fields(values: Mapping[str, Any]) -> Iterator[tuple[str, dataclasses.Field, str]]:
    """Yield the fields of the laws of one's own that are chosen: name, field and law of each."""
    for name, value in values.items():
        for text in value if isinstance(value, tuple | list) else (value,):
            for field in dataclasses.fields(law_class(name, text)) if is_own(name, text) else ():
                yield f"{_section(name)}.{field.name}", field, text


def _number(name: str, field: dataclasses.Field, text: str) -> Parameter:
    """Return what is known of a field of a law."""
    unit = field.metadata.get("unit", "1")
    must = "be of a law that gives its field an SI unit"
    require(unit == "1" or size_of(unit) in (None, 1.0), name, must, f"in {unit!r}")
    meaning = field.metadata.get("meaning", f"{field.name} of {text}")
    default = field.default if isinstance(field.default, int | float) else np.nan
    scale = 1.0 if not default or np.isnan(default) else None
    return Parameter(float(default), unit, meaning, _ANY, scale)


def check_description(values: Mapping[str, Any]) -> Mapping[str, Parameter]:
    """Check a crusher's description, which may name your own laws, and return the known numbers.

    Numbers are scalars or arrays; a number known only to `jax.jit` passes (see `within_limits`).
    Contents of files are checked when they are read, and points when a scene is made. Raises
    ValueError for an unknown name, a number outside its limits, an unknown choice, and a number
    that two laws of one joint would take.
    """
    laws = law_numbers(values)
    require_one_law_each(values, laws)
    numbers = {**NUMBERS, **laws} if laws else NUMBERS
    for name, value in values.items():
        if name in FILES or name.startswith(POINTS) or is_own(name, value):
            continue
        refuse_others(name)
        require(name != "stroke", name, "be a scene file's, or shaft.eccentricity", "given")
        if name in CHOICES:
            require_choice(name, value, CHOICES[name])
            continue
        require_known(name, (*numbers, *CHOICES, *FILES))
        check_number(name, value, numbers)
    return numbers


def require_one_law_each(values: Mapping[str, Any], laws: Mapping[str, Parameter]) -> None:
    """Raise ValueError for a number of `law_numbers` that two laws of one joint would take."""
    taken: dict[str, str] = {}
    for key, _, text in _fields(values) if laws else ():
        other = taken.setdefault(key, text)
        clash = other != text and key in values and key in laws
        require(not clash, key, "be a number of one law", f"of {other} and of {text}")


def built(name: str, text: str, values: Mapping[str, Any], **known: Any) -> Any:
    """Return the law, with the description's numbers and those that the joint knows.

    Raises ValueError for a field that has neither a number nor a default.
    """
    made, section, given = law_class(name, text), _section(name), {}
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
    """Return a description in which your own laws and files have a digest of their content.

    The digest identifies results: a changed law or curve makes another description.
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
