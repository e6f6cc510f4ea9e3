"""The design study on the console and as a page."""

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from jaxcrusher.scenes.parameters import readable
from optimize.balance.designs import (
    designs,
    forces,
    headline,
    long_runs,
    origins,
    remarks,
    robust,
)
from optimize.balance.methods import ARRIVED, comparison, verdict
from optimize.balance.problem import CONDITIONS


def print_tables(console: Console, result: dict) -> None:
    """The answer in a line, the methods, the designs and their forces."""
    console.print(headline(result), highlight=False, markup=False)
    for make in (comparison, designs, forces, long_runs, origins, robust):
        headings, rows = make(result)
        table = Table(box=SIMPLE_HEAD, padding=(0, 0, 0, 1), pad_edge=False)
        for i, heading in enumerate(headings):
            # What a row is of stays in one line; the rest wraps, nothing is cut off.
            side = "right" if i else "left"
            title = heading.replace("\\", "")
            table.add_column(title, justify=side, no_wrap=not i, overflow="fold")
        for row in rows:
            table.add_row(*(cell.replace("\\", "") for cell in row))
        console.print(table)


def markdown(result: dict, picture: str) -> str:
    """The study as a page, with the name of its picture."""
    options, cost, first = result["settings"], result["cost"], next(iter(result["figures"]))
    scene = options["scene"]
    ratio = cost["gradient_seconds"] / cost["value_seconds"]
    wide = dict(zip(CONDITIONS, options["tolerance"], strict=True))
    wide = {name: width for name, width in wide.items() if name in result["robust"]["conditions"]}
    chosen = "links and masses" if options["machine"] else "mass centre and links"
    parts = [
        f"# Counterweight, {chosen} that shake the foundation least",
        f"Made by `{result['command']}`. Speed {readable('speed', scene['speed'])}, clearance "
        f"{readable('clearance', scene['clearance'])}, the rest as in the {first} but for "
        f"{len(result['designs']['bounds'])} free parameters. The "
        "eccentricity follows from the rest so that the jaw's lower end B keeps its horizontal "
        "travel; with the same discharge opening (set by moving C, as on the machine) and the "
        "same speed, the capacity by laminating crushing theory is the same too.",
        headline(result),
        f"![best so far, forces and power]({picture})",
        "## The searches",
        f"{options['starts']} random starts, the same for each method: machines that move. At most "
        f"{options['budget']} values of work each. A value is the RMS of a periodic "
        f"motion and took {1e3 * cost['value_seconds']:.1f} ms of CPU time, a "
        "gradient by all parameters "
        f"{1e3 * cost['gradient_seconds']:.1f} ms: it counts as {ratio:.1f} values. Arrived: "
        f"within {ARRIVED:.1%} of the gain of the best search. Seconds include the method's own.",
        _table(*comparison(result)),
        verdict(result),
        "## The designs",
        _table(*designs(result)),
        "The counterweight is given by its first moment about O, along and across O-A; its radius "
        "then only decides its weight, and goes to its bound.",
        "## What the search exploits",
        "\n".join(f"- {remark}" for remark in remarks(result)),
        "## Forces",
        _table(*forces(result)),
        _table(*long_runs(result)),
        "## What the force is made of",
        _table(*origins(result)),
        "## Tolerances",
        f"{options['samples']} conditions, the same for each design, uniform within "
        + ", ".join(f"±{100 * width:g} % of {name}" for name, width in wide.items())
        + f"; the robust design has the least mean + {options['sigmas']:g} spreads "
        f"({result['robust']['gradients']} gradients of all conditions, from the optimum).",
        _table(*robust(result)),
    ]
    return "\n\n".join(parts) + "\n"


def _table(headings: list[str], rows: list[list[str]]) -> str:
    lines = [headings, ["---", *["---:"] * (len(headings) - 1)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
