"""The frame of the report's interactive landscape; page.js fills it."""

from optimize.page.markup import Html, element


def explorer(data: dict | None) -> Html:
    """Map, choices, and places for one cell's orbits, forces and numbers."""
    title = element("h2", "The landscape, cell by cell")
    if data is None:
        text = "No landscape: the run ended before it came to that."
        return element("section", title, element("p", text, class_="missing"))
    script = element(
        "noscript", element("p", "The map needs JavaScript, which is off.", class_="warning")
    )
    return element(
        "section",
        title,
        element(
            "p",
            "Point at a cell for its numbers and its motion; a click keeps it. With the "
            "keyboard: go to the map by Tab and choose by the arrow keys.",
            class_="help",
        ),
        script,
        element("div", _map(data), _motions(data), _numbers(data), class_="explorer"),
        element("div", id="tip", hidden="hidden"),
        element("p", id="spoken", class_="unseen", role="status"),
    )


def _map(data: dict) -> Html:
    variables = [
        _option(
            variable["name"],
            f"{variable['label']}{_unit(variable)}",
            chosen=variable["name"] == "objective",
        )
        for variable in data["variables"]
    ]
    starts = [_option("larger", "larger of both starts", chosen=True)]
    starts += [_option(str(i), f"{start} start") for i, start in enumerate(data["starts"])]
    legend = (
        "Hatched: F failed, W friction whirl (both left out of the colours). Small circle: out of "
        "the contact model or outside a constraint. Star: optimum. Diamond: the paper's "
        "choice. Red frame: the cell kept."
    )
    return element(
        "div",
        element(
            "div",
            element("label", "Colour:", element("select", *variables, id="choose-variable")),
            element("label", "of:", element("select", *starts, id="choose-start")),
            class_="controls",
        ),
        element(
            "svg",
            id="map",
            viewBox="0 0 640 400",
            tabindex="0",
            role="application",
            aria_label="Map over the design's parameters: arrow keys choose a cell",
        ),
        element("p", legend, class_="legend"),
        class_="map",
    )


def _option(value: str, text: str, *, chosen: bool = False) -> Html:
    selected = {"selected": "selected"} if chosen else {}
    return element("option", text, value=value, **selected)


def _unit(variable: dict) -> str:
    return "" if variable["units"] == "1" else f", {variable['units']}"


def _numbers(data: dict) -> Html:
    head = element(
        "tr",
        *(element("th", text, scope="col") for text in ("of this cell", *data["starts"], "unit")),
    )
    table = element("table", element("thead", head), element("tbody", id="numbers"))
    return element("div", table, class_="wide numbers")


def _motions(data: dict) -> Html:
    motions, place = data["motions"], element("h3", id="place")
    if motions is None:
        text = "No motions to draw: the run ended before them, or the grid is too fine for a page."
        return element("div", place, element("p", text, class_="missing"), class_="motions")
    pictures = [
        element(
            "div",
            element("p", id=f"account-{i}"),
            element(
                "svg",
                id=f"orbit-{i}",
                viewBox="0 0 262 246",
                role="img",
                aria_label=f"Orbit of the pin in its clearance circle, {start} start",
            ),
            element(
                "svg",
                id=f"force-{i}",
                viewBox="0 0 402 246",
                role="img",
                aria_label=f"Foundation force over the last turns, {start} start",
            ),
            class_="motion",
        )
        for i, start in enumerate(data["starts"])
    ]
    turns, instants = motions["turn"][-1], len(motions["turn"]) - 1
    legend = (
        f"After settling, {turns:g} turns seen at {instants / turns:.0f} instants each: peaks of "
        "single impacts fall between them. Dashed circle: the clearance. Dashed line: the ideal "
        "joint's force. A whirl goes round too often for a line and is drawn as dots."
    )
    return element("div", place, *pictures, element("p", legend, class_="legend"), class_="motions")
