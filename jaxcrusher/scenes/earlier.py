"""Calls as version 0.1 had them, which took functions and descriptions in the place of a machine.

Each works for one version more, and says once in a process what to write instead.
"""

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from jaxcrusher.basics.setup import warn_once
from jaxcrusher.mechanism.scene import AbstractScene
from jaxcrusher.scenes.crusher import paper_machine
from jaxcrusher.scenes.machine import Machine, OwnFunction


def _say(verb: Callable[..., Any], instead: str) -> None:
    name = getattr(verb, "__name__", "")
    text = f"jaxcrusher.{name} takes a machine first: write {name}({instead})."
    warn_once(text, text)


def axes_first(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Let a call begin with the axes; `base` and `scene` say of what."""

    @functools.wraps(verb)
    def called(*args: Any, base: Any = None, scene: Any = None, **settings: Any) -> Any:
        if args and not isinstance(args[0], Mapping) and base is None and scene is None:
            return verb(*args, **settings)
        if not args and "machine" in settings:
            return verb(**settings)
        instead = "jaxcrusher.paper_machine(**base), axes, ..." if scene is None else "scene, axes"
        _say(verb, instead)
        known = {} if base is None else dict(base)
        made = paper_machine(**known) if scene is None else Machine(OwnFunction(scene), known)
        return verb(made, *args, **settings)

    return called


def of_description(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Let a description of a crusher, as of `jaxcrusher.build_scene`, stand for its machine."""

    @functools.wraps(verb)
    def called(machine: Any, *args: Any, **settings: Any) -> Any:
        if isinstance(machine, Mapping):
            _say(verb, "jaxcrusher.paper_machine(**description), ...")
            machine = paper_machine(**machine)
        return verb(machine, *args, **settings)

    return called


def orbit_first(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Let an orbit stand before its machine."""

    @functools.wraps(verb)
    def called(machine: Any, orbit: Any, *args: Any, **settings: Any) -> Any:
        if not isinstance(machine, Machine) and not callable(machine):
            _say(verb, "machine, orbit, ...")
            machine, orbit = orbit, machine
        return verb(machine, orbit, *args, **settings)

    return called


@dataclass(frozen=True)
class ByPlace:
    """A function of numbers by their place, called with them by name."""

    function: Callable[..., AbstractScene]

    def __call__(self, **numbers: Any) -> AbstractScene:
        """Return the scene of the numbers."""
        return self.function(*numbers.values())


def unnamed(*names: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Let a call have a function of numbers without names in the place of a machine and names."""

    def wrapped(verb: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(verb)
        def called(first: Any, *args: Any, **settings: Any) -> Any:
            if isinstance(first, Machine) or _are_names(args) or ("name" in settings and not args):
                return verb(first, *args, **settings)
            of = settings.pop("name", None)
            known = names if of is None else (of,)
            said = repr(known[0]) if len(known) == 1 else repr(known)
            _say(verb, f"machine, {said}, ...")
            made = Machine(OwnFunction(ByPlace(first)))
            return verb(made, known[0] if len(known) == 1 else known, *args, **settings)

        return called

    return wrapped


def _are_names(args: tuple[Any, ...]) -> bool:
    """Whether the first argument is a name, or several."""
    first = args[0] if args else None
    return isinstance(first, str) or (isinstance(first, tuple) and isinstance(first[0], str))
