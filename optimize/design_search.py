"""The whole search, from the options to what it leaves behind."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.console import Console

from jaxcrusher.files.journal import Journal
from jaxcrusher.files.progress import progress
from jaxcrusher.files.provenance import command, versions
from jaxcrusher.files.results import write_json
from jaxcrusher.files.resume import begin
from optimize.answer import Answer, Orbit
from optimize.ask.options import Options
from optimize.ask.problem import Problem, resolve, tell
from optimize.search import stages
from optimize.search.active import active_constraints
from optimize.search.concurrent import run_concurrently
from optimize.search.landscape import Maps
from optimize.tell import checks as verdicts
from optimize.tell import result_file
from optimize.tell import screen as report
from optimize.tell.page.document import write_page

WRITTEN = ("result.json", "report.html", "orbits.nc", "landscape.nc", "*.svg")
# Finished chunks of a search that is not finished.
CHUNKS = "chunks"


def run(options: Options, console: Console) -> Answer:
    """Search, and write result.json, maps, figures and page; what there is, if interrupted.

    A search that was interrupted goes on from its finished chunks. A box of which no design may be
    chosen is an answer too: it says why. The status is "finished" only after page and figures are
    written.
    """
    problem = resolve(options)
    tell(problem, options.scene)
    folder = begin(problem.folder, problem.settings, *WRITTEN)
    journal = Journal(folder / CHUNKS, Path(__file__).parent)
    parts, maps, status = _known(problem), None, "interrupted"
    with progress(console) as bars:
        work = stages.Work(folder, bars, journal)

        def answer_of(status: str, **more: Any) -> Answer:
            spent = {"seconds": work.seconds, "steps": work.steps}
            return Answer(status=status, **spent, **parts, **more)

        try:
            maps, compared = stages.map_box(problem, work)
            for part in _searched(problem, work, maps, compared):
                parts |= part
            judged = verdicts.judged(answer_of(status), problem, maps)
            done = answer_of("finished", **judged)
            from optimize.tell import figures  # imported while programs were compiled

            drawn, omitted = figures.draw_all(folder, problem.case, maps, done)
            write_page(folder, done, maps.orbits, drawn, omitted)
            parts |= judged
            status = "finished"
        except Exception as error:
            status = f"failed: {error}"
            raise
        finally:
            answer = answer_of(status)
            write_json(folder / "result.json", result_file.content(answer))
            if not answer.finished:
                write_page(folder, answer, None if maps is None else maps.orbits, ())
    journal.discard()
    report.print_answer(console, answer)
    console.print(f"results in {folder}/")
    return answer


def _known(problem: Problem) -> stages.Part:
    """Return what is known of the answer before the search: fields of `Answer`."""
    return {
        "command": command(),
        "versions": versions("scipy"),
        "objective": problem.sought,
        "box": problem.box,
        "fixed": dict(problem.case.design.fixed),
        "columns": {name: one[:2] for name, one in problem.case.columns.items()},
        "settle_turns": stages.LONGER * problem.effort.settle,
        "compared_with": problem.searched.compared_with,
        "bulk_density": problem.bulk_density,
        "seed": problem.effort.seed,
    }


def _searched(
    problem: Problem, work: stages.Work, maps: Maps, compared: Orbit | None
) -> Iterator[stages.Part]:
    """Yield the parts of the answer as the stages find them.

    `compared` is the orbit of the design to compare with.
    """
    yield {"stable_orbits": maps.stable_orbits}
    candidates, part = stages.refine(problem, work, maps)
    yield part
    best, part = stages.confirm(problem, work, maps, candidates, compared)
    yield part
    if best is None:
        return
    yield {"optimum": best}
    known = best, part["seed_choice"]
    refined, designs = run_concurrently(
        work.stop,
        lambda: stages.refine_map(problem, work, maps, known[0]),
        lambda: stages.with_coexisting_orbits(problem, work, maps, known),
    )
    best, reference = designs
    yield {"optimum": best, "bound": stages.bounded(problem, maps, refined, best)}
    active, free_slopes = active_constraints(problem.case, best)
    yield {
        "seed_choice": reference,
        "active": active,
        "free_slopes": free_slopes,
        "load_sheets": stages.load_sheets(
            problem.searched.machine.given,
            {"optimum": best, problem.searched.compared_with: reference},
        ),
    }
    yield {"fronts": stages.trade(problem, work, best, maps)}
