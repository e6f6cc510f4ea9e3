"""A sample of faults, each put into a copy of the tree and run against the tests of its room."""

import ast
import contextlib
import itertools
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.mutants.faults import Fault, faults
from benchmarks.pages import table
from jaxcrusher.files.results import results_folder

ROOT = Path(__file__).parents[2]
SOURCES = ("jaxcrusher", "optimize")
KILLED, LATELY, SURVIVED, LATE = "killed", "killed by a slow test", "survived", "timed out"
TIERS = {"not slow": KILLED, "slow": LATELY}  # which tests judge, and what it is called
NOTHING = 5  # pytest's status where no test was selected
# What tests import, and no fault changes: it takes four seconds of the processor.
ALIKE = (
    *("jax", "equinox", "diffrax", "optax", "jaxtyping", "beartype", "scipy.optimize", "tyro"),
    *("matplotlib.pyplot", "xarray", "zarr", "llvmlite.binding", "pint", "rich.progress"),
    *("hypothesis", "_hypothesis_pytestplugin", "xdist.plugin"),
)
SERVE = "import sys; from benchmarks.mutants.server import serve; serve(sys.argv[1:])"
# Rooms whose tests stand in another folder than theirs.
ELSEWHERE = {"commands": "whole", "__main__": "whole", "testing": "", "__init__": "whole"}


def sample(seed: int, count: int, rooms: Sequence[str]) -> list[Fault]:
    """Draw faults of some rooms, of all if none is named, of every kind as many."""
    every: dict[str, list[Fault]] = {}
    for source in SOURCES:
        for path in sorted((ROOT / source).rglob("*.py")):
            name = str(path.relative_to(ROOT))
            if not rooms or room(name) in rooms:
                for fault in faults(name, path.read_bytes()):
                    every.setdefault(fault.kind, []).append(fault)
    chance = random.Random(seed)
    orders = [chance.sample(every[kind], len(every[kind])) for kind in sorted(every)]
    turns = itertools.zip_longest(*orders)
    return [fault for turn in turns for fault in turn if fault is not None][:count]


def room(path: str) -> str:
    """Return the room of a file: a folder of the package, or the search."""
    parts = Path(path).with_suffix("").parts
    return parts[0] if parts[0] != "jaxcrusher" else parts[1]


def ordered(fault: Fault, tree: Path, costs: dict[str, float]) -> list[str]:
    """Return the tests of a fault's room, as pytest names them: those first that name its place.

    Among them those of the mirrored file come first, then those of files that name it oftener, and
    of each file those that cost least; a test whose cost is not known yet stands in the middle.
    """
    module, here = Path(fault.path).stem, room(fault.path)
    folder = tree / "tests" / ELSEWHERE.get(here, here)
    words = _places((tree / fault.path).read_text(), fault.line)
    ranked = []
    for file in sorted(folder.glob("test_*.py")):
        text, name = file.read_text(), str(file.relative_to(tree))
        said = -sum(len(re.findall(rf"\b{word}\b", text)) for word in {module, *words})
        rank = file.stem != f"test_{module}", said, name
        for test in ast.parse(text).body:
            if isinstance(test, ast.FunctionDef) and test.name.startswith("test_"):
                node = f"{name}::{test.name}"
                told = set(re.findall(r"\w+", ast.get_source_segment(text, test) or ""))
                ranked.append((not told & words, *rank, costs.get(node, 1.0), node))
    return [node for *_, node in sorted(ranked)]


def _places(text: str, line: int) -> set[str]:
    """Return the public names of what stands round a line, and of what uses it in the file."""
    every = ast.parse(text).body
    inside = [n for top in every for n in ast.walk(top) if isinstance(n, ast.stmt)]
    found = {name for n in inside if n.lineno <= line <= (n.end_lineno or 0) for name in _names(n)}
    count = 0
    while count < len(found):
        count = len(found)
        uses = [n for n in every if found & {m.id for m in ast.walk(n) if isinstance(m, ast.Name)}]
        found.update(name for node in uses for name in _names(node))
    return {name for name in found if not name.startswith("_")}


def _names(node: ast.AST) -> list[str]:
    match node:
        case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
            return [name]
        case ast.Assign(targets=targets):
            return [n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)]
        case ast.AnnAssign(target=ast.Name(id=name)):
            return [name]
    return []


def copy_tree(scratch: Path) -> Path:
    """Copy what git tracks; return the copy's root."""
    tree = scratch / "tree"
    shutil.rmtree(tree, ignore_errors=True)
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True
    )
    for name in listed.stdout.splitlines():
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, tree / name)
    return tree


@dataclass
class Judge:
    """Puts faults into a copy of the tree, one at a time, and runs the tests of their rooms.

    Slow tests judge what all quick ones pass. A test that fails without the fault too kills
    nothing, and is left out: `passing` keeps which of the tests that failed pass without it.
    """

    tree: Path
    seconds: float  # of the processor, for the tests of a fault: for the quick, and for the slow
    costs: dict[str, float]  # seconds by test
    modules: Sequence[str] = ALIKE  # imported once for all
    passing: dict[str, bool] = field(default_factory=dict)
    process: subprocess.Popen[str] | None = None

    def verdict(self, fault: Fault) -> dict[str, str | float]:
        """Put a fault into the copy, run the tests of its room, and take it out again."""
        began, tests = time.monotonic(), ordered(fault, self.tree, self.costs)
        found, killer = SURVIVED, ""
        for tier, killed in TIERS.items():
            status, killer = self._judged(fault, tests, tier)
            found = LATE if status is None else SURVIVED if status in (0, NOTHING) else killed
            if found != SURVIVED:
                break
        spent = round(time.monotonic() - began, 1)
        return {"fault": fault.name, "verdict": found, "by": killer, "seconds": spent}

    def _judged(self, fault: Fault, tests: Sequence[str], tier: str) -> tuple[int | None, str]:
        """Return pytest's status with a fault, and the test that saw it."""
        file = self.tree / fault.path
        whole = file.read_bytes()
        while True:
            try:
                write(file, fault.put_into(whole))
                left_out = [name for name, passes in self.passing.items() if not passes]
                status, said = self.run(tests, left_out, tier)
            finally:
                write(file, whole)
            failed = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", said, re.MULTILINE)
            if failed is None:
                return status, said[-200:] if status not in (0, NOTHING) else ""
            killer = failed[1]
            if killer not in self.passing:
                self.passing[killer] = self.run([killer])[0] != 1
            if self.passing[killer]:
                return status, killer

    def run(
        self, tests: Sequence[str], left_out: Sequence[str] = (), tier: str = ""
    ) -> tuple[int | None, str]:
        """Return pytest's status, None if it takes longer, and what it says at the end."""
        if self.process is None:
            known = {"PYTHONPATH": str(self.tree), "EQX_ON_ERROR": "nan"}
            known["JAX_COMPILATION_CACHE_DIR"] = str(self.tree.parent / "programs")
            known["PYTHONDONTWRITEBYTECODE"] = ""  # what no fault changes is compiled once
            self.process = subprocess.Popen(
                [sys.executable, "-c", SERVE, *self.modules],
                cwd=self.tree,
                env=os.environ | known,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        words = ["-o", "addopts="]
        words += ["-x", "-q", "--tb=no", "-rfE", "--durations=0", "-m", tier, *tests]
        words += [word for name in left_out for word in ("--deselect", name)]
        assert self.process.stdin and self.process.stdout
        print(json.dumps({"words": words, "seconds": self.seconds}), file=self.process.stdin)
        self.process.stdin.flush()
        answer = json.loads(self.process.stdout.readline())
        spent = defaultdict[str, float](float)
        for seconds, test in re.findall(r"^ *([\d.]+)s \w+ +([^\s[]+)", answer["said"], re.M):
            spent[test] += float(seconds)
        self.costs.update(spent)
        return answer["status"], answer["said"]

    def close(self) -> None:
        """End the process that runs the tests, and with it a test that is running."""
        if self.process is not None:
            self.process.terminate()


def write(file: Path, content: bytes) -> None:
    """Write a source, and delete what was compiled of it: two of one second look alike."""
    file.write_bytes(content)
    for compiled in (file.parent / "__pycache__").glob(f"{file.stem}.*"):
        compiled.unlink()


def run(
    out: Path, scratch: Path, seed: int, count: int, rooms: Sequence[str], seconds: float
) -> None:
    """Judge the faults that the journal does not hold yet, or that took too long; print a table."""
    # So that the tests end with this process, and the copy is left whole.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    journal = results_folder(out) / "mutants.jsonl"
    lines = journal.read_text().splitlines() if journal.exists() else []
    known = {row["fault"]: row for row in map(json.loads, lines) if row["verdict"] != LATE}
    drawn, tree = sample(seed, count, rooms), copy_tree(results_folder(scratch))
    costs = out / "costs.json"
    known_costs = json.loads(costs.read_text()) if costs.exists() else {}
    with contextlib.closing(Judge(tree, seconds, known_costs)) as judge:
        for i, fault in enumerate(drawn, 1):
            if fault.name in known:
                continue
            row = known[fault.name] = judge.verdict(fault)
            with journal.open("a") as kept:
                kept.write(json.dumps(row) + "\n")
            costs.write_text(json.dumps(judge.costs))
            print(f"{i}/{len(drawn)} {row['verdict']} after {row['seconds']} s: {row['fault']}")
    judged = [(room(fault.path), known[fault.name]) for fault in drawn]
    counts = Counter((place, row["verdict"]) for place, row in judged)
    verdicts = (KILLED, LATELY, SURVIVED, LATE)
    cells = [[p, *(counts[p, v] for v in verdicts)] for p in sorted({p for p, _ in judged})]
    cells.append(["all", *(sum(row["verdict"] == v for _, row in judged) for v in verdicts)])
    print(table(["room", *verdicts], cells))
    for _, row in judged:
        if row["verdict"] != KILLED:
            print(f"{row['verdict']}: {row['fault']}")
