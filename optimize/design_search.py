"""The whole search, from the options to the files of results."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from threading import Event, Timer
from typing import TYPE_CHECKING

from rich.console import Console

from jaxcrusher.batch.cluster import connected, local_workers
from jaxcrusher.files.journal import Journal
from jaxcrusher.files.progress import progress
from jaxcrusher.files.provenance import command, versions
from jaxcrusher.files.results import write_json
from jaxcrusher.files.resume import begin
from optimize.answer import Answer
from optimize.ask.options import Options
from optimize.ask.problem import DesignProblem
from optimize.ask.resolve import resolve, tell
from optimize.search.stages import STAGES
from optimize.search.work import Stopped, Work
from optimize.tell.checks import judge
from optimize.tell.page.document import write_page
from optimize.tell.result import content, print_answer

if TYPE_CHECKING:
    import distributed

WRITTEN = ("result.json", "report.html", "orbits.nc", "landscape.nc", "*.svg")
# The folder of finished chunks of an unfinished search.
CHUNKS = "chunks"


def design_search(options: Options, console: Console) -> Answer:
    """Search, and write result.json, maps, figures and page; partial results if interrupted.

    An interrupted search, or a search whose `seconds` are over, continues from its finished chunks
    later. If no design of the box may be chosen, the answer says why. The status is "finished" only
    after page and figures are written. Raises ValueError as `resolve` does.
    """
    problem = resolve(options)
    tell(problem, options.scene)
    with local_workers(options.scheduler) as scheduler, connected(scheduler) as client:
        return _answered(problem, options, client, console)


def _answered(
    problem: DesignProblem,
    options: Options,
    scheduler: "distributed.Client | None",
    console: Console,
) -> Answer:
    """Search with the workers of a scheduler, or in this process without a scheduler."""
    folder = begin(options.folder, problem.settings, *WRITTEN)
    journal = Journal(folder / CHUNKS, Path(__file__).parent)
    answer = Answer(problem, command(), versions("scipy"))
    with progress(console) as bars:
        work = Work(folder, bars, journal, scheduler)
        try:
            with _for_seconds(options.seconds, work.stop):
                for i, stage in enumerate(STAGES.values()):
                    left = ", ".join([*[*STAGES][i:], "checks"])
                    answer = replace(answer, status=f"interrupted: {left} are missing")
                    answer = stage(answer, work)
            answer = judge(replace(answer, status="interrupted: checks are missing"))
            from optimize.tell import figures  # already imported during compilation

            drawn, omitted = figures.draw_all(folder, answer)
            write_page(folder, replace(answer, status="finished"), drawn, omitted)
            answer = replace(answer, status="finished")
        except Stopped:
            after = f"stopped after {options.seconds:g} s"
            answer = replace(answer, status=answer.status.replace("interrupted", after))
        except Exception as error:
            answer = replace(answer, status=f"failed: {error}")
            raise
        finally:
            answer = replace(answer, seconds=work.seconds, steps=work.steps)
            write_json(folder / "result.json", content(answer))
            if not answer.finished:
                write_page(folder, answer, ())
    if answer.finished:
        journal.discard()
    print_answer(console, answer)
    console.print(f"results in {folder}/")
    return answer


@contextmanager
def _for_seconds(seconds: float | None, stop: Event) -> Iterator[None]:
    """Set `stop` after so many seconds; None means never."""
    if seconds is None:
        yield
        return
    timer = Timer(seconds, stop.set)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
