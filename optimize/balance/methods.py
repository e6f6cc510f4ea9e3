"""The methods of search compared, in a table and in words."""

import numpy as np

from optimize.balance.compare import METHODS, Search, spent_until

# A search has arrived when this share of the gain of the best one is all it still lacks.
ARRIVED = 1e-3


def by_method(result: dict) -> dict[str, list[Search]]:
    """The searches of each method."""
    searches = [Search(**found) for found in result["searches"]]
    return {method: [s for s in searches if s.method == method] for method in METHODS}


def comparison(result: dict) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of the table of methods, each a column."""
    scale, spent = result["cost"]["scale"], _spent(result)
    rows = []
    for method, found in by_method(result).items():
        end = scale * np.array([s.best[-1] for s in found if s.best])
        if not len(end):
            rows.append([method] + ["none"] * 7)
            continue
        work, seconds = spent[method]
        rows.append(
            [
                method,
                f"{np.median(end):.2f}",
                f"{end.min():.2f} to {end.max():.2f}",
                f"{np.isfinite(work).sum()} of {len(found)}",
                _range(work),
                _range(seconds, 2),
                f"{np.median([s.evaluations for s in found]):.0f}",
                f"{np.median([s.steps for s in found]):.0f}",
            ]
        )
    headings = [
        "method",
        "RMS at the end, N: median",
        "range",
        "arrived",
        "work until then, values: median (range)",
        "CPU seconds until then",
        "evaluations",
        "Newton steps",
    ]
    quantities, *columns = zip(headings, *rows, strict=True)
    return list(quantities), [list(column) for column in columns]


def _spent(result: dict) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Work and CPU seconds of each search until it arrived; infinite where it never did."""
    grouped = by_method(result)
    goal = _goal(grouped)
    return {
        method: (
            np.array([spent_until(s, s.work, goal) for s in found]),
            np.array([spent_until(s, s.seconds, goal) for s in found]),
        )
        for method, found in grouped.items()
        if found
    }


def _goal(grouped: dict[str, list[Search]]) -> float:
    """The value at which a search has arrived; the paper's machine has 1."""
    least = min(s.best[-1] for found in grouped.values() for s in found if s.best)
    return least + ARRIVED * max(1 - least, 0)


def verdict(result: dict) -> str:
    """Who arrives with the least work and in the least time, in words."""
    spent = {name: [_median(v) for v in both] for name, both in _spent(result).items()}
    by_work, by_time = (sorted(spent, key=lambda name, i=i: spent[name][i]) for i in (0, 1))

    def ranked(order: list[str], i: int, digits: int) -> str:
        return ", ".join(
            f"{name} {spent[name][i]:.{digits}f}"
            if np.isfinite(spent[name][i])
            else f"{name} never"
            for name in order
        )

    cost = result["cost"]["gradient_seconds"] / result["cost"]["value_seconds"]
    gradients = spent.get("L-BFGS-B", [float("inf")])[0] / cost
    text = (
        f"Ranked by median work until arrival, in values: {ranked(by_work, 0, 0)}. By CPU "
        f"seconds: {ranked(by_time, 1, 2)}."
    )
    if np.isfinite(gradients):
        text += f" The gradient search arrives after {gradients:.0f} gradients; what it spends"
        text += " is their cost."
    return text


def _range(values: np.ndarray, digits: int = 0) -> str:
    """Median and range; a search that never arrived counts as infinite."""
    low, middle, high = (
        f"{v:.{digits}f}" if np.isfinite(v) else "never"
        for v in (values.min(), _median(values), values.max())
    )
    return f"{middle} ({low} to {high})"


def _median(values: np.ndarray) -> float:
    """The median with infinities among the values."""
    ordered = np.sort(values)
    return float(ordered[[(len(values) - 1) // 2, len(values) // 2]].max())
