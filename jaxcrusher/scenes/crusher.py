"""A crusher as a machine: the paper's, but for what is given."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jaxcrusher.crusher.capacity import stroke, stroke_ratio
from jaxcrusher.mechanism.scene import Scene
from jaxcrusher.scenes.build import build_chamber, build_linkage, build_scene, by_stroke
from jaxcrusher.scenes.machine import AbstractStructure, Machine
from jaxcrusher.scenes.own_laws import check_described, law_numbers
from jaxcrusher.scenes.parameters import (
    CHAMBER,
    CHOICES,
    NUMBERS,
    POINTS,
    SITE,
    Parameter,
    Value,
    complete,
    openers,
    readable,
)
from jaxcrusher.scenes.plausibility import borrowed, has_constant_load, remarks
from jaxcrusher.scenes.units import all_said


@dataclass(frozen=True)
class Crusher(AbstractStructure):
    """A single-toggle jaw crusher: what is not given of it is the paper's."""

    def complete(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values with the paper's in the place of missing ones.

        Raises ValueError as `check_described` and `complete` do.
        """
        check_described(values)
        return complete(values)

    def scene(self, values: Mapping[str, Any]) -> Scene:
        """Return `build_scene` of the values; raises as that does."""
        return build_scene(values)

    def numbers(self, values: Mapping[str, Any]) -> Mapping[str, Parameter]:
        """Return those of `jaxcrusher.scenes.parameters`, and of laws of one's own."""
        laws = law_numbers(values)
        return {**NUMBERS, **laws} if laws else NUMBERS

    def choices(self, values: Mapping[str, Any]) -> Mapping[str, tuple[str, ...]]:
        """Return those of `jaxcrusher.scenes.parameters`."""
        return CHOICES

    def merged(self, given: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values with the eccentricity of a stroke, as `by_stroke` does.

        An eccentricity or a stroke of `over` stands in the place of either.
        """
        throws = {"stroke", "shaft.eccentricity"}
        left = throws if throws & over.keys() else ()
        return by_stroke({n: v for n, v in given.items() if n not in left} | dict(over))

    def unusual(self, values: Mapping[str, Any]) -> list[str]:
        """Return `remarks`; ValueError as they do, and for a chamber that cannot be."""
        build_chamber(values)
        return remarks(values)

    def borrowed(self, given: Mapping[str, Any]) -> list[str]:
        """Return which numbers of a machine are the PE250x400's."""
        return borrowed(given)

    def left_open(self, machine: Machine) -> list[str]:
        """Return which numbers a file leaves to the PE250x400, and whether its load is chosen."""
        names, told = borrowed(machine.given), []
        if names:
            listed = ", ".join(f"{name} {readable(name, NUMBERS[name].default)}" for name in names)
            told.append(f"leaves {len(names)} numbers to the PE250x400: {listed}.")
        if "load_law" not in machine.given:
            told.append(
                "has no load_law: the load is the paper's, constant along the jaw. Rock presses "
                'while the jaw closes: load_law = "closing_stroke".'
            )
        return told

    def about(self, machine: Machine) -> dict[str, str]:
        """Return stroke and capacity, loads, masses and foundation, and what is assumed."""
        values, given = machine.values, machine.given

        def told(*keys: str) -> str:
            return all_said({key: values[key] for key in keys if key in values}, machine.units)

        constant = ("load",) if has_constant_load(values) else ("load_curve", "load_factor")
        parts = [key for key in NUMBERS if key.startswith(("foundation.", "rollers."))]
        assumed = [key for key in (*parts, "load_law", "contact_law") if key not in given]
        held = [key for key in parts if key in given and key.startswith("foundation.")]
        return {
            "crushing": _crushing(values),
            "loads": told("load_law", *constant, "load_point", "load_edge", "load_scatter"),
            "masses": told(
                "shaft.mass", "jaw.mass", "toggle.mass", "counterweight.mass", "frame_mass"
            ),
            "foundation": told(*held) or "clamped",
            "assumed": told(*assumed) or "nothing",
        }

    def idle(self, values: Mapping[str, Any]) -> set[str]:
        """Return what the load sheet and the capacity alone need; a bed of rock is a chamber's."""
        rock = "chamber" in np.atleast_1d(values.get("load_law", ""))
        points = {name for name in values if name.startswith(POINTS)}
        return {*SITE, *(() if rock else CHAMBER), *points}

    def beside(
        self, fixed: Mapping[str, Any], varied: Mapping[str, tuple[Any, ...]]
    ) -> dict[str, Any]:
        """Return what every design of a grid has; not what comes with a choice that varies."""
        chosen = {f"{name}={value}" for name, values in varied.items() for value in values}
        found = super().beside(fixed, varied)
        return {n: v for n, v in found.items() if n in fixed or not chosen & {*openers(n)}}


def _crushing(values: Mapping[str, Any]) -> str:
    """Say stroke and capacity of a crusher."""
    links, capacity = build_linkage(values), build_chamber(values).capacity(values["speed"])
    return (
        f"stroke at the discharge {1e3 * float(stroke(links)):.3g} mm horizontally, "
        f"{float(stroke_ratio(links)):.2f} times that vertically, capacity {float(capacity):.3g} "
        "m3/h by laminating theory"
    )


def paper_machine(**values: Value | Path) -> Machine:
    """Return the paper's crusher as a machine, for sweeps, maps, identification and the search.

    `values` are names of `jaxcrusher.PE250X400` and others of `jaxcrusher.build_scene` that are not
    the paper's, as `start="contact"`; names with a dot go by `**{"jaw.mass": 600.0}`. Raises
    ValueError in one line as `build_scene` does.
    """
    described = {name: str(one) if isinstance(one, Path) else one for name, one in values.items()}
    return Machine(Crusher()).replace(**described)
