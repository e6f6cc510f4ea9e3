"""What the rows say, for a mechanical engineer."""

import math

from benchmarks.joints import words
from benchmarks.joints.cases import ACROSS, ALONG, NEW, SPEED
from benchmarks.joints.figure import series
from benchmarks.joints.measure import BEFORE, SAMPLES, SETTLE, STARTS, TURNS, Row
from benchmarks.joints.signature import COARSE, LOW
from benchmarks.setting import setting
from jaxcrusher.files.provenance import command


def page(rows: list[Row]) -> str:
    """The whole of it."""
    along, across = ([r for r in rows if r.load == load] for load in (ALONG, ACROSS))
    apart = [row for row in rows if len(row.case.clearances) == 1]
    along, across = ([r for r in some if r not in apart] for some in (along, across))
    said = _said(rows)
    parts = [
        words.HEADING.format(**said),
        words.RATTLES.format(starts=STARTS, turns=TURNS, settle=SETTLE),
        table("worn|A|B|C|RMS, kN|peak, kN|inside|whirls", map(_forces, along)),
        words.IMPACTS,
        table(
            "worn|clearance|m/s at A|B|C|kN at A|B|C|kW at A|W at B|W at C",
            map(_joints, along),
        ),
        words.QUIET.format(**said),
        table("worn|A|B|C|RMS, N|peak, N|by A|by B|by C|turns|inside", map(_slopes, across)),
        words.TELLS.format(**said),
        table(
            "worn|clearance|above 3rd, R_O|R_C|RMS R_C / R_O|peaks R_C / R_O|bursts R_C",
            map(_signature, along),
        ),
        words.MEANINGS.format(**said),
        words.ALONE,
        table("load|joint|clearance|RMS, N|peak, kN|m/s|wear, W|inside", map(_alone, apart)),
        words.LIMITS,
    ]
    return "".join(parts)


def _said(rows: list[Row]) -> dict[str, str | float]:
    """The numbers of the text."""
    new = series(rows, "A", ALONG)[0].values
    worn = {joint: series(rows, joint, ALONG)[-1] for joint in "ABC"}
    quiet = {j: [row.values["foundation_rms"] for row in series(rows, j, ACROSS)] for j in "ABC"}
    change = {j: 100 * max(abs(rms / of[0] - 1) for rms in of) for j, of in quiet.items()}
    b, c, still = worn["B"], worn["C"], series(rows, "A", ACROSS)
    return {
        "command": command(),
        "setting": setting(),
        "new": f"{new['foundation_rms'] / 1e3:.1f}",
        **{j.lower(): f"{row.values['foundation_rms'] / 1e3:.1f}" for j, row in worn.items()},
        "quiet": f"{max(change.values()):.2f}",
        "resonant": change["A"],
        "share_new": f"{still[0].values['high_share_bearing']:.0e}",
        "share_worn": f"{still[-1].values['high_share_bearing']:.0e}",
        "a_new": new["joint_peak"] / 1e3,
        "a_b": b.values["joint_peak"] / 1e3,
        "bursts_new": f"{new['bursts']:.0f}",
        "bursts_b": f"{b.values['bursts']:.0f}",
        "bursts_c": f"{c.values['bursts']:.0f}",
        "new_mm": 1e3 * NEW,
        "coarse_ms": 2e3 * math.pi / SPEED / SAMPLES * COARSE,
        "coarse_b": f"{b.values['bursts_coarse']:.0f}",
        "coarse_c": f"{c.values['bursts_coarse']:.0f}",
        "low": LOW,
        "low_b": _number(b, "low_ratio", 1.0, 3),
        "low_c": _number(c, "low_ratio", 1.0, 3),
    }


def table(head: str, lines) -> str:
    """In Markdown; the first column is text."""
    names = head.split("|")
    rule = "|".join(["---", *["---:"] * (len(names) - 1)])
    body = "".join(f"| {' | '.join(line)} |\n" for line in lines)
    return f"| {' | '.join(names)} |\n|{rule}|\n{body}"


def _mm(row: Row) -> list[str]:
    return [f"{1e3 * clearance:g}" for clearance in row.case.clearances.values()]


def _worn(row: Row) -> list[str]:
    """Its name, and how far it is worn."""
    worst = {"none": f"{1e3 * NEW:g}", "all": "most"}
    found = row.case.clearances.get(row.case.worn)
    return [row.case.worn, worst.get(row.case.worn) or f"{1e3 * (found or 0):g}"]


def _number(row: Row, name: str, factor: float, digits: int) -> str:
    """With its standard error, if it is an average; a motion that was not found has none."""
    if math.isnan(row.values[name]):
        return "none"
    text = f"{factor * row.values[name]:.{digits}f}"
    error = row.errors.get(name)
    return text if error is None else f"{text} ± {factor * error:.{digits}f}"


def _plain(row: Row, name: str, factor: float = 1.0) -> str:
    return f"{factor * row.values[name]:.3g}"


def _inside(row: Row) -> str:
    return "yes" if row.inside else "no"


def _forces(row: Row) -> list[str]:
    forces = [_number(row, f"foundation_{name}", 1e-3, d) for name, d in (("rms", 2), ("peak", 0))]
    return [row.case.worn, *_mm(row), *forces, _inside(row), f"{row.whirls} of {STARTS}"]


def _joints(row: Row) -> list[str]:
    found = _worn(row)
    found += [_plain(row, before + "impact_speed") for before in BEFORE.values()]
    found += [f"{row.values[before + 'joint_peak'] / 1e3:.0f}" for before in BEFORE.values()]
    found += [f"{row.values['sliding_power'] / 1e3:.1f}"]
    return [*found, *(f"{row.values[BEFORE[joint] + 'sliding_power']:.0f}" for joint in "BC")]


def _slopes(row: Row) -> list[str]:
    names = ("foundation_rms", "foundation_peak", *(f"slope_{joint}" for joint in "ABC"))
    factors = (1.0, 1.0, 1e-3, 1e-3, 1e-3)
    found = [_number(row, name, k, 1) for name, k in zip(names, factors, strict=True)]
    return [row.case.worn, *_mm(row), *found, _number(row, "settling_turns", 1, 0), _inside(row)]


def _signature(row: Row) -> list[str]:
    shares = [_number(row, f"high_share_{of}", 1.0, 3) for of in ("bearing", "pivot")]
    ratios = [_number(row, f"{of}_ratio", 1.0, d) for of, d in (("rms", 3), ("peak", 2))]
    return [*_worn(row), *shares, *ratios, _number(row, "bursts", 1.0, 0)]


def _alone(row: Row) -> list[str]:
    ((joint, clearance),) = row.case.clearances.items()
    load = "along" if row.load == ALONG else "across"
    rms, before = _number(row, "foundation_rms", 1.0, 0), BEFORE[joint]
    peak = _number(row, "foundation_peak", 1e-3, 1)
    hits = [_plain(row, before + name) for name in ("impact_speed", "sliding_power")]
    return [load, joint, f"{1e3 * clearance:g}", rms, peak, *hits, _inside(row)]
