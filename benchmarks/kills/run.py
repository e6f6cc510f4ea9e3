"""Small runs that are killed, crowded, or left without a disk, beside ones that are left alone."""

import contextlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jaxcrusher.files.results import results_folder, write_text

_MAP = """
import sys
from jaxcrusher.files.program import program
def run(folder: str) -> None:
    import jaxcrusher as jc
    axes = {"speed": [27.0, 30.0, 33.0], "clearance": [4e-5, 5e-5, 6e-5]}
    jc.orbit_map(jc.paper_machine(), axes, nodes=96, store=folder + "/map")
def main(folder: str) -> None:
    run(folder)
program(main)
"""
_SWEEP = "--over speed 25 30rad/s 4 --over clearance 0.05 0.06mm 3 --settle 0 --turns 1 --chunk 1"
_MEASURED = """speed_rpm,quantity,order,amplitude,sigma,unit
200,shaking_force_x,1,1.58,0.02,kN
200,shaking_force_y,1,2.70,0.02,kN
286,shaking_force_x,1,3.20,0.03,kN
286,shaking_force_y,1,5.50,0.03,kN
"""
_IDENTIFY = "--measured ../../measured.csv --free jaw.mass shaft.mass --set joint ideal"
_SEARCH = "--cells 5 3 --grid 2 2 --settle 2 --turns 2 --steps 2 --refine 1 --runs 2"
JOBS = {
    "sweep": ["-m", "jaxcrusher", "sweep", *_SWEEP.split(), "--rtol", "1e-5", "--netcdf", "--csv"],
    "map": ["-c", _MAP],
    "search": ["-m", "optimize.run", *_SEARCH.split()],
    "identify": ["-m", "jaxcrusher", "identify", *_IDENTIFY.split(), "--noise", "0"],
}
# What no two runs have alike: their times, also in the checksum of a file that holds one, the lock,
# and their folders, whose names are of one length.
TIMES = ("seconds", "finished", "zarr.json")
MARKS = re.compile(
    rb"20\d\d-\d\d-\d\dT[\d:]+|run-\d{4}|(?<=data-label=\"seconds\" class=\"number\">)[\d.]+"
)
LATE = 900.0  # s: a run that takes longer hangs
DISKS = ("40k", "400k", "1200k")
SIGNALS = (signal.SIGKILL, signal.SIGTERM)


@dataclass(frozen=True)
class Ended:
    """How a run ended: its status, minus the signal where it was killed, and what it said."""

    status: int
    said: str

    @property
    def clear(self) -> bool:
        """Whether it came to its end, or said in one line of words why not."""
        lines = [line for line in self.said.splitlines() if line.startswith("error: ")]
        return "Traceback" not in self.said and (self.status == 0 or len(lines) == 1)


def start(job: str, folder: Path) -> subprocess.Popen[str]:
    """Start a job that writes into a folder."""
    place = ["--folder", str(folder)] if job == "map" else ["--out", str(folder)]
    return subprocess.Popen(
        [sys.executable, *JOBS[job], *place],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"JAX_COMPILATION_CACHE_DIR": str(folder.parent / "programs")},
    )


def end(process: subprocess.Popen[str], seconds: float = LATE) -> Ended:
    """Wait for a run; raises TimeoutExpired."""
    said = process.communicate(timeout=seconds)[1]
    return Ended(process.returncode, said)


def left(folder: Path) -> dict[str, Any]:
    """Return what a run has left, by the name of each file, without its time and place."""
    found: dict[str, Any] = {}
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        name = str(path.relative_to(folder))
        if path.name != "lock":
            found[name] = _plain(path)
    return found


def _plain(path: Path) -> Any:
    content = MARKS.sub(b"", path.read_bytes())
    if path.suffix != ".json":
        return content

    def kept(value: Any) -> Any:
        if isinstance(value, dict):
            return {k: kept(v) for k, v in value.items() if k not in TIMES}
        return [kept(v) for v in value] if isinstance(value, list) else value

    return kept(json.loads(content))


def differ(one: dict[str, Any], other: dict[str, Any], known: Sequence[str] = ()) -> list[str]:
    """Return the names of files that are not alike, but for those `known` to differ."""
    return [n for n in {**one, **other} if one.get(n) != other.get(n) and n not in known]


class Trial:
    """A job, and what it leaves where nothing disturbs it: two runs tell what always differs."""

    def __init__(self, job: str, out: Path) -> None:
        self.job, self.out, self.count = job, out, 0
        began = time.monotonic()
        self.whole = self.finished(self.new())
        began, cold = time.monotonic(), time.monotonic() - began
        self.known = differ(self.whole, self.finished(self.new()))
        self.seconds = time.monotonic() - began
        self.faults: list[str] = []
        print(f"{job}: {cold:.0f} s, then {self.seconds:.0f} s; never alike: {self.known}")

    def new(self) -> Path:
        """Return an empty folder."""
        self.count += 1
        folder = self.out / self.job / f"run-{self.count:04}"
        shutil.rmtree(folder, ignore_errors=True)
        return results_folder(folder)

    def finished(self, folder: Path) -> dict[str, Any]:
        """Run to the end, and return what is left."""
        ended = end(start(self.job, folder))
        if ended.status != 0 or not ended.clear:
            raise RuntimeError(f"{self.job} in {folder} ended with {ended.status}: {ended.said}")
        return left(folder)

    def judge(self, what: str, folder: Path) -> None:
        """Go on to the end, and note what is not as it should be."""
        try:
            wrong = differ(self.whole, self.finished(folder), self.known)
        except RuntimeError as error:
            wrong = [str(error)]
        self.faults += [f"{self.job}, {what}: {name}" for name in wrong]
        print(f"{self.job}, {what}: {wrong or 'the same bits'}")

    def kills(self, chance: random.Random, count: int) -> None:
        """Kill runs, each of which goes on where the last one was, until one comes to its end."""
        done = 0
        while done < count:
            folder, before = self.new(), done
            while done < count:
                process, sign = start(self.job, folder), chance.choice(SIGNALS)
                try:
                    end(process, chance.uniform(0, self.seconds))
                    break
                except subprocess.TimeoutExpired:
                    process.send_signal(sign)
                    ended = end(process)
                    done += 1
                    if ended.status != -sign or "Traceback" in ended.said:
                        self.faults.append(f"{self.job}, {sign.name}: {ended}")
            self.judge(f"{done - before} kills", folder)

    def two_at_once(self) -> None:
        """Start two in one folder, the second while the first computes."""
        for share in (0.0, 0.5):
            folder = self.new()
            one = start(self.job, folder)
            time.sleep(share * self.seconds)
            other = start(self.job, folder)
            self.noted(f"two at once, {share:g} apart", end(one), end(other))
            self.judge(f"two at once, {share:g} apart", folder)

    def bad_disks(self) -> None:
        """Write where nothing can be written, and on disks of several sizes, then of any."""
        folder = self.new()
        with _disk(folder, "10m"):
            _mount("-o", "remount,ro", str(folder))
            self.noted("read-only", end(start(self.job, folder)))
        for size in DISKS:
            folder = self.new()
            with _disk(folder, size):
                self.noted(f"disk of {size}", end(start(self.job, folder)))
                _mount("-o", "remount,size=100m", str(folder))
                self.judge(f"disk of {size}", folder)

    def noted(self, what: str, *ended: Ended) -> None:
        """Print how runs ended, and note what is not one clear line."""
        for one in ended:
            lines = re.findall(r"^error: .*", one.said, re.MULTILINE) or [one.said[-300:]]
            print(f"{self.job}, {what}: {one.status} {' / '.join(lines)}")
            if not one.clear:
                self.faults.append(f"{self.job}, {what}: {one}")


def _mount(*words: str) -> None:
    subprocess.run(["mount", *words], check=True, capture_output=True)


@contextlib.contextmanager
def _disk(folder: Path, size: str) -> Iterator[None]:
    """Let a folder be a disk of a size."""
    _mount("-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder))
    try:
        yield
    finally:
        subprocess.run(["umount", str(folder)], check=True)


def run(out: Path, seed: int, count: int, jobs: Sequence[str]) -> None:
    """Try all jobs; raises RuntimeError, with all faults, if there are any."""
    chance, faults = random.Random(seed), []
    write_text(results_folder(out) / "measured.csv", _MEASURED)
    for i, job in enumerate(jobs):
        trial = Trial(job, results_folder(out).absolute())
        trial.kills(chance, count // len(jobs) + (i < count % len(jobs)))
        trial.two_at_once()
        if os.geteuid() == 0:
            trial.bad_disks()
        faults += trial.faults
    if faults:
        raise RuntimeError(f"{len(faults)} faults:\n" + "\n".join(faults))
    print("no faults")
