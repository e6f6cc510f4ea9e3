"""Calls as version 0.1 had them, which took functions and descriptions in the place of a machine.

Each works for one version more, and says once in a process what to write instead.
"""

import functools
from collections.abc import Callable, Mapping
from typing import Any, TypeVar, cast

from jaxcrusher.basics.checks import require
from jaxcrusher.basics.setup import warn_once
from jaxcrusher.scenes.build import paper_machine
from jaxcrusher.scenes.machine import Machine, OwnFunction, machine_of

# A public function, whose types stay those of its new form.
Verb = TypeVar("Verb", bound=Callable[..., Any])


def _say(verb: Callable[..., Any], instead: str) -> None:
    name = getattr(verb, "__name__", "")
    text = f"jaxcrusher.{name} takes a machine first: write {name}({instead}, ...)."
    warn_once(text, text)


def axes_first(verb: Verb) -> Verb:
    """Let a call begin with the axes; `base` and `scene` give the machine."""

    @functools.wraps(verb)
    def called(*args: Any, **settings: Any) -> Any:
        new = not isinstance(args[0], Mapping) if args else "axes" not in settings
        if new or "machine" in settings:
            return verb(*args, **settings)
        base, scene = settings.pop("base", None), settings.pop("scene", None)
        base = {} if base is None else base
        good, given = isinstance(base, Mapping), f"a {type(base).__name__}"
        require(good, "base", 'map names to values, as {"start": "contact"}', given)
        made = "jaxcrusher.paper_machine({})" if scene is None else "scene"
        if scene is not None and base:
            made = "functools.partial(scene, {})"
        _say(verb, f"{made.format('**base' if base else '')}, axes")
        machine = paper_machine() if scene is None else machine_of(scene)
        return verb(machine.replace(**base), *args, **settings)

    return cast(Verb, called)


def of_description(verb: Verb) -> Verb:
    """Let a description of a crusher stand for its machine, and an orbit before the machine."""

    def makes_scenes(one: Any) -> bool:
        return isinstance(one, Machine | Mapping) or callable(one)

    @functools.wraps(verb)
    def called(machine: Any, *args: Any, **settings: Any) -> Any:
        turned = bool(args) and makes_scenes(args[0]) and not makes_scenes(machine)
        if turned:
            machine, args = args[0], (machine, *args[1:])
        described, rest = isinstance(machine, Mapping), ", orbit" if turned else ""
        if described or turned:
            made = "jaxcrusher.paper_machine(**machine)" if described else "machine"
            _say(verb, f"{made}{rest}")
        return verb(paper_machine(**machine) if described else machine, *args, **settings)

    return cast(Verb, called)


def unnamed(*names: str) -> Callable[[Verb], Verb]:
    """Let a function of numbers without names replace a machine and names in a call."""

    def wrapped(verb: Verb) -> Verb:
        @functools.wraps(verb)
        def called(machine: Any, *args: Any, **settings: Any) -> Any:
            first = args[0] if args else settings.get("name", settings.get("names"))
            several = first if isinstance(first, tuple) else (first,)
            if isinstance(machine, Machine) or all(isinstance(one, str) for one in several):
                return verb(machine, *args, **settings)
            machine_of(machine)  # refuses what is none
            of = settings.pop("name", None)
            known = names if of is None else (of,)
            said = known[0] if len(known) == 1 else known
            _say(verb, f"machine, {said!r}")
            by_name = OwnFunction(lambda **numbers: machine(*numbers.values()))
            return verb(Machine(by_name), said, *args, **settings)

        return cast(Verb, called)

    return wrapped
