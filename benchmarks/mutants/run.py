"""A sample of faults, each put into a copy of the tree and run against the tests of its room."""

import contextlib
import itertools
import json
import math
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from benchmarks.mutants.faults import Fault, faults
from benchmarks.pages import table
from jaxcrusher.files.results import results_folder

ROOT = Path(__file__).parents[2]
SOURCES = ("jaxcrusher", "optimize")
KILLED, SURVIVED, LATE = "killed", "survived", "timed out"
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


def files_for(path: str, tree: Path) -> list[str]:
    """Return the test files of a file's room: its mirror first, then those that name the file."""
    module, here = Path(path).stem, room(path)
    folder = tree / "tests" / ELSEWHERE.get(here, here)
    files = sorted(folder.glob("test_*.py"))
    words = {module, Path(path).parent.name}

    def rank(file: Path) -> tuple[bool, bool, int]:
        text = file.read_text()
        named = sum(len(re.findall(rf"\b{word}\b", text)) for word in words)
        mirrored = file.stem == f"test_{module}"
        return not mirrored, file.stem.removeprefix("test_") not in words, -named

    return [str(file.relative_to(tree)) for file in sorted(files, key=rank)]


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


def verdict(
    fault: Fault, tree: Path, seconds: float, passing: dict[str, bool]
) -> dict[str, str | float]:
    """Put a fault into the copy, run the tests of its room, and take it out again.

    A test that fails without the fault too kills nothing, and is left out: `passing` keeps which
    of the tests that failed pass without it.
    """
    file, began = tree / fault.path, time.monotonic()
    whole, killer, status = file.read_bytes(), "", None
    while not passing.get(killer, False):
        try:
            write(file, fault.put_into(whole))
            left_out = [name for name, passes in passing.items() if not passes]
            status, said = run_tests(files_for(fault.path, tree), tree, seconds, left_out)
        finally:
            write(file, whole)
        failed = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", said, re.MULTILINE)
        if failed is None:
            killer = said[-200:] if status else ""
            break
        killer = failed[1]
        if killer not in passing:
            passing[killer] = run_tests([killer], tree, seconds)[0] != 1
    found = LATE if status is None else SURVIVED if status == 0 else KILLED
    spent = round(time.monotonic() - began, 1)
    return {"fault": fault.name, "verdict": found, "by": killer, "seconds": spent}


def write(file: Path, content: bytes) -> None:
    """Write a source, and delete what was compiled of it: two of one second look alike."""
    file.write_bytes(content)
    for compiled in (file.parent / "__pycache__").glob(f"{file.stem}.*"):
        compiled.unlink()


def run_tests(
    files: Sequence[str], tree: Path, seconds: float, left_out: Sequence[str] = ()
) -> tuple[int | None, str]:
    """Return pytest's status, None if it takes longer, and what it says at the end.

    The seconds are the processor's, so that a busy machine judges as an idle one does. Tests that
    wait for ever, and compute nothing, are stopped after ten times as long.
    """
    words = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "--tb=no", "-rfE", *files]
    words += [word for name in left_out for word in ("--deselect", name)]
    cache = {"JAX_COMPILATION_CACHE_DIR": str(tree.parent / "programs")}
    limit = math.ceil(seconds)
    with subprocess.Popen(
        words,
        cwd=tree,
        env=os.environ | {"PYTHONPATH": str(tree)} | cache,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1)),
    ) as process:
        try:
            said = process.communicate(timeout=10 * seconds)[0]
            stopped = process.returncode in (-signal.SIGXCPU, -signal.SIGKILL)
            return None if stopped else process.returncode, said
        except subprocess.TimeoutExpired:
            return None, ""
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # also what the tests have started


def run(
    out: Path, scratch: Path, seed: int, count: int, rooms: Sequence[str], seconds: float
) -> None:
    """Judge the faults that the journal does not hold yet, and print the table of all."""
    # So that the tests end with this process, and the copy is left whole.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    journal = results_folder(out) / "mutants.jsonl"
    lines = journal.read_text().splitlines() if journal.exists() else []
    known = {row["fault"]: row for row in map(json.loads, lines)}
    drawn, tree = sample(seed, count, rooms), copy_tree(results_folder(scratch))
    passing: dict[str, bool] = {}
    for i, fault in enumerate(drawn, 1):
        if fault.name in known:
            continue
        row = known[fault.name] = verdict(fault, tree, seconds, passing)
        with journal.open("a") as kept:
            kept.write(json.dumps(row) + "\n")
        print(f"{i}/{len(drawn)} {row['verdict']} after {row['seconds']} s: {row['fault']}")
    judged = [(room(fault.path), known[fault.name]) for fault in drawn]
    counts = Counter((place, row["verdict"]) for place, row in judged)
    verdicts = (KILLED, SURVIVED, LATE)
    cells = [[p, *(counts[p, v] for v in verdicts)] for p in sorted({p for p, _ in judged})]
    cells.append(["all", *(sum(row["verdict"] == v for _, row in judged) for v in verdicts)])
    print(table(["room", *verdicts], cells))
    for _, row in judged:
        if row["verdict"] != KILLED:
            print(f"{row['verdict']}: {row['fault']}")
