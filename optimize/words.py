"""What a search found in words, for the console and for the page."""

from optimize.answer import Answer, Confirmed, Runs


def number(value: float) -> str:
    """Five digits, and all of those before the point."""
    return f"{value:.0f}" if abs(value) >= 1e4 else f"{value:.5g}"


def interval(runs: Runs) -> str:
    """A mean with its interval, and what is wrong with the runs."""
    failed = runs.count - int(runs.by_run["success"].sum())
    if failed:
        return "failed" if failed == runs.count else f"{failed} of {runs.count} failed"
    text = f"{number(runs.objective_mean)} ± {float(f'{runs.objective_half_width:.2g}'):g}"
    return f"{text}, friction whirl" if runs.by_run["whirl"].any() else text


def regimes(design: Confirmed) -> str:
    """How a design moves, from the starts looked at."""
    return "; ".join(f"{start} start {kind.name}" for start, kind in design.regime.items())


def limits(design: Confirmed) -> str:
    """What of a design's runs is outside the contact model."""
    found = []
    for start, runs in design.runs.items():
        known = bool(runs.first("success"))
        remarks = runs.validity.remarks() if known else ["not known"]
        found += [f"{start} start, {remark}" for remark in remarks]
    if found:
        return "OUTSIDE the contact model: " + "; ".join(found)
    limits = [runs.validity for runs in design.runs.values()]
    return (
        "inside the contact model (half-width "
        f"{max(float(one.half_width_ratio) for one in limits):.2f} bore radii, approach "
        f"{max(float(one.impact_speed_ratio) for one in limits):.2f} of the elastic limit)"
    )


def error(answer: Answer) -> str:
    """What the ± of an interval means."""
    counts = {runs.count for one in answer.designs.values() for runs in one.runs.values()}
    return f"± is half a 95 % interval, from {max(counts)} independent runs"


def spent(answer: Answer) -> list[str]:
    """Of every stage that came to its end."""
    return [
        f"{name} {seconds:.0f} s"
        + (f" ({answer.steps[name] / 1e6:.1f}e6 steps)" if name in answer.steps else "")
        for name, seconds in answer.seconds.items()
    ]
