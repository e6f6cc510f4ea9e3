"""The sections of the report's page that tell result.json in tables."""

from collections.abc import Mapping

import jaxcrusher as jc
from jaxcrusher.batch.sweep import VARIABLES
from jaxcrusher.joint.validity import ELASTIC_IMPACT_SPEED, WIDEST_CONTACT
from optimize.page.answer import DESIGNS
from optimize.page.data import design_unit
from optimize.page.markup import Html, element, missing, nested, section, table

# Units of the numbers of result.json by their key; lengths of the design are shown in mm.
FIXED_UNITS = {
    "derived_speed": ("rad/s", 1.0),
    "capacity": ("m³/h", 1.0),
    "capacity_floor": ("m³/h", 1.0),
    "ideal_rms": ("N", 1.0),
}
FIXED_UNITS |= {name: (unit, 1.0) for name, (unit, _) in VARIABLES.items() if unit != "1"}
FIXED_UNITS |= {name: design_unit(name) for name in jc.PARAMETERS if design_unit(name)[0]}
OF_OBJECTIVE = ("objective", "half_width", "objective_mean", "objective_half_width")
# Keys of result.json that a section of its own shows; any other is shown as it is.
SHOWN = set(
    "status command versions objective box fixed seed steps seconds grid_best optimum claim "
    "seed_choice ideal candidates refinement checks remark".split()
)


def checks(result: Mapping) -> Html:
    """What was checked, each with its verdict."""
    verdicts = result.get("checks")
    if not verdicts:
        return section("Checks", missing("checks"))
    rows = [
        (
            check.get("name"),
            element("span", check.get("verdict"), class_="ok" if check.get("passed") else "failed"),
            check.get("detail"),
        )
        for check in verdicts
    ]
    failed = sum(not check.get("passed") for check in verdicts)
    verdict = f"{failed} of {len(verdicts)} failed." if failed else f"All {len(verdicts)} passed."
    return section("Checks", element("p", verdict), table(("check", "verdict", "detail"), rows))


def found(result: Mapping) -> Html:
    """Candidates, the grid's best cell, the refinement, and the long runs in full."""
    unit = (result.get("objective") or {}).get("unit", "N")
    units = {**FIXED_UNITS, **dict.fromkeys(OF_OBJECTIVE, (unit, 1.0))}
    slopes = {name: (f"{unit} per {of}", 1 / factor) for name, (of, factor) in units.items()}
    parts: list[object] = []
    for key, title in (("grid_best", "Best cell of the grid"), ("candidates", "Candidates")):
        content = result.get(key)
        told = nested(_flat(content), units) if content else _missing_part(title)
        parts.append(element("div", element("h3", title), element("div", told, class_="wide")))
    parts = [element("div", *parts, class_="columns")]
    title, content = "Refinement", dict(result.get("refinement") or {})
    # Slopes by the parameters have units of their own.
    gradient = content.pop("gradient_at_best", None)
    parts.append(
        element(
            "div",
            element("h3", title),
            element(
                "div",
                nested(_flat(content), units) if content else "",
                nested({"gradient_at_best": gradient}, slopes) if gradient else "",
                class_="wide",
            )
            if content or gradient
            else _missing_part(title),
        )
    )
    for key, title in {**DESIGNS, "ideal": "ideal joint"}.items():
        if result.get(key):
            numbers = element("div", nested(result[key], units), class_="wide")
            parts.append(element("details", element("summary", f"All numbers: {title}"), numbers))
    return section("How it was found", *parts)


def _missing_part(title: str) -> Html:
    return missing(title[0].lower() + title[1:])


def _flat(content: object) -> object:
    """The same with each design's parameters beside its other numbers."""
    if isinstance(content, list | tuple):
        return [_flat(entry) for entry in content]
    if not isinstance(content, Mapping):
        return content
    rest = {key: _flat(entry) for key, entry in content.items() if key not in ("values", "start")}
    return {**content.get("values", {}), **content.get("start", {}), **rest}


def settings(result: Mapping) -> Html:
    """Box, seconds, versions, seed."""
    parts = []
    for key, title in (
        ("box", "Box"),
        ("seconds", "Seconds per stage"),
        ("steps", "Integration steps"),
        ("fixed", "Fixed of the crusher"),
        ("versions", "Versions"),
        ("seed", "Seed of random points"),
    ):
        content = result.get(key)
        shown = (
            missing(title.lower())
            if content is None
            else nested(content, FIXED_UNITS if key in ("box", "fixed") else {})
        )
        parts.append(element("div", element("h3", title), shown))
    return section("How it was run", element("div", *parts, class_="columns"))


def others(result: Mapping) -> Html:
    """Everything that no other section shows, as it is."""
    others = [
        element("div", element("h3", key), element("div", nested(value), class_="wide"))
        for key, value in result.items()
        if key not in SHOWN
    ]
    return section("Further results", *others) if others else Html("")


def limits() -> Html:
    """What the numbers cannot say."""
    limits = (
        "The force is |R_O| + |R_C|, the reactions of the frame on shaft and toggle: the source "
        "of the crusher's data never defines its foundation force.",
        f"Hertz's contact needs a half-width of at most {WIDEST_CONTACT:g} bore radii; impacts "
        f"above {ELASTIC_IMPACT_SPEED:g} m/s are not elastic. Motions beyond either are marked.",
        "A friction whirl penetrates by the order of the clearance: its numbers are outside the "
        "theory and rank as nothing.",
        "Impacting motions diverge exponentially: a motion drawn here is one of many that start "
        "almost alike. Only their statistics can be compared.",
        "A ± of a cell is the scatter within one run; runs can differ from each other by more.",
    )
    return section("Limits of validity", element("ul", *(element("li", x) for x in limits)))
